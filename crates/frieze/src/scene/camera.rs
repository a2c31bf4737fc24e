//! Cameras look along -Z, +Y up, as in glTF.

use crate::math::exact;
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

/// A projection for a picture of a certain size: camera space (x right, y up, looking along -z) at distance
/// `d` in front of the camera is seen at pixel (px, py) when `x = d (ax px + bx)`, `y = d (ay py + by)`, for parallel
/// projections without the `d`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// See above.
    pub a: [f64; 2],
    /// See above.
    pub b: [f64; 2],
    /// Whether rays are parallel.
    pub parallel: bool,
    /// Nearest distance.
    pub near: f64,
    /// Farthest distance; may be infinite unless parallel.
    pub far: f64,
}

impl Lens {
    /// Camera space to homogeneous picture coordinates: x and y in pixels times w, z / w the reversed depth (1 at
    /// near, 0 at far), rows of the matrix in f64.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        let (near, far) = (self.near, self.far);
        let ([ax, ay], [bx, by]) = (self.a, self.b);
        if self.parallel {
            // d = -z; depth = (far - d) / (far - near)
            let r = 1.0 / (far - near);
            return [
                [1.0 / ax, 0.0, 0.0, -bx / ax],
                [0.0, 1.0 / ay, 0.0, -by / ay],
                [0.0, 0.0, r, far * r],
                [0.0, 0.0, 0.0, 1.0],
            ];
        }
        // depth = near (far - d) / (d (far - near)), near / d for an infinite far plane.
        let z = if far.is_finite() {
            let r = near / (far - near);
            [0.0, 0.0, r, far * r]
        } else {
            [0.0, 0.0, 0.0, near]
        };
        [[1.0 / ax, 0.0, bx / ax, 0.0], [0.0, 1.0 / ay, by / ay, 0.0], z, [0.0, 0.0, -1.0, 0.0]]
    }
}

impl Camera {
    /// The camera that shows a whole box: azimuth 30 degrees, elevation 20 degrees, 35 degrees of view, 5 % margin
    /// around the bounding sphere, so that turning it never cuts anything off.
    pub fn fit(bounds: (Vec3, Vec3), aspect: f32) -> Camera {
        let center = (bounds.0 + bounds.1) * 0.5;
        let radius = f32::max((bounds.1 - bounds.0).length() * 0.5, 1e-6);
        let fov_y = 35.0f64;
        let half_y = exact::tan_f64((fov_y * 0.5).to_radians());
        let half = half_y * f64::from(aspect.min(1.0));
        // sin(atan(half))
        let distance = f64::from(radius) * 1.05 / (half / (1.0 + half * half).sqrt());
        let (az, el) = (30f64.to_radians(), 20f64.to_radians());
        let out = Vec3::new(
            (exact::sin_f64(az) * exact::cos_f64(el)) as f32,
            exact::sin_f64(el) as f32,
            (exact::cos_f64(az) * exact::cos_f64(el)) as f32,
        );
        let eye = center + out * distance as f32;
        Camera::look_at(eye, center, Vec3::new(0.0, 1.0, 0.0), fov_y as f32)
    }
    /// The projection for a picture of this size.
    pub fn lens(&self, width: u32, height: u32) -> Lens {
        let (w, h) = (f64::from(width), f64::from(height));
        let near = f64::from(self.near);
        let far = f64::from(self.far);
        let centered = |half_y: f64, parallel| {
            let (hx, hy) = (half_y * w / h, half_y);
            Lens { a: [2.0 * hx / w, -2.0 * hy / h], b: [-hx, hy], parallel, near, far }
        };
        match self.projection {
            Projection::Perspective { fov_y } => centered(exact::tan_f64((f64::from(fov_y) * 0.5).to_radians()), false),
            Projection::Orthographic { height } => centered(f64::from(height) * 0.5, true),
            Projection::Intrinsics { fx, fy, cx, cy } => {
                let (fx, fy, cx, cy) = (f64::from(fx), f64::from(fy), f64::from(cx), f64::from(cy));
                Lens { a: [1.0 / fx, -1.0 / fy], b: [-cx / fx, cy / fy], parallel: false, near, far }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_picture_is_straight_ahead_and_depth_is_reversed() {
        let camera = Camera {
            near: 0.5,
            far: 10.0,
            ..Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::new(0.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), 45.0)
        };
        let m = camera.lens(200, 100).rows();
        let at = |p: [f64; 4]| -> [f64; 4] { core::array::from_fn(|r| (0..4).map(|k| m[r][k] * p[k]).sum()) };
        let p = at([0.0, 0.0, -5.0, 1.0]);
        // f64 rounding of pixels up to 200.
        assert!((p[0] / p[3] - 100.0).abs() < 1e-12 && (p[1] / p[3] - 50.0).abs() < 1e-12);
        let (near, far) = (at([0.0, 0.0, -0.5, 1.0]), at([0.0, 0.0, -10.0, 1.0]));
        // f64 rounding.
        assert!((near[2] / near[3] - 1.0).abs() < 1e-12 && (far[2] / far[3]).abs() < 1e-12);
        // Up in space is up in the picture: smaller y.
        let up = at([0.0, 1.0, -5.0, 1.0]);
        assert!(up[1] / up[3] < 50.0);
    }
}
