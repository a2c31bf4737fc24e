//! Normal <-> texel.
