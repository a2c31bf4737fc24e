//! `--camera`, and how the camera moves for `--turntable` and `--bench`.

use crate::args::did_you_mean;
use frieze::math::exact::{cos_f64, sin_f64};
use frieze::math::vec::{Mat4, Vec3};
use frieze::scene::{Camera, Projection, Scene, View};
use frieze::{Error, Result};

/// What `--camera` asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// Fitted to the scene, whatever cameras it has.
    Auto,
    /// The camera of that name or number.
    Named(String),
    /// The scene's camera with these changes.
    Spec(Spec),
}

/// A camera as typed; what is `None` stays as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spec {
    eye: Option<Vec3>,
    target: Option<Vec3>,
    up: Option<Vec3>,
    projection: Option<Projection>,
    near: Option<f32>,
    far: Option<f32>,
}

const KEYS: [&str; 7] = ["eye", "target", "up", "fov", "ortho", "near", "far"];

/// Reads the argument of `--camera`.
pub fn parse(s: &str) -> core::result::Result<Choice, String> {
    if s == "auto" {
        return Ok(Choice::Auto);
    }
    if !s.contains('=') {
        return if s.trim().is_empty() { Err("a camera is needed".into()) } else { Ok(Choice::Named(s.to_owned())) };
    }
    let mut spec = Spec::default();
    for word in s.split_whitespace() {
        let (key, value) = word.split_once('=').ok_or_else(|| {
            format!("`{word}` is not key=value; write \"eye=x,y,z target=x,y,z fov=45\" without spaces after commas")
        })?;
        let number = || match value.parse::<f32>() {
            Ok(v) if !v.is_nan() => Ok(v),
            _ => Err(format!("{key}: `{value}` is not a number")),
        };
        let within = |lo: f32, hi: f32| match number()? {
            v if v > lo && v <= hi => Ok(v),
            v => Err(format!("{key}: {v} is out of range")),
        };
        let vector = || {
            let v: Vec<f32> = value.split(',').filter_map(|p| p.parse().ok()).filter(|v: &f32| v.is_finite()).collect();
            match v[..] {
                [x, y, z] if value.split(',').count() == 3 => Ok(Some(Vec3::new(x, y, z))),
                _ => Err(format!("{key}: `{value}` is not three numbers x,y,z")),
            }
        };
        match key {
            "eye" => spec.eye = vector()?,
            "target" => spec.target = vector()?,
            "up" => spec.up = vector()?,
            "fov" | "ortho" if spec.projection.is_some() => return Err("fov and ortho exclude each other".into()),
            "fov" => spec.projection = Some(Projection::Perspective { fov_y: within(0.0, 179.999)? }),
            "ortho" => spec.projection = Some(Projection::Orthographic { height: within(0.0, f32::MAX)? }),
            "near" => spec.near = Some(within(0.0, f32::MAX)?),
            "far" => spec.far = Some(within(0.0, f32::INFINITY)?),
            _ => {
                return Err(format!(
                    "no camera has `{key}`{}; there are {}",
                    did_you_mean(key, &KEYS),
                    KEYS.join(", ")
                ));
            }
        }
    }
    if spec.eye.is_some() && spec.eye == spec.target {
        return Err("eye and target are the same point".into());
    }
    Ok(Choice::Spec(spec))
}

/// The camera that a scene is seen with.
///
/// # Errors
/// `camera.unknown` for a name that no camera has.
pub fn camera(scene: &Scene, choice: Option<&Choice>, size: (u32, u32)) -> Result<Camera> {
    let own = || match scene.view {
        View::Camera(k) if k < scene.cameras.len() => scene.cameras[k].clone(),
        _ => fitted(scene, size),
    };
    let spec = match choice {
        None => return Ok(own()),
        Some(Choice::Auto) => return Ok(fitted(scene, size)),
        Some(Choice::Named(name)) => {
            let by_name = scene.cameras.iter().find(|c| c.name == *name);
            let by_number = || name.parse::<usize>().ok().and_then(|k| scene.cameras.get(k));
            return by_name.or_else(by_number).cloned().ok_or_else(|| {
                let names: Vec<String> = (0..scene.cameras.len())
                    .map(|k| match &scene.cameras[k].name[..] {
                        "" => k.to_string(),
                        n => format!("{n} ({k})"),
                    })
                    .collect();
                let plain: Vec<&str> = scene.cameras.iter().map(|c| &c.name[..]).collect();
                Error::arguments("camera.unknown", format!("there is no camera `{name}`{}", did_you_mean(name, &plain)))
                    .remedy(if names.is_empty() {
                        "the scene has no cameras; use auto or \"eye=x,y,z target=x,y,z\"".to_owned()
                    } else {
                        format!("the scene has {}", names.join(", "))
                    })
            });
        }
        Some(Choice::Spec(spec)) => spec,
    };
    let base = own();
    let mut camera = base.clone();
    if spec.eye.is_some() || spec.target.is_some() || spec.up.is_some() {
        let (eye, target) = (spec.eye.unwrap_or(base.eye()), spec.target.unwrap_or(base.target));
        camera = Camera::look_at(eye, target, spec.up.unwrap_or(Vec3::new(0.0, 1.0, 0.0)), 45.0);
        camera.projection = base.projection;
    }
    camera.projection = spec.projection.unwrap_or(camera.projection);
    camera.near = spec.near.unwrap_or(camera.near);
    camera.far = spec.far.unwrap_or(camera.far);
    if camera.near >= camera.far {
        return Err(Error::arguments(
            "camera.range",
            format!("near ({}) is not before far ({})", camera.near, camera.far),
        ));
    }
    Ok(camera)
}

/// The library's own choice for a bare model, so that a turntable and a benchmark see what a plain render sees.
fn fitted(scene: &Scene, (width, height): (u32, u32)) -> Camera {
    let unit = (Vec3::splat(-1.0), Vec3::splat(1.0));
    Camera::fit(scene.bounds().unwrap_or(unit), width.max(1) as f32 / height.max(1) as f32)
}

/// The camera gone `turn` of a full turn around the vertical line through its target, counter-clockwise
/// seen from above.
pub fn turned(camera: &Camera, turn: f64) -> Camera {
    let half = std::f64::consts::PI * turn;
    let r = Mat4::rotation([0.0, sin_f64(half) as f32, 0.0, cos_f64(half) as f32]);
    let (to, back) = (Mat4::translation(camera.target), Mat4::translation(-camera.target));
    Camera { transform: to.times(&r).times(&back).times(&camera.transform), ..camera.clone() }
}

/// The camera of the `k`th frame of a benchmark: moved to its right by `k` * 1e-4 of its distance.
pub fn moved(camera: &Camera, k: u32) -> Camera {
    let step = (camera.target - camera.eye()).length() * 1e-4 * k as f32;
    let right = camera.transform.column(0).xyz().normalize();
    Camera { transform: Mat4::translation(right * step).times(&camera.transform), ..camera.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_read() {
        assert_eq!(parse("auto"), Ok(Choice::Auto));
        assert_eq!(parse("Front"), Ok(Choice::Named("Front".into())));
        let Ok(Choice::Spec(s)) = parse("eye=1,2,3 target=0,0,0 fov=45 far=inf") else { panic!() };
        assert_eq!(s.eye, Some(Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(s.projection, Some(Projection::Perspective { fov_y: 45.0 }));
        for wrong in
            ["", "eye=1,2", "eye=1,2,3,4", "eye=1,2,x", "fov=0", "fov=180", "fov=NaN", "fov=45 ortho=2", "near=-1"]
        {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        assert!(parse("taget=0,0,0").unwrap_err().contains("`target`"));
    }

    #[test]
    fn a_turn_keeps_distance_and_height() {
        let c = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.5, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), 45.0);
        let d = (c.eye() - c.target).length();
        let q = turned(&c, 0.25);
        // f32 rounding of coordinates up to 3.
        assert!(((q.eye() - q.target).length() - d).abs() < 2e-6 && (q.eye().y - 2.0).abs() < 2e-6);
        // A quarter turn takes +z to +x.
        assert!((q.eye().x - (0.5 + 3.0)).abs() < 2e-6 && (q.eye().z - -0.5).abs() < 2e-6, "{:?}", q.eye());
    }

    #[test]
    fn the_fitted_camera_sees_the_whole_sphere() {
        for size in [(100, 100), (200, 100), (100, 300)] {
            let scene = Scene::default();
            let c = fitted(&scene, size);
            let d = f64::from((c.eye() - c.target).length());
            let t =
                frieze::math::exact::tan_f64(17.5f64.to_radians()) * (f64::from(size.0) / f64::from(size.1)).min(1.0);
            // Half the angle of the sphere of radius sqrt(3) is below half the angle of view.
            assert!(3f64.sqrt() / d < t / (1.0 + t * t).sqrt(), "{size:?}");
        }
    }
}
