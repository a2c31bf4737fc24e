//! Tangent frames: MikkTSpace, averaged, per triangle.
