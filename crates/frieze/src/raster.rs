//! Triangles -> samples, on the screen or in UV space; knows nothing of shading.

pub mod fragments;
