//! `--bench N`: N more frames into memory, each from `Prepared` alone, and what they took.

use crate::view;
use frieze::Result;
use frieze::prepare::Prepared;
use frieze::render::{RenderOptions, frame};
use frieze::scene::Camera;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// What N frames took.
#[derive(Serialize)]
pub struct Bench {
    /// How many.
    frames: u32,
    /// Wall time of the median frame, milliseconds.
    median_ms: f64,
    /// Wall time of the fastest frame, milliseconds.
    min_ms: f64,
    /// Mean user and system time of the process per frame, milliseconds; null where the system has no such
    /// clock.
    cpu_ms: Option<f64>,
    /// The SIMD level.
    simd: &'static str,
    /// Threads of the job.
    threads: usize,
    /// Mean wall time per stage, milliseconds.
    stages: BTreeMap<&'static str, f64>,
    /// What the last frame counted: nothing is kept from the frame before.
    counters: BTreeMap<&'static str, u64>,
}

/// Renders `n` frames; frame k sees the scene from `base` moved by k * 1e-4 of its distance.
pub fn run(prepared: &Prepared, options: &RenderOptions, base: &Camera, n: u32) -> Result<Bench> {
    let mut walls = Vec::with_capacity(n as usize);
    let mut stages = Vec::new();
    let mut counters = Vec::new();
    let cpu = cpu_time();
    for k in 1..=n {
        let options = RenderOptions { camera: Some(view::moved(base, k)), ..options.clone() };
        let start = Instant::now();
        let (picture, report) = frame(prepared, &options)?;
        walls.push(start.elapsed().as_secs_f64() * 1e3);
        black_box(&picture);
        stages.extend(report.stages);
        counters = report.counters;
        options.job.check()?;
    }
    let cpu_ms = cpu.zip(cpu_time()).map(|(from, to)| (to.saturating_sub(from)).as_secs_f64() * 1e3 / f64::from(n));
    walls.sort_by(f64::total_cmp);
    let middle = walls.len() / 2;
    let median_ms = if walls.len() % 2 == 1 { walls[middle] } else { (walls[middle - 1] + walls[middle]) / 2.0 };
    let mut stages = sums(&stages);
    stages.values_mut().for_each(|v| *v /= f64::from(n));
    Ok(Bench {
        frames: n,
        median_ms,
        min_ms: walls[0],
        cpu_ms,
        simd: options.level.name(),
        threads: options.job.threads(),
        stages,
        counters: counters.into_iter().collect(),
    })
}

/// Milliseconds per stage; a stage that ran twice counts twice.
pub fn sums(stages: &[(&'static str, Duration)]) -> BTreeMap<&'static str, f64> {
    let mut all = BTreeMap::new();
    for (name, time) in stages {
        *all.entry(*name).or_default() += time.as_secs_f64() * 1e3;
    }
    all
}

/// User and system time of all threads of this process.
#[cfg(unix)]
pub fn cpu_time() -> Option<Duration> {
    use rustix::time::{ClockId, clock_gettime};
    let t = clock_gettime(ClockId::ProcessCPUTime);
    Some(Duration::new(u64::try_from(t.tv_sec).ok()?, u32::try_from(t.tv_nsec).ok()?))
}

#[cfg(not(unix))]
pub fn cpu_time() -> Option<Duration> {
    None
}

impl fmt::Display for Bench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} frames: median {:.2} ms, fastest {:.2} ms", self.frames, self.median_ms, self.min_ms)?;
        if let Some(cpu) = self.cpu_ms {
            write!(f, ", processor {cpu:.2} ms per frame")?;
        }
        write!(f, " ({}, {} threads)", self.simd, self.threads)?;
        for (name, ms) in &self.stages {
            write!(f, "\n  {name:<12} {ms:8.2} ms")?;
        }
        for (name, n) in &self.counters {
            write!(f, "\n  {name:<24} {n}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #[cfg(unix)]
    #[test]
    fn the_processor_clock_counts_work_and_not_sleep() {
        use super::*;
        let from = cpu_time().unwrap();
        let start = Instant::now();
        while start.elapsed() < Duration::from_millis(20) {
            black_box(0);
        }
        assert!(cpu_time().unwrap() > from);
    }
}
