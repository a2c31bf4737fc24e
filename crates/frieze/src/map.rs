//! A map is data you can query while shading: `at(place, footprint)`.

mod area;
pub mod evidence;
mod fetch;
pub mod filter;
#[allow(clippy::module_inception)]
pub mod map;
pub mod normal;
pub mod shadow;
#[cfg(test)]
mod tests;

pub use filter::{Filter, Wrap};
pub use map::{Footprint, Map, Tap};
