//! Tangent-space normal maps into object space and back, with the mesh that wears them: its triangles are drawn into the
//! map, and each texel gets the frame that a renderer would give it there.

use super::convert::{Converted, Kind, Normals, Options};
use super::texels::{Rows, Store, make};
use crate::error::{Error, Finding, Result};
use crate::image::Image;
use crate::map::normal::to_world;
use crate::math::lane::Level;
use crate::math::vec::{Vec2, Vec3, Vec4};
use crate::mesh::topology::{Weight, vertex_normals};
use crate::mesh::{Mesh, tangent};
use crate::raster::fragments::{CENTER, triangle};

/// The space of the normals that are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The mesh's own axes: red +X, green +Y, blue +Z.
    Object,
    /// MikkTSpace, or the tangents that the mesh brings.
    Tangent,
}

/// Texels around the islands that repeat their borders.
const MARGIN: usize = 16;

/// Changes the space of a normal map from tangent to object or from object to tangent. Texels that no triangle covers
/// get the nearest island's within 16 texels, and are flat (or zero in object space) beyond.
///
/// # Errors
/// `convert.mesh-uv` when no mesh has texture coordinates, and those of [`Normals::new`] and the job.
pub fn change_space(image: &Image, meshes: &[Mesh], to: Space, options: &Options) -> Result<Converted> {
    // Green is turned on the tangent side only.
    let from_y_down = options.from_y_down && to == Space::Object;
    let normals = Normals::new(image, options.channels, from_y_down, None)?;
    let (w, h) = normals.size();
    if meshes.iter().all(|m| m.uv[0].is_none()) {
        return Err(Error::input("convert.mesh-uv", "the mesh has no texture coordinates: a map has no place on it")
            .remedy("give the mesh that the map was made for"));
    }
    let _held = options.job.reserve((w * h * 24) as u64, "the frames of the map's texels")?;
    // As they are read, then as they are made.
    let mut texels = vec![Vec3::splat(0.0f32); w * h];
    let mut row: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; w.next_multiple_of(16)]);
    for y in 0..h {
        normals.row(options.level, y, &mut row);
        (0..w).for_each(|x| texels[y * w + x] = Vec3::new(row[0][x], row[1][x], row[2][x]));
    }
    let mut made: Vec<Option<Vec3>> = vec![None; w * h];
    let mut overlaps = 0u64;
    for mesh in meshes {
        options.job.check()?;
        let Some(uv) = &mesh.uv[0] else { continue };
        let angle;
        let normals = match &mesh.normals {
            Some(n) => n,
            None => {
                angle = vertex_normals(mesh, Weight::Angle);
                &angle
            }
        };
        let mikk;
        let tangents = match &mesh.tangents {
            Some(t) => t,
            None => {
                mikk = tangent::mikktspace(mesh, normals, uv);
                &mikk
            }
        };
        for t in 0..mesh.triangle_count() {
            let corners = mesh.triangle(t);
            let place = corners.map(|c| Vec2::from(uv.at(mesh, c)));
            // Triangles of other tiles are drawn on this one.
            let tile = (place[0] + place[1] + place[2]) / 3.0;
            let tile = Vec2::new(tile.x.floor(), tile.y.floor());
            let clip = place.map(|p| {
                let p = p - tile;
                Vec4::new(p.x * 2.0 - 1.0, 1.0 - p.y * 2.0, 0.5, 1.0)
            });
            let n = corners.map(|c| Vec3::from(normals.at(mesh, c)));
            let tangent = corners.map(|c| tangents.at(mesh, c));
            triangle(clip, w as u32, h as u32, &CENTER, |f| {
                let at = f.y as usize * w + f.x as usize;
                if made[at].is_some() {
                    overlaps += 1;
                    return;
                }
                let mix = |v: [Vec3; 3]| v[0] * f.weights[0] + v[1] * f.weights[1] + v[2] * f.weights[2];
                let normal = mix(n);
                let along = mix(tangent.map(|t| Vec3::new(t[0], t[1], t[2])));
                let sign = tangent[0][3];
                made[at] = Some(match to {
                    Space::Object => to_world(texels[at], along, sign, normal),
                    Space::Tangent => to_tangent(texels[at], along, sign, normal),
                });
            });
        }
    }
    drop(texels);
    let mut findings = Vec::new();
    if overlaps > 0 {
        findings.push(Finding::warning(
            "convert.overlap",
            format!("{overlaps} times a texel is covered by more than one triangle"),
            "the first triangle's frame counts; mirrored halves that share a map cannot have one in object space",
        ));
    }
    let covered = made.iter().filter(|m| m.is_some()).count();
    dilate(&mut made, w, h);
    let flat = if to == Space::Tangent { Vec3::new(0.0, 0.0, 1.0) } else { Vec3::splat(0.0) };
    let rows = Texels { made: &made, w, flat, y_down: options.y_down && to == Space::Tangent };
    let store = Store {
        width: w as u32,
        height: h as u32,
        channels: 3,
        depth: options.depth,
        dither: options.dither,
        seed: options.seed,
    };
    let (image, _) = make(&rows, &store, &options.job, options.level)?;
    let figures = vec![("covered", covered as f64 / (w * h) as f64)];
    Ok(Converted { image, from: Kind::Normal, findings, figures })
}

/// The inverse of [`to_world`]: the object-space normal `v` in the frame of `t` and `n`, as they are interpolated; flat
/// where these span no space.
fn to_tangent(v: Vec3, t: Vec3, sign: f32, n: Vec3) -> Vec3 {
    let b = n.cross(t) * sign;
    // The rows of the inverse of [t b n], times its determinant.
    let turned = Vec3::new(b.cross(n).dot(v), n.cross(t).dot(v), t.cross(b).dot(v));
    let turned = if t.dot(b.cross(n)) < 0.0 { turned * -1.0 } else { turned };
    let length = turned.length();
    if length > 1e-12 { turned / length } else { Vec3::new(0.0, 0.0, 1.0) }
}

/// Fills texels beside filled ones with the mean of these, ring by ring.
fn dilate(made: &mut [Option<Vec3>], w: usize, h: usize) {
    let mut edge: Vec<usize> = (0..w * h).filter(|&k| made[k].is_none()).collect();
    for _ in 0..MARGIN {
        let ring: Vec<(usize, Vec3)> = edge
            .iter()
            .filter_map(|&k| {
                let (x, y) = (k % w, k / w);
                let mut sum = Vec3::splat(0.0);
                let mut any = false;
                for (i, j) in (y.saturating_sub(1)..(y + 2).min(h))
                    .flat_map(|j| (x.saturating_sub(1)..(x + 2).min(w)).map(move |i| (i, j)))
                {
                    if let Some(n) = made[j * w + i] {
                        (sum, any) = (sum + n, true);
                    }
                }
                (any && sum.length() > 1e-6).then(|| (k, sum.normalize()))
            })
            .collect();
        if ring.is_empty() {
            return;
        }
        ring.iter().for_each(|&(k, n)| made[k] = Some(n));
        edge.retain(|&k| made[k].is_none());
    }
}

struct Texels<'a> {
    made: &'a [Option<Vec3>],
    w: usize,
    flat: Vec3,
    y_down: bool,
}

impl Rows for Texels<'_> {
    type Scratch = ();
    fn scratch(&self) {}
    fn fill(&self, _: Level, (): &mut (), y: usize, out: &mut [Vec<f32>]) {
        for (x, n) in self.made[y * self.w..(y + 1) * self.w].iter().enumerate() {
            let v = crate::map::normal::encode(n.unwrap_or(self.flat), self.y_down).array();
            (0..3).for_each(|c| out[c][x] = v[c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::texels::Depth;
    use super::*;
    use crate::image::{Encoding, Pixels};
    use crate::mesh::Attribute;

    /// A square that faces +X and wears the whole map.
    fn square() -> Mesh {
        Mesh {
            positions: vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 2.0, -1.0], [0.0, 2.0, 1.0]],
            corners: vec![0, 1, 2, 0, 2, 3],
            normals: Some(Attribute::per_position(vec![[1.0, 0.0, 0.0]; 4])),
            uv: [Some(Attribute::per_position(vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])), None],
            ..Default::default()
        }
    }

    fn map(v: impl Fn(u32, u32) -> Vec3) -> Image {
        let texels = (0..16).flat_map(|y| (0..16).map(move |x| (x, y)));
        let v = texels.flat_map(|(x, y)| crate::map::normal::encode(v(x, y), false).array()).collect();
        Image::new(16, 16, 3, Pixels::F32(v), Encoding::Linear).unwrap()
    }

    #[test]
    fn a_map_goes_to_object_space_and_comes_back() {
        let lean = |x: u32, y: u32| Vec3::new(x as f32 / 40.0, 0.3 - y as f32 / 30.0, 1.0).normalize();
        let options = |y_down| Options { depth: Depth::F32, y_down, from_y_down: false, ..Default::default() };
        let object = change_space(&map(lean), &[square()], Space::Object, &options(false)).unwrap();
        assert_eq!((object.figures[0], object.findings.len()), (("covered", 1.0), 0));
        for (x, y) in [(0, 0), (7, 9), (15, 15)] {
            let n = lean(x, y);
            // u grows to -Z, up the map is +Y, the normal is +X.
            let want = Vec3::new(n.z, n.y, -n.x);
            let got = [0, 1, 2].map(|c| object.image.value(x, y, c) * 2.0 - 1.0);
            assert!((Vec3::from(got) - want).length() < 1e-5, "{got:?} {want:?}");
        }
        let back = change_space(&object.image, &[square()], Space::Tangent, &options(true)).unwrap().image;
        for (x, y) in [(0, 0), (7, 9), (15, 15)] {
            let n = lean(x, y);
            let got = [0, 1, 2].map(|c| back.value(x, y, c) * 2.0 - 1.0);
            assert!((Vec3::from(got) - Vec3::new(n.x, -n.y, n.z)).length() < 1e-5);
        }
        let none = Mesh { uv: [None, None], ..square() };
        let error = change_space(&object.image, &[none], Space::Tangent, &options(true)).unwrap_err();
        assert_eq!(error.code, "convert.mesh-uv");
        // Twice the same: every texel is covered twice.
        let twice = change_space(&object.image, &[square(), square()], Space::Tangent, &options(true)).unwrap();
        assert_eq!(twice.findings[0].code, "convert.overlap");
    }
}
