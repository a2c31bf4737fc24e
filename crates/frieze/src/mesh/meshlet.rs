//! Clusters of at most 64 vertices and 128 triangles, for culling and vertex reuse.
