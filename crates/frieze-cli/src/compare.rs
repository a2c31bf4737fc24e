//! `frieze compare`: how two pictures or maps differ.
use crate::args::{Common, Compare};
use crate::talk::Talk;
use clap::ValueEnum;
use frieze::Result;

/// A figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Metric {
    Max,
    Rmse,
    Psnr,
    Flip,
    Angle,
}
/// A limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    pub metric: Metric,
    pub value: f64,
}
pub fn above(s: &str) -> core::result::Result<Limit, String> {
    limit(s)
}
pub fn below(s: &str) -> core::result::Result<Limit, String> {
    limit(s)
}
fn limit(s: &str) -> core::result::Result<Limit, String> {
    Err(format!("{s}"))
}
pub fn run(_: &Compare, _: &Common, _: &Talk) -> Result<()> {
    todo!()
}
