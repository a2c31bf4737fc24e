//! Extra planes: what they are called, in which unit and space, and how they are filled.

use super::point::{Corners, Group, Lanes};
use super::tile::clean;
use super::{Aov, Pass};
use crate::math::lane::{Lane, Num};
use crate::raster::tile::Place;
use crate::shade::Surface;

impl Aov {
    /// Its word on the command line.
    pub fn name(self) -> &'static str {
        Aov::ALL.iter().find(|(_, a)| *a == self).map_or("", |(name, _)| name)
    }
    /// Names of its channels.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Aov::Depth => &["Z"],
            Aov::Normal | Aov::ViewNormal | Aov::Tangent | Aov::Position => &["X", "Y", "Z"],
            Aov::Uv => &["U", "V"],
            Aov::Object | Aov::Material | Aov::Triangle => &["id"],
            Aov::Barycentric => &["A", "B", "C"],
            Aov::MipLevel => &["level"],
            Aov::TexelDensity => &["density"],
        }
    }
    /// The unit of its numbers.
    pub fn unit(self) -> &'static str {
        match self {
            Aov::Depth | Aov::Position => "metres",
            Aov::Normal | Aov::ViewNormal | Aov::Tangent => "unit vector",
            Aov::Uv => "texture widths",
            Aov::Object | Aov::Material | Aov::Triangle => "index",
            Aov::Barycentric => "weight",
            Aov::MipLevel => "mip level",
            Aov::TexelDensity => "texels per pixel",
        }
    }
    /// The space of its numbers.
    pub fn space(self) -> &'static str {
        match self {
            Aov::Depth => "along the camera's axis",
            Aov::Normal | Aov::Tangent | Aov::Position => "world",
            Aov::ViewNormal => "camera, +Y up, looking along -Z",
            Aov::Uv => "texture, v down",
            Aov::Object | Aov::Material => "scene",
            Aov::Triangle | Aov::Barycentric => "source mesh",
            Aov::MipLevel | Aov::TexelDensity => "albedo map",
        }
    }
    /// Whether its numbers are ids.
    pub fn is_id(self) -> bool {
        matches!(self, Aov::Object | Aov::Material | Aov::Triangle)
    }
    /// What stands where nothing is seen.
    pub(super) fn nothing(self) -> f32 {
        match self {
            Aov::Depth => f32::INFINITY,
            // The bits of u32::MAX: ids travel in floats.
            Aov::Object | Aov::Material | Aov::Triangle => f32::from_bits(u32::MAX),
            _ => 0.0,
        }
    }
}

/// Fills the planes of the pixels that `pixel` gives for the lanes.
#[inline(always)]
pub(super) fn write<L: Lane>(
    l: L,
    pass: &Pass<'_>,
    g: &Group<'_>,
    place: &Place<'_>,
    lanes: &Lanes<'_, L>,
    corners: &Corners<'_, L>,
    surface: &Surface<L>,
    planes: &mut [Vec<f32>],
    pixel: impl Fn(usize) -> Option<usize>,
) {
    let number = |id: u32| {
        let r = &place.bins.records[(id >> 7) as usize];
        let m = &g.draw.mesh.meshlets[r.meshlet as usize];
        (m, g.draw.mesh.source[m.triangles as usize + (id & 127) as usize])
    };
    let normal = if pass.aovs.iter().any(|a| matches!(a, Aov::Normal | Aov::ViewNormal)) {
        crate::shade::shading_normal(l, g.look, surface)
    } else {
        surface.normal
    };
    for (aov, plane) in pass.aovs.iter().zip(planes) {
        let n = aov.channels().len();
        let mut put = |values: &[L::F]| {
            for k in 0..L::WIDTH {
                if let Some(at) = pixel(k) {
                    for (c, v) in values.iter().enumerate() {
                        plane[at * n + c] = clean(v.lane(k));
                    }
                }
            }
        };
        match aov {
            Aov::Depth => put(&[corners.depth]),
            Aov::Normal => put(&normal.array()),
            Aov::ViewNormal => put(&g.view.turn.direction(normal).array()),
            Aov::Tangent => put(&surface.tangent.normalize().array()),
            Aov::Uv => put(&surface.uv[0].array()),
            Aov::Position => put(&surface.position.array()),
            Aov::Barycentric => put(&corners.weights),
            Aov::MipLevel => put(&[match g.look.albedo_slot() {
                Some(slot) => slot.map.level_of(l, slot.place(surface).1).max(l.f(0.0)),
                None => l.f(0.0),
            }]),
            Aov::TexelDensity => put(&[match g.look.albedo_slot() {
                Some(slot) => {
                    let f = slot.place(surface).1;
                    let size = slot.map.pyramid.mips()[0];
                    let area = (f.dudx * f.dvdy - f.dudy * f.dvdx).abs();
                    (area * (size.width as f32 * size.height as f32)).sqrt()
                }
                None => l.f(0.0),
            }]),
            Aov::Object | Aov::Material | Aov::Triangle => {
                for k in 0..L::WIDTH {
                    if let Some(at) = pixel(k) {
                        let (m, triangle) = number(lanes.ids[k]);
                        let slots = &g.instance.materials;
                        let id = match aov {
                            Aov::Object => g.instance.object as u32,
                            Aov::Material => slots[(m.slot as usize).min(slots.len() - 1)] as u32,
                            _ => triangle,
                        };
                        plane[at] = f32::from_bits(id);
                    }
                }
            }
        }
    }
}
