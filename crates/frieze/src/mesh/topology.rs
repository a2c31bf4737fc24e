//! Who touches whom; vertex normals.
