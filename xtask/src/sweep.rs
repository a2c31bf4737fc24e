//! Checks that take too long for the gate.

use frieze::math::lane::Level;
use frieze::{Job, RenderOptions, render, samples};
use std::time::Instant;

/// Every built-in scene in its own size, with 1 and 4 samples, at every SIMD level and several thread counts: all
/// pictures of a scene have the same bytes.
pub fn run() -> Result<(), String> {
    let (start, mut frames, mut wrong) = (Instant::now(), 0, Vec::new());
    for (name, _) in samples::NAMES {
        let scene = samples::scene(name).ok_or("a built-in scene is missing")?;
        for samples in [1, 4] {
            let mut want = None;
            for level in Level::available() {
                for threads in [1, 2, 3, 7] {
                    let job = Job::builder().threads(threads).build();
                    let options = RenderOptions { level, samples, job, ..RenderOptions::default() };
                    let color = render(&scene, &options).map_err(|e| format!("{name}: {e}"))?.color;
                    frames += 1;
                    if *want.get_or_insert_with(|| color.clone()) != color {
                        wrong.push(format!("{name}, {samples} samples, {}, {threads} threads", level.name()));
                    }
                }
            }
            println!("{name:20} {samples} samples");
        }
    }
    let levels: Vec<&str> = Level::available().iter().map(|l| l.name()).collect();
    println!("{frames} frames at {} x 1, 2, 3, 7 threads in {:.0} s", levels.join(", "), start.elapsed().as_secs_f64());
    if wrong.is_empty() { Ok(()) } else { Err(format!("other bytes: {}", wrong.join("; "))) }
}
