//! The Fourier transform of many sequences side by side, one per lane, in one fixed order of operations: the same bits at
//! every level and thread count. Lengths whose factors are 2, 3 and 5 go by mixed radices in Stockham's order, others by
//! Bluestein's convolution.

use crate::math::exact::sin_cos_f64;
use crate::math::lane::{Lane, Num};
use std::f64::consts::TAU;

/// How a length is transformed.
#[derive(Clone, Debug)]
pub struct Plan {
    n: usize,
    /// Of the transform that is done: `n`, or what Bluestein's convolution takes.
    size: usize,
    stages: Vec<Stage>,
    bluestein: Option<Bluestein>,
}

#[derive(Clone, Debug)]
struct Stage {
    radix: usize,
    /// Length of the transforms that are left after this stage.
    rest: usize,
    /// Distance of the elements of one transform.
    stride: usize,
    /// `exp(-i TAU q k / (radix * rest))` for q, then k from 1.
    twiddles: Vec<[f32; 2]>,
}

#[derive(Clone, Debug)]
struct Bluestein {
    /// `exp(-i PI k^2 / n)`
    chirp: Vec<[f32; 2]>,
    /// The transform of its conjugate, with the padded size divided out.
    spectrum: Vec<[f32; 2]>,
}

/// `exp(-i TAU k / n)`, k taken into the circle first.
fn root(k: usize, n: usize) -> [f64; 2] {
    let (s, c) = sin_cos_f64((k % n) as f64 / n as f64 * TAU);
    [c, -s]
}

fn single(v: [f64; 2]) -> [f32; 2] {
    v.map(|v| v as f32)
}

impl Plan {
    /// For sequences of `n` numbers, at least 1.
    pub fn new(n: usize) -> Plan {
        let mut rest = n;
        let mut radices = Vec::new();
        for radix in [4, 2, 3, 5] {
            while rest.is_multiple_of(radix) {
                radices.push(radix);
                rest /= radix;
            }
        }
        if rest == 1 {
            return Plan { n, size: n, stages: stages(&radices, n), bluestein: None };
        }
        let size = (2 * n - 1).next_power_of_two();
        let chirp: Vec<[f64; 2]> =
            (0..n).map(|k| root((k as u128 * k as u128 % (2 * n) as u128) as usize, 2 * n)).collect();
        // In f64, by the recursion that every textbook has.
        let mut spectrum = vec![[0.0; 2]; size];
        for (k, [re, im]) in chirp.iter().enumerate() {
            spectrum[k] = [*re, -im];
            spectrum[(size - k) % size] = [*re, -im];
        }
        let spectrum = recursive(&spectrum).iter().map(|v| single(v.map(|v| v / size as f64))).collect();
        let chirp = chirp.into_iter().map(single).collect();
        let mut plan = Plan::new(size);
        plan.n = n;
        plan.bluestein = Some(Bluestein { chirp, spectrum });
        plan
    }
    /// Numbers that each of the two buffers of [`Plan::run`] holds for `width` lanes.
    pub fn buffer(&self, width: usize) -> usize {
        2 * self.size * width
    }
    /// Transforms the `L::WIDTH` complex sequences of `x` in place: element `i` has its real parts at `2 i WIDTH` and its
    /// imaginary parts behind them. `X[k] = sum x[i] exp(-i TAU i k / n)`.
    #[inline(always)]
    pub fn run<L: Lane>(&self, l: L, x: &mut Vec<f32>, other: &mut Vec<f32>) {
        let passes = if self.bluestein.is_some() { 2 } else { 1 };
        for pass in 0..passes {
            if let Some(b) = &self.bluestein {
                if pass == 0 {
                    for (i, w) in b.chirp.iter().enumerate() {
                        let v = mul(get(l, x, i), *w);
                        put::<L>(x, i, v);
                    }
                    x[2 * self.n * L::WIDTH..self.buffer(L::WIDTH)].fill(0.0);
                } else {
                    // The inverse is the transform with real and imaginary parts exchanged.
                    for (i, w) in b.spectrum.iter().enumerate() {
                        let (re, im) = mul(get(l, x, i), *w);
                        put::<L>(x, i, (im, re));
                    }
                }
            }
            for stage in &self.stages {
                stage.run(l, x, other);
                std::mem::swap(x, other);
            }
        }
        if let Some(b) = &self.bluestein {
            for (i, w) in b.chirp.iter().enumerate() {
                let (im, re) = get(l, x, i);
                put::<L>(x, i, mul((re, im), *w));
            }
        }
    }
}

fn stages(radices: &[usize], n: usize) -> Vec<Stage> {
    let (mut left, mut stride) = (n, 1);
    let mut all = Vec::new();
    for &radix in radices {
        let rest = left / radix;
        let twiddles = (0..rest).flat_map(|q| (1..radix).map(move |k| single(root(q * k, left)))).collect();
        all.push(Stage { radix, rest, stride, twiddles });
        left = rest;
        stride *= radix;
    }
    all
}

fn recursive(x: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let n = x.len();
    if n == 1 {
        return x.to_vec();
    }
    let half = |from: usize| recursive(&x.iter().skip(from).step_by(2).copied().collect::<Vec<_>>());
    let (even, odd) = (half(0), half(1));
    let mut out = vec![[0.0; 2]; n];
    for k in 0..n / 2 {
        let [c, s] = root(k, n);
        let t = [odd[k][0] * c - odd[k][1] * s, odd[k][0] * s + odd[k][1] * c];
        out[k] = [even[k][0] + t[0], even[k][1] + t[1]];
        out[k + n / 2] = [even[k][0] - t[0], even[k][1] - t[1]];
    }
    out
}

/// A complex number per lane.
type C<L> = (<L as Lane>::F, <L as Lane>::F);

/// Element `i`.
#[inline(always)]
pub fn get<L: Lane>(l: L, x: &[f32], i: usize) -> C<L> {
    let x = &x[2 * i * L::WIDTH..2 * (i + 1) * L::WIDTH];
    (l.load(x), l.load(&x[L::WIDTH..]))
}

/// Sets element `i`.
#[inline(always)]
pub fn put<L: Lane>(x: &mut [f32], i: usize, v: C<L>) {
    let x = &mut x[2 * i * L::WIDTH..2 * (i + 1) * L::WIDTH];
    v.0.store(x);
    v.1.store(&mut x[L::WIDTH..]);
}

#[inline(always)]
fn add<N: Num>(a: (N, N), b: (N, N)) -> (N, N) {
    (a.0 + b.0, a.1 + b.1)
}

#[inline(always)]
fn sub<N: Num>(a: (N, N), b: (N, N)) -> (N, N) {
    (a.0 - b.0, a.1 - b.1)
}

#[inline(always)]
fn mul<N: Num>(a: (N, N), [c, s]: [f32; 2]) -> (N, N) {
    (a.0 * c - a.1 * s, a.0 * s + a.1 * c)
}

/// Times a real number.
#[inline(always)]
fn times<N: Num>(a: (N, N), c: f32) -> (N, N) {
    (a.0 * c, a.1 * c)
}

/// Times -i.
#[inline(always)]
fn turn<N: Num>(a: (N, N)) -> (N, N) {
    (a.1, -a.0)
}

impl Stage {
    #[inline(always)]
    fn run<L: Lane>(&self, l: L, x: &[f32], y: &mut [f32]) {
        let (m, s) = (self.rest, self.stride);
        for q in 0..m {
            let w = &self.twiddles[q * (self.radix - 1)..(q + 1) * (self.radix - 1)];
            for t in 0..s {
                let from = t + s * q;
                let to = t + s * self.radix * q;
                match self.radix {
                    4 => {
                        let [a, b, c, d] = [
                            get(l, x, from),
                            get(l, x, from + s * m),
                            get(l, x, from + 2 * s * m),
                            get(l, x, from + 3 * s * m),
                        ];
                        let (ac, bd) = (add(a, c), add(b, d));
                        let (a_c, b_d) = (sub(a, c), turn(sub(b, d)));
                        put::<L>(y, to, add(ac, bd));
                        put::<L>(y, to + s, mul(add(a_c, b_d), w[0]));
                        put::<L>(y, to + 2 * s, mul(sub(ac, bd), w[1]));
                        put::<L>(y, to + 3 * s, mul(sub(a_c, b_d), w[2]));
                    }
                    2 => {
                        let (a, b) = (get(l, x, from), get(l, x, from + s * m));
                        put::<L>(y, to, add(a, b));
                        put::<L>(y, to + s, mul(sub(a, b), w[0]));
                    }
                    3 => {
                        const SIN: f32 = 0.866_025_4; // sin(TAU / 3)
                        let [a, b, c] = [get(l, x, from), get(l, x, from + s * m), get(l, x, from + 2 * s * m)];
                        let sum = add(b, c);
                        let (middle, side) = (sub(a, times(sum, 0.5)), turn(times(sub(b, c), SIN)));
                        put::<L>(y, to, add(a, sum));
                        put::<L>(y, to + s, mul(add(middle, side), w[0]));
                        put::<L>(y, to + 2 * s, mul(sub(middle, side), w[1]));
                    }
                    _ => {
                        const C1: f32 = 0.309_017; // cos(TAU / 5)
                        const C2: f32 = -0.809_017; // cos(2 TAU / 5)
                        const S1: f32 = 0.951_056_5;
                        const S2: f32 = 0.587_785_24;
                        let [a, b, c] = [get(l, x, from), get(l, x, from + s * m), get(l, x, from + 2 * s * m)];
                        let (d, e) = (get(l, x, from + 3 * s * m), get(l, x, from + 4 * s * m));
                        let (be, cd) = (add(b, e), add(c, d));
                        let (b_e, c_d) = (sub(b, e), sub(c, d));
                        let near = add(a, add(times(be, C1), times(cd, C2)));
                        let far = add(a, add(times(be, C2), times(cd, C1)));
                        let near_side = turn(add(times(b_e, S1), times(c_d, S2)));
                        let far_side = turn(sub(times(b_e, S2), times(c_d, S1)));
                        put::<L>(y, to, add(a, add(be, cd)));
                        put::<L>(y, to + s, mul(add(near, near_side), w[0]));
                        put::<L>(y, to + 2 * s, mul(add(far, far_side), w[1]));
                        put::<L>(y, to + 3 * s, mul(sub(far, far_side), w[2]));
                        put::<L>(y, to + 4 * s, mul(sub(near, near_side), w[3]));
                    }
                }
            }
        }
    }
}

/// A real transform of two sequences per lane, one in the real and one in the imaginary parts: its eigenfunctions fit what
/// lies beyond the ends.
#[derive(Clone, Debug)]
pub struct Real {
    plan: Plan,
    periodic: bool,
    /// `cos` and `sin` of `PI k / 2n`, for the cosine transform.
    quarter: Vec<[f32; 2]>,
}

impl Real {
    /// The Hartley transform `sum x[i] (cos + sin)(TAU i k / n)` of periodic sequences, or the cosine transform
    /// `sum x[i] cos(PI (2i + 1) k / 2n)` of sequences that are mirrored at their ends (J. Makhoul 1980, "A fast cosine
    /// transform in one and two dimensions").
    pub fn new(n: usize, periodic: bool) -> Real {
        let quarter = (0..if periodic { 0 } else { n }).map(|k| root(k, 4 * n)).map(|[c, s]| single([c, -s])).collect();
        Real { plan: Plan::new(n), periodic, quarter }
    }
    /// See [`Plan::buffer`].
    pub fn buffer(&self, width: usize) -> usize {
        self.plan.buffer(width)
    }
    /// The complex transform that stands between the other steps.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }
    /// Where number `i` of a sequence lies before [`Real::after`]'s transform and after the one of [`Real::before`].
    #[inline(always)]
    pub fn slot(&self, i: usize) -> usize {
        if self.periodic {
            i
        } else if i.is_multiple_of(2) {
            i / 2
        } else {
            self.plan.n - 1 - i / 2
        }
    }
    /// After the complex transform of numbers in their slots: the real transform, in order.
    #[inline(always)]
    pub fn after<L: Lane>(&self, l: L, x: &mut [f32]) {
        let n = self.plan.n;
        for k in 0..=n / 2 {
            let mirror = (n - k) % n;
            let (p, q) = (get(l, x, k), get(l, x, mirror));
            // Twice the transforms a and b of the two sequences: z = a + i b.
            let a = (p.0 + q.0, p.1 - q.1);
            let b = (p.1 + q.1, q.0 - p.0);
            if self.periodic {
                put::<L>(x, k, ((a.0 - a.1) * 0.5, (b.0 - b.1) * 0.5));
                put::<L>(x, mirror, ((a.0 + a.1) * 0.5, (b.0 + b.1) * 0.5));
                continue;
            }
            let [c, s] = self.quarter[k].map(|v| v * 0.5);
            put::<L>(x, k, (a.0 * c + a.1 * s, b.0 * c + b.1 * s));
            if mirror != k {
                // cos and sin change places, and the conjugates are used.
                put::<L>(x, mirror, (a.0 * s - a.1 * c, b.0 * s - b.1 * c));
            }
        }
    }
    /// Before the complex transform that leads back: the numbers are then in their slots, `n` times as large, and real and
    /// imaginary parts are exchanged unless the transform is periodic.
    #[inline(always)]
    pub fn before<L: Lane>(&self, l: L, x: &mut [f32]) {
        if self.periodic {
            return;
        }
        let n = self.plan.n;
        for k in 0..=n / 2 {
            let mirror = (n - k) % n;
            let (p, mut q) = (get(l, x, k), get(l, x, mirror));
            if k == 0 {
                q = (l.f(0.0), l.f(0.0));
            }
            let [c, s] = self.quarter[k];
            // a = (c + i s)(p - i q) of each sequence, z = a + i b.
            let a = (p.0 * c + q.0 * s, p.0 * s - q.0 * c);
            let b = (p.1 * c + q.1 * s, p.1 * s - q.1 * c);
            put::<L>(x, k, (a.1 + b.0, a.0 - b.1));
            if k > 0 && mirror != k {
                // The conjugates.
                put::<L>(x, mirror, (b.0 - a.1, a.0 + b.1));
            }
        }
    }
    /// The numbers of slot `i` after the way back.
    #[inline(always)]
    pub fn back<L: Lane>(&self, l: L, x: &[f32], i: usize) -> C<L> {
        let (re, im) = get(l, x, i);
        if self.periodic { (re, im) } else { (im, re) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lane::{Kernel, Level};

    /// Two sequences per lane: forward, and forward and back.
    struct Both<'a>(&'a Real, &'a [Vec<f32>]);
    impl Kernel for Both<'_> {
        type Out = [Vec<Vec<f32>>; 2];
        #[inline(always)]
        fn run<L: Lane>(self, l: L) -> Self::Out {
            let (r, n) = (self.0, self.0.plan.n);
            let (mut there, mut back) = (vec![], vec![]);
            for group in self.1.chunks(2 * L::WIDTH) {
                let (mut x, mut y) = (vec![0.0; r.buffer(L::WIDTH)], vec![0.0; r.buffer(L::WIDTH)]);
                for (j, sequence) in group.iter().enumerate() {
                    for (i, v) in sequence.iter().enumerate() {
                        x[2 * r.slot(i) * L::WIDTH + (j % 2) * L::WIDTH + j / 2] = *v;
                    }
                }
                r.plan.run(l, &mut x, &mut y);
                r.after(l, &mut x);
                let at = |x: &[f32], i: usize, j: usize| x[2 * i * L::WIDTH + (j % 2) * L::WIDTH + j / 2];
                for j in 0..group.len() {
                    there.push((0..n).map(|i| at(&x, i, j)).collect());
                }
                r.before(l, &mut x);
                r.plan.run(l, &mut x, &mut y);
                if r.periodic {
                    r.after(l, &mut x);
                }
                let mut z = x.clone();
                for i in 0..n {
                    put::<L>(&mut z, i, r.back(l, &x, r.slot(i)));
                }
                for j in 0..group.len() {
                    back.push((0..n).map(|i| at(&z, i, j) / n as f32).collect());
                }
            }
            [there, back]
        }
    }

    fn sequences(n: usize) -> Vec<Vec<f32>> {
        let mut seed = 7u32;
        let mut next = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 8_388_608.0 - 1.0
        };
        (0..32).map(|_| (0..n).map(|_| next()).collect()).collect()
    }

    #[test]
    fn transforms_are_their_sums_and_come_back_at_every_length_and_level() {
        for n in [1, 2, 3, 4, 5, 6, 7, 8, 11, 15, 16, 30, 49, 64, 100, 127] {
            for periodic in [false, true] {
                let r = Real::new(n, periodic);
                let input = sequences(n);
                let all: Vec<_> = Level::available().into_iter().map(|l| l.run(Both(&r, &input))).collect();
                for (j, x) in input.iter().enumerate() {
                    for k in 0..n {
                        let want: f64 = (0..n)
                            .map(|i| {
                                let turn = if periodic {
                                    (i * k) as f64 / n as f64
                                } else {
                                    ((2 * i + 1) * k) as f64 / (4 * n) as f64
                                };
                                let (s, c) = sin_cos_f64(turn * TAU);
                                f64::from(x[i]) * if periodic { c + s } else { c }
                            })
                            .sum();
                        // A few roundings of a sum of n numbers below 1.
                        let bound = 1e-6 * (n as f64).sqrt().max(2.0);
                        assert!(
                            (want - f64::from(all[0][0][j][k])).abs() < bound,
                            "{n} {periodic} {k} {want} {}",
                            all[0][0][j][k]
                        );
                        assert!((x[k] - all[0][1][j][k]).abs() < 2e-6, "{n} {periodic} {k}");
                    }
                }
                // Not merely close: every level gives the same numbers.
                assert!(all.iter().all(|o| *o == all[0]), "{n} {periodic}");
            }
        }
    }
}
