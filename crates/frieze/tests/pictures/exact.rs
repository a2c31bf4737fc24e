//! Scenes whose pictures can be computed by hand: a camera whose world is the picture, a small generator of numbers,
//! and what the tests ask of a frame. Shared by `raster.rs`, `render.rs` and `shadow.rs`.
#![allow(dead_code, reason = "each of the tests uses a part")]

use frieze::Frame;
use frieze::frame::Values;
use frieze::image::Pixels;
use frieze::math::vec::Vec3;
use frieze::mesh::{Attribute, Mesh};
use frieze::prepare::Prepared;
use frieze::render::{Aov, Format, RenderOptions, Report, frame};
use frieze::scene::{Background, Camera, Material, Model, Output, Projection, Scene, View};

/// A fixed sequence of numbers without pattern (Steele and Vigna's SplitMix64).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }
    /// 0 .. n.
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }
    /// 0 .. 1.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }
    /// `lo` .. `hi`.
    pub fn within(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * self.unit()
    }
    /// A direction of unit length.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0));
            if (0.01..1.0).contains(&v.length2()) {
                return v.normalize();
            }
        }
    }
    /// A turn, as a quaternion.
    pub fn turn(&mut self) -> [f32; 4] {
        let (axis, w) = (self.direction(), self.within(-1.0, 1.0));
        let s = (1.0 - w * w).sqrt();
        [axis.x * s, axis.y * s, axis.z * s, w]
    }
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for k in (1..list.len()).rev() {
            list.swap(k, self.below(k as u64 + 1) as usize);
        }
    }
}

/// Parallel rays: the world point (x, h - y, z) is seen at (x, y) of a picture of w x h pixels, at reversed depth
/// z / 256. No rounding happens on the way where z is whole and x and y are multiples of 1/512 below 2^13.
pub fn flat_camera(width: u32, height: u32) -> Camera {
    let eye = Vec3::new(width as f32 / 2.0, height as f32 / 2.0, 257.0);
    let up = Vec3::new(0.0, 1.0, 0.0);
    let camera = Camera::look_at(eye, eye - Vec3::new(0.0, 0.0, 1.0), up, 45.0);
    Camera { projection: Projection::Orthographic { height: height as f32 }, near: 1.0, far: 257.0, ..camera }
}

/// A scene that shows numbers as they are: no light, nothing where nothing is, one sample.
pub fn bare(camera: Camera) -> Scene {
    let output = Output { background: Background::Transparent, samples: 1, ..Output::default() };
    Scene { cameras: vec![camera], view: View::Camera(0), output, ..Scene::default() }
}

/// A material that is its vertex colours, both sides.
pub fn plain() -> Material {
    Material { model: Model::Unlit, double_sided: true, ..Material::default() }
}

/// A mesh of triangles that share nothing.
pub fn soup(triangles: &[[[f32; 3]; 3]]) -> Mesh {
    let positions: Vec<[f32; 3]> = triangles.iter().flatten().copied().collect();
    Mesh { corners: (0..positions.len() as u32).collect(), positions, ..Mesh::default() }
}

/// Gives each triangle of a mesh a colour.
pub fn painted(mesh: Mesh, colors: Vec<[f32; 4]>) -> Mesh {
    let index = (0..mesh.corners.len() as u32).map(|c| c / 3).collect();
    Mesh { colors: Some(Attribute { values: colors, index: Some(index) }), ..mesh }
}

/// A picture in linear floats with some planes.
pub fn shoot(scene: &Scene, size: (u32, u32), samples: u32, aovs: &[Aov]) -> Frame {
    shoot_and_count(scene, size, samples, aovs).0
}

/// The same with what was counted.
pub fn shoot_and_count(scene: &Scene, size: (u32, u32), samples: u32, aovs: &[Aov]) -> (Frame, Report) {
    let options = RenderOptions { size, samples, format: Format::F32, aovs: aovs.to_vec(), ..Default::default() };
    let prepared = Prepared::new(scene, &options.job).expect("the scene can be prepared");
    frame(&prepared, &options).expect("the scene can be rendered")
}

/// Linear RGBA, row after row.
pub fn rgba(frame: &Frame) -> &[[f32; 4]] {
    let Pixels::F32(v) = frame.color.pixels() else { panic!("floats were asked for") };
    v.as_chunks().0
}

/// A plane of ids.
pub fn ids(frame: &Frame, plane: usize) -> &[u32] {
    let Values::U32(v) = &frame.planes[plane].values else { panic!("ids were asked for") };
    v
}

/// A plane of `N` floats per pixel.
pub fn floats<const N: usize>(frame: &Frame, plane: usize) -> &[[f32; N]] {
    let Values::F32(v) = &frame.planes[plane].values else { panic!("floats were asked for") };
    v.as_chunks().0
}
