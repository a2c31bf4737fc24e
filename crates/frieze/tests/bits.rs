//! Law 6: the same bytes at every SIMD level, on every number of threads, in debug and release builds and on every
//! machine. The table holds the hashes of all frames; the gate runs this test again on emulated CPUs, with
//! `FRIEZE_BITS=quick`, which leaves out what one CPU shows as well as another (thread counts).
#![allow(clippy::print_stderr, reason = "says which levels this machine lacks")]

#[path = "pictures/scenes.rs"]
mod scenes;

use frieze::frame::{Frame, Values};
use frieze::image::Pixels;
use frieze::job::Job;
use frieze::math::lane::Level;
use frieze::prepare::Prepared;
use frieze::render::{Aov, Format, RenderOptions, frame};

const SIZE: (u32, u32) = (96, 64);

/// Per scene: name, 8 bits with one sample, 8 bits with four, linear floats with every extra plane. A change means
/// that pictures change for everyone: renew the golden pictures first, look at them, then take the table that the
/// failing test prints.
const TABLE: &str = include_str!("pictures/hashes.txt");

/// FNV-1a.
struct Hash(u64);

impl Hash {
    fn bytes(&mut self, bytes: impl IntoIterator<Item = u8>) {
        self.0 = bytes.into_iter().fold(self.0, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
    }
}

/// A hash of everything that a frame holds.
fn hash(frame: &Frame) -> u64 {
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    hash.bytes([frame.color.width(), frame.color.height()].into_iter().flat_map(u32::to_le_bytes));
    match frame.color.pixels() {
        Pixels::U8(v) => hash.bytes(v.iter().copied()),
        Pixels::U16(v) => hash.bytes(v.iter().flat_map(|v| v.to_le_bytes())),
        Pixels::F16(v) => hash.bytes(v.iter().flat_map(|v| v.to_le_bytes())),
        Pixels::F32(v) => hash.bytes(v.iter().flat_map(|v| v.to_le_bytes())),
    }
    for plane in &frame.planes {
        hash.bytes(plane.name.bytes());
        match &plane.values {
            Values::F32(v) => hash.bytes(v.iter().flat_map(|v| v.to_le_bytes())),
            Values::U32(v) => hash.bytes(v.iter().flat_map(|v| v.to_le_bytes())),
        }
    }
    hash.0
}

/// The hashes of a scene's three frames.
fn hashes(prepared: &Prepared, job: &Job, level: Level) -> [u64; 3] {
    let base = RenderOptions { job: job.clone(), level, size: SIZE, ..Default::default() };
    let all = Aov::ALL.map(|(_, aov)| aov).to_vec();
    [
        RenderOptions { samples: 1, ..base.clone() },
        RenderOptions { samples: 4, ..base.clone() },
        RenderOptions { format: Format::F32, aovs: all, ..base },
    ]
    .map(|options| hash(&frame(prepared, &options).expect("the scene can be rendered").0))
}

#[test]
fn frames_have_the_same_bits_everywhere() {
    let quick = std::env::var("FRIEZE_BITS").is_ok_and(|v| v == "quick");
    let levels = Level::available();
    for name in Level::NAMES.iter().filter(|n| levels.iter().all(|l| l.name() != **n)) {
        eprintln!("skipped: this CPU has no {name}");
    }
    let mut wrong = Vec::new();
    let mut table = String::new();
    for name in scenes::names() {
        let scene = scenes::scene(name);
        let threads: &[usize] = if quick { &[2] } else { &[1, 2, 3, 7] };
        let mut first: Option<[u64; 3]> = None;
        for &n in threads {
            let job = Job::builder().threads(n).build();
            // What is prepared must not depend on the number of threads either.
            let prepared = Prepared::new(&scene, &job).expect("the scene can be prepared");
            for level in &levels {
                let got = hashes(&prepared, &job, *level);
                let reference = *first.get_or_insert(got);
                for (k, what) in ["1 sample", "4 samples", "floats"].into_iter().enumerate() {
                    if got[k] != reference[k] {
                        wrong.push(format!("{name}, {what}: {n} threads at level {} differ", level.name()));
                    }
                }
            }
        }
        let [a, b, c] = first.expect("at least one frame");
        table.push_str(&format!("{name} {a:016x} {b:016x} {c:016x}\n"));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let differ: Vec<&str> = table.lines().filter(|line| !TABLE.lines().any(|known| known == *line)).collect();
    assert!(table == TABLE, "not as in the table: {differ:#?}\nThe whole table:\n{table}");
}

#[test]
fn the_hash_sees_every_bit() {
    let scene = scenes::scene("cup");
    let job = Job::default();
    let options = RenderOptions { size: (9, 7), aovs: vec![Aov::Object, Aov::Depth], job, ..Default::default() };
    let one = frieze::render(&scene, &options).unwrap();
    let mut planes = [one.clone(), one.clone()];
    let Values::U32(ids) = &mut planes[0].planes[0].values else { panic!("ids") };
    ids[62] ^= 1;
    let Values::F32(depths) = &mut planes[1].planes[1].values else { panic!("depths") };
    depths[0] = -depths[0];
    assert!(planes.iter().all(|p| hash(p) != hash(&one)));
    assert_eq!(hash(&one.clone()), hash(&one));
}
