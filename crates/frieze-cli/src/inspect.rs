//! `frieze inspect`
use crate::args::{Common, Inspect};
use crate::talk::Talk;
use frieze::Result;
pub fn run(_: &Inspect, _: &Common, _: &Talk) -> Result<()> {
    todo!()
}
