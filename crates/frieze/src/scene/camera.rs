//! Cameras look along -Z, +Y up, as in glTF.

use crate::math::vec::{Mat4, Vec3};

/// How a camera maps space to the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Full vertical field of view in degrees.
    Perspective {
        /// Degrees, 0 < fov < 180.
        fov_y: f32,
    },
    /// Parallel rays.
    Orthographic {
        /// Metres from the lower to the upper edge of the picture.
        height: f32,
    },
    /// A calibrated pinhole: pixels, origin at the upper left corner of the picture, +y down.
    Intrinsics {
        /// Focal length in pixels along x.
        fx: f32,
        /// Focal length in pixels along y.
        fy: f32,
        /// Principal point, x.
        cx: f32,
        /// Principal point, y.
        cy: f32,
    },
}

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its name in the file, or empty.
    pub name: String,
    /// Camera to world; rigid (scale is ignored when a node has one).
    pub transform: Mat4,
    /// What it looks at: orbits and `--bench` turn about it.
    pub target: Vec3,
    /// How space is mapped to the picture.
    pub projection: Projection,
    /// Distance of the near plane, metres, > 0 for perspective.
    pub near: f32,
    /// Distance of the far plane, metres; may be infinite.
    pub far: f32,
}

impl Camera {
    /// A perspective camera at `eye` that looks at `target`.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, fov_y: f32) -> Self {
        let distance = (target - eye).length();
        Camera {
            name: String::new(),
            transform: Mat4::look_at(eye, target, up).inverse().unwrap_or_default(),
            target,
            projection: Projection::Perspective { fov_y },
            near: (distance * 0.01).max(1e-6),
            far: f32::INFINITY,
        }
    }
    /// Where it is.
    pub fn eye(&self) -> Vec3 {
        self.transform.column(3).xyz()
    }
}
