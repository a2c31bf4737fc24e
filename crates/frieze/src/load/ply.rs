//! Lands next.
use super::files::Blob;
use super::{Context, Findings};
use crate::error::Result;
use crate::scene::Scene;

pub(super) fn read(_blob: &Blob<'_>, _context: &Context<'_>, _findings: &mut Findings) -> Result<Scene> {
    Ok(Scene::default())
}
