//! Makes maps. Never meets [`shade`](crate::shade), which asks them: what a texel means is said in
//! [`map`](crate::map), for both.

pub mod block;
pub mod convert;
pub mod fft;
pub mod poisson;
pub mod repair;
pub mod slope;
pub mod space;
pub mod texels;

pub use convert::convert;
pub use texels::{Depth, Field};

#[cfg(test)]
mod tests;
