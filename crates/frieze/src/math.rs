//! Lanes, vectors, functions with the same bits everywhere, sampling, microfacets.

pub mod exact;
pub mod lane;
pub mod microfacet;
pub mod sample;
pub mod vec;
