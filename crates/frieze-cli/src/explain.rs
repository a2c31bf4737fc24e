//! `frieze explain`: why a pixel has its colour.

use crate::args::{Common, Explain};
use crate::talk::Talk;
use crate::{source, version, view};
use frieze::load::LoadOptions;
use frieze::{Error, Result};

/// Explains; for now only as far as the arguments go, because the library does not record yet.
pub fn run(a: &Explain, common: &Common, talk: &Talk) -> Result<()> {
    version::level()?;
    let options = LoadOptions { job: talk.job(common), allow_outside: a.allow_outside };
    let loaded = source::open(&a.scene, &options)?;
    let [w, h] = loaded.scene.output.size;
    let (w, h) = a.size.unwrap_or((w, h));
    let (x, y) = a.pixel;
    if x >= w || y >= h {
        return Err(Error::arguments("explain.pixel", format!("the picture is {w}x{h}; it has no pixel {x},{y}"))
            .remedy("columns count from the left and rows from the top, both from 0"));
    }
    let _camera = view::camera(&loaded.scene, a.camera.as_ref(), (w, h))?;
    Err(Error::arguments("arguments.not-yet", "explaining a pixel comes with a later version of frieze"))
}
