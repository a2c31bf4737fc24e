//! The one shading definition: surface + maps + lights -> colour.
