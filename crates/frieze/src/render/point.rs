//! From a pixel and a triangle to the interpolated point that is shaded.

use crate::map::Footprint;
use crate::math::lane::{Int, Lane, Mask, Num, three};
use crate::math::vec::{Mat4, Vec2, Vec3, Vec4};
use crate::mesh::meshlet::Meshlets;
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
    /// Planes are asked for: they show what no map of the look needs, too.
    pub planes: bool,
}

/// The corners of the lanes' triangles.
pub(super) struct Corners<'t, L: Lane> {
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
    /// The distinct triangles, and which of them each lane has.
    triangles: &'t [Triangle; 16],
    which: [i32; 16],
    count: usize,
    /// The lanes of the first ones.
    masks: [L::M; FEW],
    /// At the corners: w, and reversed depth times w.
    w: [L::F; 3],
    deep: [L::F; 3],
    /// -1 where the bitangent is mirrored.
    sign: L::F,
}

/// As many distinct triangles are put into lanes one by one; with more it pays to transpose.
const FEW: usize = 5;

/// What is fetched once per triangle, in rows that lanes are transposed from.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    /// x, y, w of the corners (the last w is in `more`), homogeneous picture coordinates.
    corners: [f32; 8],
    /// Last w, depths of the corners times w, tangent sign.
    more: [f32; 8],
    /// The corners' vertices in the cooked mesh.
    vertices: [u32; 3],
    /// Their positions.
    positions: [u32; 3],
}

impl Triangle {
    pub const NONE: Triangle = Triangle { corners: [0.0; 8], more: [0.0; 8], vertices: [0; 3], positions: [0; 3] };

    #[inline(always)]
    fn new(g: &Group<'_>, id: u32) -> Self {
        let r: &Record = &g.bins.records[(id >> 7) as usize];
        let m = &g.draw.mesh.meshlets[r.meshlet as usize];
        let t = g.draw.mesh.triangles[m.triangles as usize + (id & 127) as usize];
        let part = &g.bins.parts[r.part as usize].vertices;
        let (a, b, c) = (u32::from(t[0]), u32::from(t[1]), u32::from(t[2]));
        let corner = |local: u32| {
            let v = part[(r.vertices + local) as usize];
            if r.homogeneous { v } else { [v[0] * v[3], v[1] * v[3], v[2] * v[3], v[3]] }
        };
        let (p, q, s) = (corner(a), corner(b), corner(c));
        let sign = if m.mirrored >> a & 1 == 1 { -1.0 } else { 1.0 };
        Triangle {
            corners: [p[0], p[1], p[3], q[0], q[1], q[3], s[0], s[1]],
            more: [s[3], p[2], q[2], s[2], sign, 0.0, 0.0, 0.0],
            vertices: [m.vertices + a, m.vertices + b, m.vertices + c],
            positions: [m.positions + a, m.positions + b, m.positions + c],
        }
    }
}

impl<'t, L: Lane> Corners<'t, L> {
    /// `triangles` is room for what is fetched, whatever it holds.
    ///
    /// Weights from homogeneous coordinates relative to the pixel (Olano and Greer 1997): exact for triangles
    /// that are clipped, too, and free of the snapping of coverage.
    #[inline(always)]
    pub fn new(l: L, g: &Group<'_>, lanes: &Lanes<'_, L>, triangles: &'t mut [Triangle; 16]) -> Self {
        let ids = l.load_i(bytemuck::cast_slice(lanes.ids));
        let everywhere = ids.eq(ids);
        let (mut masks, mut number, mut count) = ([everywhere; FEW], l.i(0), 0);
        let mut left = u32::MAX >> (32 - L::WIDTH as u32);
        while left != 0 {
            let id = lanes.ids[left.trailing_zeros() as usize];
            triangles[count & 15] = Triangle::new(g, id);
            let same = ids.eq(l.i(id as i32));
            number = l.i(count as i32).or_else(same, number);
            if count < FEW {
                masks[count] = same;
            }
            left &= !same.bits();
            count += 1;
        }
        let mut which = [0i32; 16];
        number.store(&mut which);
        let c = rows(
            l,
            &which,
            &masks,
            count,
            #[inline(always)]
            |t| &triangles[t & 15].corners,
        );
        let d = rows(
            l,
            &which,
            &masks,
            count,
            #[inline(always)]
            |t| &triangles[t & 15].more,
        );
        let w = [c[2], c[5], d[0]];
        let x = [c[0] - lanes.px * w[0], c[3] - lanes.px * w[1], c[6] - lanes.px * w[2]];
        let y = [c[1] - lanes.py * w[0], c[4] - lanes.py * w[1], c[7] - lanes.py * w[2]];
        let next = [1, 2, 0];
        let last = [2, 0, 1];
        let c: [L::F; 3] = three(
            #[inline(always)]
            |k| x[next[k]] * y[last[k]] - x[last[k]] * y[next[k]],
        );
        let along_x: [L::F; 3] = three(
            #[inline(always)]
            |k| w[last[k]] * y[next[k]] - w[next[k]] * y[last[k]],
        );
        let along_y: [L::F; 3] = three(
            #[inline(always)]
            |k| w[next[k]] * x[last[k]] - w[last[k]] * x[next[k]],
        );
        let determinant = c[0] + c[1] + c[2];
        let zero = l.f(0.0);
        let inverse = l.f(1.0).or_else(determinant.eq(zero), determinant).recip();
        let weights = [c[0] * inverse, c[1] * inverse, c[2] * inverse];
        let depth = if g.view.lens.parallel {
            let z = weights[0] * d[1] + weights[1] * d[2] + weights[2] * d[3];
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
            w,
            deep: [d[1], d[2], d[3]],
            triangles,
            which,
            count,
            masks,
            sign: d[4],
        }
    }

    #[inline(always)]
    fn mix(&self, v: [L::F; 3]) -> L::F {
        v[0] * self.weights[0] + v[1] * self.weights[1] + v[2] * self.weights[2]
    }

    /// Change of an interpolated value per pixel along x and y.
    #[inline(always)]
    fn slope(&self, v: [L::F; 3], mixed: L::F) -> [L::F; 2] {
        [self.slope_along(0, v, mixed), self.slope_along(1, v, mixed)]
    }

    #[inline(always)]
    fn slope_along(&self, k: usize, v: [L::F; 3], mixed: L::F) -> L::F {
        let s = &self.slopes[k];
        (v[0] * s[0] + v[1] * s[1] + v[2] * s[2] - mixed * self.sums[k]) * self.inverse
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
        let [right, up, forward] = [view.axes[0].lift(one), view.axes[1].lift(one), view.axes[2].lift(one)];
        let (a, b) = (view.lens.a, view.lens.b);
        let (a, b) = ([a[0] as f32, a[1] as f32], [b[0] as f32, b[1] as f32]);
        let aside = right * (px * a[0] + b[0]) + up * (py * a[1] + b[1]);
        let eye = view.eye.lift(one);
        if view.lens.parallel {
            return (eye + aside + forward * self.depth, -forward);
        }
        let ray = aside + forward;
        (eye + ray * self.depth, -(ray.normalize()))
    }

    /// The unit normal of the triangle's plane, towards the eye.
    #[inline(always)]
    fn plane(&self, l: L, view: &View, px: L::F, py: L::F) -> Vec3<L::F> {
        let one = l.f(1.0);
        let (a, b) = (view.lens.a, view.lens.b);
        let (a, b) = ([a[0] as f32, a[1] as f32], [b[0] as f32, b[1] as f32]);
        // The cross product of the point's changes along x and y, over its depth. With d the depth and (rx, ry, 1) the
        // ray, they are (a0 d + rx dx, ry dx, dx) and (rx dy, a1 d + ry dy, dy).
        let (along, n) = if view.lens.parallel {
            let z = self.mix(self.deep);
            let (near, far) = (view.lens.near as f32, view.lens.far as f32);
            let [dx, dy] = self.slope(self.deep, z);
            let (dx, dy) = (dx * (near - far), dy * (near - far));
            (l.f(a[0] * a[1]), [dx, dy])
        } else {
            let [dx, dy] = self.slope(self.w, self.depth);
            let (rx, ry) = (px * a[0] + b[0], py * a[1] + b[1]);
            (self.depth * (a[0] * a[1]) + ry * dy * a[0] + rx * dx * a[1], [dx, dy])
        };
        let [right, up, forward] = [view.axes[0].lift(one), view.axes[1].lift(one), view.axes[2].lift(one)];
        (right * (n[0] * -a[1]) + up * (n[1] * -a[0]) + forward * along).normalize()
    }

    #[inline(always)]
    fn triangle(&self, k: usize) -> &Triangle {
        &self.triangles[(self.which[k] & 15) as usize]
    }
    /// The eight numbers of corner `c`.
    #[inline(always)]
    fn row(&self, l: L, mesh: &Meshlets, c: usize) -> [L::F; 8] {
        rows(
            l,
            &self.which,
            &self.masks,
            self.count,
            #[inline(always)]
            |t| &mesh.vertices[self.triangles[t & 15].vertices[c] as usize],
        )
    }
    /// Number `k` of corner `c` in an optional stream.
    #[inline(always)]
    fn pick<const N: usize>(&self, l: L, stream: &[[f32; N]], c: usize, k: usize) -> L::F {
        l.f_from(
            #[inline(always)]
            |i| stream[self.triangle(i).vertices[c] as usize][k],
        )
    }
    #[inline(always)]
    fn mixed<const N: usize>(&self, l: L, stream: &[[f32; N]], k: usize) -> L::F {
        self.mix([self.pick(l, stream, 0, k), self.pick(l, stream, 1, k), self.pick(l, stream, 2, k)])
    }
    #[inline(always)]
    fn blend(&self, v: [Vec3<L::F>; 3]) -> Vec3<L::F> {
        v[0] * self.weights[0] + v[1] * self.weights[1] + v[2] * self.weights[2]
    }
    /// Vertices have unit vectors in the world, too: transforms that bend angles are undone at each corner.
    #[inline(always)]
    fn turned(&self, g: &Group<'_>, v: [Vec3<L::F>; 3], m: &Mat4) -> Vec3<L::F> {
        if g.instance.similarity {
            m.direction(self.blend(v))
        } else {
            let [a, b, c] = v;
            self.blend([m.direction(a).normalize(), m.direction(b).normalize(), m.direction(c).normalize()])
        }
    }

    /// The point that is shaded. Without lights, light that belongs to vertices is left out (enough for alpha).
    #[inline(always)]
    pub fn surface(&self, l: L, g: &Group<'_>, lights: Option<&Lights<'_>>, lanes: &Lanes<'_, L>) -> Surface<L> {
        let one = l.f(1.0);
        let (position, to_eye) = self.place(l, g.view, lanes.px, lanes.py);
        let mesh = g.draw.mesh;
        let (a, b, c) = (self.row(l, mesh, 0), self.row(l, mesh, 1), self.row(l, mesh, 2));
        let facing = (-one).or_else(!self.front, one);
        let normal = self.turned(g, vectors(&a, &b, &c, 0), &g.instance.normals) * facing;
        let zero = l.f(0.0);
        let (tangent, sign) = if g.planes || g.look.needs_tangent() {
            let sign = if g.instance.mirrored { -self.sign } else { self.sign };
            (self.turned(g, vectors(&a, &b, &c, 3), &g.instance.tangents) * facing, sign * facing)
        } else {
            (Vec3::splat(zero), facing)
        };
        // Object- and world-space maps ask for the side only, whatever planes want.
        let sign = if g.look.needs_tangent() { sign } else { facing };
        let none = (Vec2::splat(zero), Footprint { dudx: zero, dvdx: zero, dudy: zero, dvdy: zero });
        let first = if g.planes || g.look.needs_uv(0) { self.uv([a[6], b[6], c[6]], [a[7], b[7], c[7]]) } else { none };
        let second = if g.look.needs_uv(1) && !mesh.uv1.is_empty() {
            let t = &mesh.uv1;
            self.uv(
                [self.pick(l, t, 0, 0), self.pick(l, t, 1, 0), self.pick(l, t, 2, 0)],
                [self.pick(l, t, 0, 1), self.pick(l, t, 1, 1), self.pick(l, t, 2, 1)],
            )
        } else if g.look.needs_uv(1) {
            self.uv([a[6], b[6], c[6]], [a[7], b[7], c[7]])
        } else {
            none
        };
        let color = if mesh.colors.is_empty() {
            Vec4::splat(one)
        } else {
            let t = &mesh.colors;
            Vec4::new(self.mixed(l, t, 0), self.mixed(l, t, 1), self.mixed(l, t, 2), self.mixed(l, t, 3))
        };
        let lit = match lights {
            Some(lights) if g.look.needs_lit() => {
                Some(self.light_early(l, g, lights, vectors(&a, &b, &c, 0), facing, lanes.active))
            }
            _ => None,
        };
        let plane = match lights {
            Some(lights) if lights.any_shadow() => self.plane(l, g.view, lanes.px, lanes.py),
            _ => normal,
        };
        Surface {
            active: lanes.active,
            position,
            view: to_eye,
            normal,
            plane,
            tangent,
            sign,
            object: [0, 1, 2].map(|c| g.instance.normals.column(c).xyz()),
            uv: [first.0, second.0],
            footprint: [first.1, second.1],
            color,
            lit,
        }
    }

    /// World position of corner `c`.
    #[inline(always)]
    fn corner(&self, l: L, g: &Group<'_>, c: usize) -> Vec3<L::F> {
        let mesh = g.draw.mesh;
        g.instance.transform.point(Vec3::new(
            self.coordinate(l, &mesh.x, c),
            self.coordinate(l, &mesh.y, c),
            self.coordinate(l, &mesh.z, c),
        ))
    }
    #[inline(always)]
    fn coordinate(&self, l: L, stream: &[f32], c: usize) -> L::F {
        l.f_from(
            #[inline(always)]
            |k| stream[self.triangle(k).positions[c] as usize],
        )
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
        let p = [self.corner(l, g, 0), self.corner(l, g, 1), self.corner(l, g, 2)];
        if g.look.shading == Shading::Flat {
            let flip = if g.instance.mirrored { -facing } else { facing };
            let n = (p[1] - p[0]).cross(p[2] - p[0]) * flip;
            let middle = (p[0] + p[1] + p[2]) / l.f(3.0);
            return light_vertex(l, g.look, lights, middle, n, towards(l, g.view, middle), active);
        }
        let mut sum = Lit::dark(l);
        for c in 0..3 {
            let n = g.instance.normals.direction(normals[c]) * facing;
            let lit = l.enter(
                #[inline(always)]
                || light_vertex(l, g.look, lights, p[c], n, towards(l, g.view, p[c]), active),
            );
            sum.ambient = sum.ambient + lit.ambient * self.weights[c];
            sum.diffuse = sum.diffuse + lit.diffuse * self.weights[c];
            sum.specular = sum.specular + lit.specular * self.weights[c];
        }
        sum
    }
}

/// Numbers `k` to `k + 2` of three corners.
#[inline(always)]
fn vectors<N: Copy>(a: &[N; 8], b: &[N; 8], c: &[N; 8], k: usize) -> [Vec3<N>; 3] {
    [Vec3::new(a[k], a[k + 1], a[k + 2]), Vec3::new(b[k], b[k + 1], b[k + 2]), Vec3::new(c[k], c[k + 1], c[k + 2])]
}

/// The unit vector from a point to the eye.
#[inline(always)]
fn towards<L: Lane>(l: L, view: &View, p: Vec3<L::F>) -> Vec3<L::F> {
    let one = l.f(1.0);
    if view.lens.parallel { (-view.axes[2]).lift(one) } else { (view.eye.lift(one) - p).normalize() }
}

/// Row `which[k]` of eight numbers in lane `k`, where row `t` of the first [`FEW`] belongs to the lanes `masks[t]`.
#[inline(always)]
fn rows<'a, L: Lane>(
    l: L,
    which: &[i32; 16],
    masks: &[L::M; FEW],
    count: usize,
    row: impl Fn(usize) -> &'a [f32; 8],
) -> [L::F; 8] {
    if count > FEW {
        return l.transpose_from(
            #[inline(always)]
            |k| &row(which[k] as usize)[..],
        );
    }
    let mut out = splat8(l, row(0));
    for t in 1..count {
        let (new, m) = (splat8(l, row(t)), masks[t]);
        for c in 0..8 {
            out[c] = new[c].or_else(m, out[c]);
        }
    }
    out
}

/// Eight numbers in all lanes.
#[inline(always)]
fn splat8<L: Lane>(l: L, v: &[f32; 8]) -> [L::F; 8] {
    [l.f(v[0]), l.f(v[1]), l.f(v[2]), l.f(v[3]), l.f(v[4]), l.f(v[5]), l.f(v[6]), l.f(v[7])]
}
