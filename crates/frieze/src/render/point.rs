//! From a pixel and a triangle to the interpolated point that is shaded.

use crate::map::Footprint;
use crate::math::lane::{Lane, Num};
use crate::math::vec::{Vec2, Vec3, Vec4};
use crate::prepare::{Instance, View};
use crate::raster::Bins;
use crate::raster::geometry::{Draw, Record};
use crate::scene::Shading;
use crate::shade::{Lights, Lit, Look, Surface, light_vertex};

/// Triangles of one draw and one look, one per lane, and where in the picture they are asked.
pub(super) struct Lanes<'a, L: Lane> {
    pub ids: &'a [u32],
    pub px: L::F,
    pub py: L::F,
    pub active: L::M,
}

/// What all lanes have in common.
#[derive(Clone, Copy)]
pub(super) struct Group<'a> {
    pub view: &'a View,
    pub bins: &'a Bins,
    pub draw: &'a Draw<'a>,
    pub instance: &'a Instance,
    pub look: &'a Look,
}

/// The corners of the lanes' triangles.
pub(super) struct Corners<L: Lane> {
    /// Perspective-correct weights of the corners.
    pub weights: [L::F; 3],
    /// Their slopes along x and y, times the determinant.
    slopes: [[L::F; 3]; 2],
    /// Sums of the slopes, and 1 / the determinant.
    sums: [L::F; 2],
    inverse: L::F,
    /// Distance along the camera's axis.
    pub depth: L::F,
    /// Whether the front is seen.
    pub front: L::M,
    /// Indices of the corners' vertices in the cooked mesh, lane by lane.
    vertices: [[u32; 16]; 3],
    /// The same for positions.
    positions: [[u32; 16]; 3],
    mirrored: [u32; 3],
}

impl<L: Lane> Corners<L> {
    /// Weights from homogeneous coordinates relative to the pixel (Olano and Greer 1997): exact for triangles
    /// that are clipped, too, and free of the snapping of coverage.
    #[inline(always)]
    pub fn new(l: L, g: &Group<'_>, lanes: &Lanes<'_, L>) -> Self {
        let mut vertices = [[0u32; 16]; 3];
        let mut positions = [[0u32; 16]; 3];
        let mut mirrored = [0u32; 3];
        let mut h = [[0.0f32; 16]; 12];
        let mesh = g.draw.mesh;
        for (k, &id) in lanes.ids.iter().enumerate().take(L::WIDTH) {
            let r: &Record = &g.bins.records[(id >> 7) as usize];
            let m = &mesh.meshlets[r.meshlet as usize];
            let t = mesh.triangles[m.triangles as usize + (id & 127) as usize];
            let part = &g.bins.parts[r.part as usize].vertices;
            for c in 0..3 {
                let local = u32::from(t[c]);
                let v = part[(r.vertices + local) as usize];
                let (x, y, z) =
                    if r.homogeneous { (v[0], v[1], v[2]) } else { (v[0] * v[3], v[1] * v[3], v[2] * v[3]) };
                h[c][k] = x;
                h[3 + c][k] = y;
                h[6 + c][k] = v[3];
                h[9 + c][k] = z;
                vertices[c][k] = m.vertices + local;
                positions[c][k] = m.positions + local;
                mirrored[c] |= ((m.mirrored >> local & 1) as u32) << k;
            }
        }
        let w: [L::F; 3] = core::array::from_fn(|c| l.load(&h[6 + c]));
        let x: [L::F; 3] = core::array::from_fn(|c| l.load(&h[c]) - lanes.px * w[c]);
        let y: [L::F; 3] = core::array::from_fn(|c| l.load(&h[3 + c]) - lanes.py * w[c]);
        let next = [1, 2, 0];
        let last = [2, 0, 1];
        let c: [L::F; 3] = core::array::from_fn(|k| x[next[k]] * y[last[k]] - x[last[k]] * y[next[k]]);
        let along_x: [L::F; 3] = core::array::from_fn(|k| w[last[k]] * y[next[k]] - w[next[k]] * y[last[k]]);
        let along_y: [L::F; 3] = core::array::from_fn(|k| w[next[k]] * x[last[k]] - w[last[k]] * x[next[k]]);
        let determinant = c[0] + c[1] + c[2];
        let zero = l.f(0.0);
        let inverse = l.f(1.0).or_else(determinant.eq(zero), determinant).recip();
        let weights = c.map(|c| c * inverse);
        let depth = if g.view.lens.parallel {
            let z = weights[0] * l.load(&h[9]) + weights[1] * l.load(&h[10]) + weights[2] * l.load(&h[11]);
            let (near, far) = (g.view.lens.near as f32, g.view.lens.far as f32);
            z * (near - far) + far
        } else {
            weights[0] * w[0] + weights[1] * w[1] + weights[2] * w[2]
        };
        // y runs down: counter-clockwise is negative.
        let front = if g.instance.mirrored { determinant.gt(zero) } else { determinant.lt(zero) };
        Corners {
            weights,
            slopes: [along_x, along_y],
            sums: [along_x[0] + along_x[1] + along_x[2], along_y[0] + along_y[1] + along_y[2]],
            inverse,
            depth,
            front,
            vertices,
            positions,
            mirrored,
        }
    }

    #[inline(always)]
    fn mix(&self, v: [L::F; 3]) -> L::F {
        v[0] * self.weights[0] + v[1] * self.weights[1] + v[2] * self.weights[2]
    }

    /// Change of an interpolated value per pixel along x and y.
    #[inline(always)]
    fn slope(&self, v: [L::F; 3], mixed: L::F) -> [L::F; 2] {
        core::array::from_fn(|k| {
            let s = &self.slopes[k];
            (v[0] * s[0] + v[1] * s[1] + v[2] * s[2] - mixed * self.sums[k]) * self.inverse
        })
    }

    #[inline(always)]
    fn uv(&self, u: [L::F; 3], v: [L::F; 3]) -> (Vec2<L::F>, Footprint<L::F>) {
        let uv = Vec2::new(self.mix(u), self.mix(v));
        let ([dudx, dudy], [dvdx, dvdy]) = (self.slope(u, uv.x), self.slope(v, uv.y));
        (uv, Footprint { dudx, dvdx, dudy, dvdy })
    }

    /// World position and unit vector to the eye.
    #[inline(always)]
    pub fn place(&self, l: L, view: &View, px: L::F, py: L::F) -> (Vec3<L::F>, Vec3<L::F>) {
        let one = l.f(1.0);
        let [right, up, forward] = view.axes.map(|a| a.lift(one));
        let (a, b) = (view.lens.a.map(|v| v as f32), view.lens.b.map(|v| v as f32));
        let aside = right * (px * a[0] + b[0]) + up * (py * a[1] + b[1]);
        let eye = view.eye.lift(one);
        if view.lens.parallel {
            return (eye + aside + forward * self.depth, -forward);
        }
        let ray = aside + forward;
        (eye + ray * self.depth, -(ray.normalize()))
    }

    /// The point that is shaded. Without lights, light that belongs to vertices is left out (enough for alpha).
    #[inline(always)]
    pub fn surface(&self, l: L, g: &Group<'_>, lights: Option<&Lights<'_>>, lanes: &Lanes<'_, L>) -> Surface<L> {
        let one = l.f(1.0);
        let (position, to_eye) = self.place(l, g.view, lanes.px, lanes.py);
        let mesh = g.draw.mesh;
        let row = |c: usize| l.transpose_from(|k| &mesh.vertices[self.vertices[c][k] as usize][..]);
        let (a, b, c) = (row(0), row(1), row(2));
        let column = |k: usize| [a[k], b[k], c[k]];
        let vector = |k: usize| -> [Vec3<L::F>; 3] {
            [
                Vec3::new(a[k], a[k + 1], a[k + 2]),
                Vec3::new(b[k], b[k + 1], b[k + 2]),
                Vec3::new(c[k], c[k + 1], c[k + 2]),
            ]
        };
        let blend = |v: [Vec3<L::F>; 3]| v[0] * self.weights[0] + v[1] * self.weights[1] + v[2] * self.weights[2];
        // Vertices have unit vectors in the world, too: transforms that bend angles are undone at each corner.
        let turned = |v: [Vec3<L::F>; 3], m: &crate::math::vec::Mat4| {
            if g.instance.similarity { m.direction(blend(v)) } else { blend(v.map(|v| m.direction(v).normalize())) }
        };
        let facing = (-one).or_else(!self.front, one);
        let normal = turned(vector(0), &g.instance.normals) * facing;
        let zero = l.f(0.0);
        let (tangent, sign) = if g.look.needs_tangent() {
            let flip = if g.instance.mirrored { one } else { -one };
            let sign = flip.or_else(l.mask(self.mirrored[0]), -flip);
            (turned(vector(3), &g.instance.tangents) * facing, sign * facing)
        } else {
            (Vec3::splat(zero), zero)
        };
        let none = (Vec2::splat(zero), Footprint { dudx: zero, dvdx: zero, dudy: zero, dvdy: zero });
        let first = if g.look.needs_uv(0) { self.uv(column(6), column(7)) } else { none };
        let second = if g.look.needs_uv(1) && !mesh.uv1.is_empty() {
            let load = |c: usize, k: usize| l.f_from(|i| mesh.uv1[self.vertices[c][i] as usize][k]);
            self.uv([load(0, 0), load(1, 0), load(2, 0)], [load(0, 1), load(1, 1), load(2, 1)])
        } else if g.look.needs_uv(1) {
            self.uv(column(6), column(7))
        } else {
            none
        };
        let color = if mesh.colors.is_empty() {
            Vec4::splat(one)
        } else {
            let load = |k: usize| {
                let at = |c: usize| l.f_from(|i| mesh.colors[self.vertices[c][i] as usize][k]);
                self.mix([at(0), at(1), at(2)])
            };
            Vec4::new(load(0), load(1), load(2), load(3))
        };
        let lit = match lights {
            Some(lights) if g.look.needs_lit() => Some(self.light_early(l, g, lights, vector(0), facing, lanes.active)),
            _ => None,
        };
        Surface {
            active: lanes.active,
            position,
            view: to_eye,
            normal,
            tangent,
            sign,
            uv: [first.0, second.0],
            footprint: [first.1, second.1],
            color,
            lit,
        }
    }

    /// Light at the corners, interpolated (Gouraud), or at the centroid (flat).
    #[inline(always)]
    fn light_early(
        &self,
        l: L,
        g: &Group<'_>,
        lights: &Lights<'_>,
        normals: [Vec3<L::F>; 3],
        facing: L::F,
        active: L::M,
    ) -> Lit<L> {
        let one = l.f(1.0);
        let mesh = g.draw.mesh;
        let corner = |c: usize| {
            let at = |stream: &[f32]| l.f_from(|k| stream[self.positions[c][k] as usize]);
            g.instance.transform.point(Vec3::new(at(&mesh.x), at(&mesh.y), at(&mesh.z)))
        };
        let p = [corner(0), corner(1), corner(2)];
        let towards = |p: Vec3<L::F>| {
            if g.view.lens.parallel { (-g.view.axes[2]).lift(one) } else { (g.view.eye.lift(one) - p).normalize() }
        };
        if g.look.shading == Shading::Flat {
            let flip = if g.instance.mirrored { -facing } else { facing };
            let n = (p[1] - p[0]).cross(p[2] - p[0]) * flip;
            let middle = (p[0] + p[1] + p[2]) / l.f(3.0);
            return light_vertex(l, g.look, lights, middle, n, towards(middle), active);
        }
        let mut sum = Lit::dark(l);
        for c in 0..3 {
            let n = g.instance.normals.direction(normals[c]) * facing;
            let lit = l.enter(
                #[inline(always)]
                || light_vertex(l, g.look, lights, p[c], n, towards(p[c]), active),
            );
            sum.ambient = sum.ambient + lit.ambient * self.weights[c];
            sum.diffuse = sum.diffuse + lit.diffuse * self.weights[c];
            sum.specular = sum.specular + lit.specular * self.weights[c];
        }
        sum
    }
}
