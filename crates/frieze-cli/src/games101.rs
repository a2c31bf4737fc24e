//! `frieze games101`
use crate::args::{Common, Games101};
use crate::talk::Talk;
use frieze::Result;
pub fn run(_: &Games101, _: &Common, _: &Talk) -> Result<()> {
    todo!()
}
