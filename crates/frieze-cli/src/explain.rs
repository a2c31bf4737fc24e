//! `frieze explain`
use crate::args::{Common, Explain};
use crate::talk::Talk;
use frieze::Result;
pub fn run(_: &Explain, _: &Common, _: &Talk) -> Result<()> {
    todo!()
}
