//! Law 11: what does not fit into the memory that is allowed is refused before it is allocated. Alone in its process, so
//! that nothing else takes memory between two readings.
#![cfg(target_os = "linux")]

use frieze::error::Fault;
use frieze::job::Job;
use frieze::math::vec::{Mat4, Vec3};
use frieze::mesh::shape;
use frieze::prepare::Prepared;
use frieze::render::{Aov, Format, RenderOptions, frame, light_depth};
use frieze::scene::{Light, Scene, Shadow};

/// The most address space that this process has had, bytes. Memory that was asked for and never touched counts.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|l| l.starts_with("VmPeak")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
}

#[test]
fn pictures_and_maps_over_the_budget_are_refused_before_they_are_allocated() {
    let mut scene = Scene::default();
    scene.meshes.push(shape::cube(1.0));
    scene.objects.push(frieze::scene::Object {
        name: String::new(),
        mesh: 0,
        transform: Mat4::IDENTITY,
        materials: Vec::new(),
    });
    let prepared = Prepared::new(&scene, &Job::default()).unwrap();
    let light = Light::directional(Vec3::new(1.0, 2.0, 3.0), Vec3::default());
    scene.lights.push(Light { shadow: Some(Shadow { size: 8192, ..Shadow::default() }), ..light });
    let shadowed = Prepared::new(&scene, &Job::default()).unwrap();
    let job = Job::builder().threads(2).memory(100 << 20).build();
    // Threads are started now, not between two readings.
    let small = RenderOptions { job: job.clone(), size: (16, 16), ..RenderOptions::default() };
    frame(&prepared, &small).unwrap();
    let before = peak();
    let refused = |asked: Result<(), frieze::Error>| {
        let e = asked.expect_err("it does not fit");
        assert_eq!((e.fault, e.code), (Fault::Memory, "job.memory"));
        assert!(e.remedy.is_some());
    };
    let draw = |prepared: &Prepared, options: &RenderOptions| frame(prepared, options).map(|_| ());
    // 137 MiB of colour, and 800 MiB of planes beside 34 MiB of colour; 256 MiB of shadow map.
    let large = RenderOptions { size: (3000, 3000), format: Format::F32, ..small.clone() };
    refused(draw(&prepared, &large));
    let aovs = Aov::ALL.map(|(_, aov)| aov).to_vec();
    refused(draw(&prepared, &RenderOptions { aovs, format: Format::U8, ..large }));
    refused(draw(&shadowed, &small));
    refused(light_depth(&shadowed, 0, &small).map(|_| ()));
    assert!(peak() - before < 20 << 20, "{} MiB", (peak() - before) >> 20);
}
