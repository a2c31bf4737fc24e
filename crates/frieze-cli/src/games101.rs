//! `frieze games101`: the five shaders of assignment 3, as the course framework runs them.

use crate::args::{Common, Coverage, Games101, Lesson};
use crate::source;
use crate::talk::Talk;
use frieze::games101::{self, Options, Shader};
use frieze::load::LoadOptions;
use frieze::write::{self, WriteOptions};
use frieze::{Error, Result};
use serde_json::json;
use std::time::Instant;

/// Renders.
pub fn run(a: &Games101, common: &Common, talk: &Talk) -> Result<()> {
    let start = Instant::now();
    let shader = match a.shader {
        Lesson::Normal => Shader::Normal,
        Lesson::Phong => Shader::Phong,
        Lesson::Texture => Shader::Texture,
        Lesson::Bump => Shader::Bump,
        Lesson::Displacement => Shader::Displacement,
    };
    if shader.needs_texture() && a.texture.is_none() {
        return Err(
            Error::arguments("games101.texture", "this shader reads a texture").remedy("give one with --texture FILE")
        );
    }
    if a.out.as_os_str() == "-" {
        return Err(Error::arguments("arguments.stdout", "games101 does not write to stdout")
            .remedy("give a file: -o picture.png; `frieze render -o -` writes PNG to stdout"));
    }
    let job = talk.job(common);
    let out = WriteOptions { force: common.force, job: job.clone() };
    write::check(&a.out, &[], &out)?;
    let options = LoadOptions { job: job.clone(), allow_outside: false };
    let loaded = source::open(&a.mesh, &options)?;
    let mut findings = loaded.findings;
    let mesh = match &loaded.scene.meshes[..] {
        [mesh] => mesh,
        [] => return Err(Error::input("games101.mesh", "there is no mesh in this file").in_file(&a.mesh)),
        all => {
            return Err(Error::input("games101.mesh", format!("there are {} meshes in this file", all.len()))
                .in_file(&a.mesh)
                .remedy("the assignment draws one mesh: use an .obj such as the course's Spot"));
        }
    };
    let texture = match &a.texture {
        Some(path) => {
            let (image, more) = frieze::load::image(path, &LoadOptions { allow_outside: true, ..options })?;
            findings.extend(more);
            Some(image)
        }
        None => None,
    };
    let coverage = match a.coverage {
        Coverage::Four => games101::Coverage::Four,
        Coverage::Int => games101::Coverage::Int,
    };
    let options = Options { coverage, corrected: a.corrected, job: job.clone() };
    let frame = games101::render(shader, mesh, texture.as_ref(), &options)?;
    job.check()?;
    let outputs = write::frame(&frame, &a.out, &out)?;
    talk.finish();
    talk.findings(&findings);
    let ms = start.elapsed().as_secs_f64() * 1e3;
    talk.say(format!("{}  ({}x{}, {ms:.0} ms)", a.out.display(), games101::SIZE, games101::SIZE));
    if talk.json {
        talk.document(
            "games101",
            json!({
                "outputs": outputs.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
                "size": [games101::SIZE, games101::SIZE],
                "time_ms": { "total": ms },
                "findings": findings,
            }),
        )?;
    }
    Ok(())
}
