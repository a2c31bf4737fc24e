//! The slope of a height field, by several kernels (rows 70, 71, 75, 76).
//!
//! Heights are measured in texels, so that a slope has no unit: `strength` says how many texels high the full range
//! is. Along x the slope runs to the right, along y *down* the picture.

use super::texels::Field;
use crate::math::lane::{self, Lane, Level, Num};
use crate::math::vec::Vec3;

/// How a slope is found at a texel's centre. All are exact for planes. For a wave of `k` radians per texel the share of
/// the slope that is left is given, along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// Sobel's 3x3 mean of central differences: `sin k / k`, and a wave along the other axis is damped by
    /// `(1 + cos k) / 2`. Least noise.
    Sobel,
    /// `(h[+1] - h[-1]) / 2`: `sin k / k`.
    Central,
    /// The exact gradient of the surface that `filter = "bicubic"` draws (Catmull-Rom). At texel centres, where this
    /// surface passes through the heights, its gradient *is* the central difference; the two kernels give the same bits.
    Bicubic,
    /// `h[+1] - h[0]`, as the documents write it (rows 70 and 71): the slope half a texel aside.
    Forward,
    /// The exact gradient of the bicubic B-spline surface through the heights (its prefilter cut off after 12 texels, an
    /// error of 2e-7): off by `k^4 / 180`, the best where heights are smooth.
    Spline,
}

impl Kernel {
    /// The words of the command line.
    pub const NAMES: [(&'static str, Kernel); 5] = [
        ("sobel", Kernel::Sobel),
        ("central", Kernel::Central),
        ("bicubic", Kernel::Bicubic),
        ("forward", Kernel::Forward),
        ("spline", Kernel::Spline),
    ];
    /// How many texels away it looks.
    fn reach(self) -> usize {
        if self == Kernel::Spline { SPLINE } else { 1 }
    }
}

/// What lies beyond the edge of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edges {
    /// The other side: the map is a tile.
    Wrap,
    /// The straight line through the last two texels, so that differences become one-sided.
    Extend,
}

/// Taps of the spline's gradient on each side.
const SPLINE: usize = 12;

/// The spline's gradient as a stencil: `sum s[k] (h[k] - h[-k])`, k from 1. The slope `d` of the cubic spline through `h`
/// solves `d[-1] + 4 d[0] + d[1] = 3 (h[1] - h[-1])`; the inverse of the left side is `z^|k| / (4 + 2 z)` with
/// `z = sqrt(3) - 2`. The last tap takes what is cut off, so that planes stay exact.
fn spline() -> [f32; SPLINE] {
    let z = 3f64.sqrt() - 2.0;
    let mut power = [1.0f64; SPLINE + 2];
    for k in 1..power.len() {
        power[k] = power[k - 1] * z;
    }
    let mut s = [0.0f64; SPLINE];
    for k in 1..=SPLINE {
        // The convolution of 3 (h[1] - h[-1]) with the inverse.
        s[k - 1] = 3.0 * (power[k - 1] - power[k + 1]) / (4.0 + 2.0 * z);
    }
    // 2 sum k s[k] = 1 for a plane.
    let have: f64 = s.iter().enumerate().map(|(k, s)| 2.0 * (k + 1) as f64 * s).sum();
    s[SPLINE - 1] += (1.0 - have) / (2.0 * SPLINE as f64);
    s.map(|v| v as f32)
}

/// A height field and how its slope is found.
#[derive(Clone, Copy, Debug)]
pub struct Slopes<'a> {
    /// The heights.
    pub field: Field<'a>,
    /// How.
    pub kernel: Kernel,
    /// At the edges.
    pub edges: Edges,
    /// Texels that the full range (1 for floats) is high. Negative turns hills into valleys.
    pub strength: f32,
}

/// The rows around the one that is asked.
pub struct Window {
    /// From `-reach` to `reach`, each with as many texels before and after it, and then some.
    rows: Vec<Vec<f32>>,
    /// The row in the middle; `None` before the first.
    at: Option<usize>,
    other: Vec<f32>,
    stencil: [f32; SPLINE],
}

impl<'a> Slopes<'a> {
    fn size(&self) -> (usize, usize) {
        let image = self.field.image();
        (image.width() as usize, image.height() as usize)
    }
    /// A window that has read nothing yet.
    pub fn window(&self) -> Window {
        let (r, w) = (self.kernel.reach(), self.size().0);
        let row = vec![0.0; w.next_multiple_of(16) + 2 * r];
        Window { rows: vec![row.clone(); 2 * r + 1], at: None, other: row, stencil: spline() }
    }
    /// Row `y`, which may lie beyond the edges by the kernel's reach.
    #[inline(always)]
    fn read(&self, y: isize, out: &mut [f32], other: &mut [f32]) {
        let (w, h) = self.size();
        let r = self.kernel.reach();
        let last = h as isize - 1;
        match self.edges {
            _ if (0..=last).contains(&y) => self.line(y as usize, out),
            Edges::Wrap => self.line(y.rem_euclid(h as isize) as usize, out),
            Edges::Extend if h == 1 => self.line(0, out),
            Edges::Extend => {
                // first + t (first - second), t rows beyond.
                let (first, second, t) = if y < 0 { (0, 1, -y) } else { (last, last - 1, y - last) };
                self.line(first as usize, out);
                self.line(second as usize, other);
                out.iter_mut().zip(other.iter()).for_each(|(o, s)| *o += (*o - *s) * t as f32);
                return;
            }
        }
        debug_assert!(out.len() >= w + 2 * r);
    }
    /// A row of the map with its ends.
    #[inline(always)]
    fn line(&self, y: usize, out: &mut [f32]) {
        let (w, r) = (self.size().0, self.kernel.reach());
        self.field.codes(y, &mut out[r..]);
        for k in 1..=r {
            let (before, after) = match self.edges {
                Edges::Wrap => {
                    let at = |i: isize| out[r + i.rem_euclid(w as isize) as usize];
                    (at(-(k as isize)), at((w - 1 + k) as isize))
                }
                Edges::Extend if w == 1 => (out[r], out[r]),
                Edges::Extend => {
                    let (a, b, c, d) = (out[r], out[r + 1], out[r + w - 1], out[r + w - 2]);
                    (a + (a - b) * k as f32, c + (c - d) * k as f32)
                }
            };
            out[r - k] = before;
            out[r + w - 1 + k] = after;
        }
    }
    /// The slopes along x and *down* y of row `y`, into slices at least as long as the map is wide, rounded up to 16.
    /// Rows that follow one another are read once.
    pub fn row(&self, level: Level, window: &mut Window, y: usize, gx: &mut [f32], gy: &mut [f32]) {
        level.run(SlopeRow { slopes: self, window, y, gx, gy });
    }
}

struct SlopeRow<'a> {
    slopes: &'a Slopes<'a>,
    window: &'a mut Window,
    y: usize,
    gx: &'a mut [f32],
    gy: &'a mut [f32],
}

impl lane::Kernel for SlopeRow<'_> {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let SlopeRow { slopes, window, y, gx: out_x, gy: out_y } = self;
        let r = slopes.kernel.reach();
        let count = 2 * r + 1;
        let follows = y > 0 && window.at == Some(y - 1);
        if follows {
            window.rows.rotate_left(1);
        }
        for k in if follows { count - 1..count } else { 0..count } {
            slopes.read(y as isize + k as isize - r as isize, &mut window.rows[k], &mut window.other);
        }
        window.at = Some(y);
        let scale = slopes.strength * slopes.field.unit();
        let w = slopes.size().0;
        let rows = &window.rows;
        let scale = match slopes.kernel {
            Kernel::Sobel => scale / 8.0,
            Kernel::Central | Kernel::Bicubic => scale / 2.0,
            Kernel::Forward | Kernel::Spline => scale,
        };
        match slopes.kernel {
            Kernel::Sobel => {
                let [a, b, c] = [&rows[0][..], &rows[1][..], &rows[2][..]];
                for x in (0..w).step_by(L::WIDTH) {
                    let [a0, a1, a2] = [l.load(&a[x..]), l.load(&a[x + 1..]), l.load(&a[x + 2..])];
                    let [b0, b2] = [l.load(&b[x..]), l.load(&b[x + 2..])];
                    let [c0, c1, c2] = [l.load(&c[x..]), l.load(&c[x + 1..]), l.load(&c[x + 2..])];
                    let gx = (a2 - a0) + (b2 - b0) * 2.0 + (c2 - c0);
                    let gy = (c0 - a0) + (c1 - a1) * 2.0 + (c2 - a2);
                    put(x, gx * scale, gy * scale, out_x, out_y);
                }
            }
            Kernel::Central | Kernel::Bicubic => {
                for x in (0..w).step_by(L::WIDTH) {
                    let gx = l.load(&rows[1][x + 2..]) - l.load(&rows[1][x..]);
                    let gy = l.load(&rows[2][x + 1..]) - l.load(&rows[0][x + 1..]);
                    put(x, gx * scale, gy * scale, out_x, out_y);
                }
            }
            Kernel::Forward => {
                for x in (0..w).step_by(L::WIDTH) {
                    let here = l.load(&rows[1][x + 1..]);
                    let gx = l.load(&rows[1][x + 2..]) - here;
                    let gy = l.load(&rows[2][x + 1..]) - here;
                    put(x, gx * scale, gy * scale, out_x, out_y);
                }
            }
            Kernel::Spline => {
                for x in (0..w).step_by(L::WIDTH) {
                    let (mut gx, mut gy) = (l.f(0.0), l.f(0.0));
                    // The small taps first.
                    for k in (1..=SPLINE).rev() {
                        let s = window.stencil[k - 1];
                        gx = gx + (l.load(&rows[r][x + r + k..]) - l.load(&rows[r][x + r - k..])) * s;
                        gy = gy + (l.load(&rows[r + k][x + r..]) - l.load(&rows[r - k][x + r..])) * s;
                    }
                    put(x, gx * scale, gy * scale, out_x, out_y);
                }
            }
        }
    }
}

/// Clamped, so that squares stay finite.
#[inline(always)]
fn put<N: Num>(x: usize, gx: N, gy: N, out_x: &mut [f32], out_y: &mut [f32]) {
    gx.clamp(-1e15, 1e15).store(&mut out_x[x..]);
    gy.clamp(-1e15, 1e15).store(&mut out_y[x..]);
}

/// The unit normal of a height field with these slopes along x and *down* y, in the frame of a map whose green points
/// up: `(-dp/du, -dp/dv, 1)` of unit length (row 71; v up).
#[inline(always)]
pub fn normal<N: Num>(along_x: N, down_y: N) -> Vec3<N> {
    let one = along_x.lift(1.0);
    let inverse = one / (along_x * along_x + down_y * down_y + 1.0).sqrt();
    Vec3::new(-along_x * inverse, down_y * inverse, inverse)
}
