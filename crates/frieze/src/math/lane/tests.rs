use super::*;

struct Probe;
impl Kernel for Probe {
    type Out = (usize, Vec<u32>);
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> Self::Out {
        let mut bits = Vec::new();
        for block in 0..16 / L::WIDTH {
            let x = (l.ramp() + (block * L::WIDTH) as i32).to_num() * 0.37 - 2.5;
            let y = x.mix(x * x, x.abs().sqrt()).max(x.lift(-1.0)) / (x.floor() + 3.25);
            let z = y.or_else(x.lt(y), x).clamp(-1.5, 1.5);
            let i = (z * 100.0).to_int().max(l.i(-7)) * 3 + ((z.to_bits() >> 20) & 15);
            for k in 0..L::WIDTH {
                bits.push(z.lane(k).to_bits() ^ i.lane(k) as u32);
            }
        }
        (L::WIDTH, bits)
    }
}

#[test]
fn every_level_gives_the_same_bits() {
    let mut want = Vec::new();
    // One lane at a time, shifted: the scalar truth.
    for k in 0..16 {
        let x = k as f32 * 0.37 - 2.5;
        let y = Num::mix(x, x * x, Num::sqrt(Num::abs(x)));
        let y = Num::max(y, -1.0) / (Num::floor(x) + 3.25);
        let z = Num::clamp(Num::or_else(y, x < y, x), -1.5, 1.5);
        let i = Num::to_int(z * 100.0).max(I1(-7)) * 3 + ((Num::to_bits(z) >> 20) & 15);
        want.push(f32::to_bits(z) ^ i.0 as u32);
    }
    for level in Level::available() {
        let (_, got) = level.run(Probe);
        assert_eq!(got, want, "{}", level.name());
    }
}

struct Transpose;
impl Kernel for Transpose {
    type Out = ();
    #[inline(always)]
    fn run<L: Lane>(self, l: L) {
        let rows: Vec<[f32; 8]> = (0..L::WIDTH).map(|k| core::array::from_fn(|c| (k * 8 + c) as f32)).collect();
        let cols = l.transpose8(&rows);
        for (c, col) in cols.iter().enumerate() {
            for k in 0..L::WIDTH {
                assert_eq!(col.lane(k), (k * 8 + c) as f32);
            }
        }
        let cols = l.transpose4_from(
            #[inline(always)]
            |k| &rows[k][2..6],
        );
        for (c, col) in cols.iter().enumerate() {
            for k in 0..L::WIDTH {
                assert_eq!(col.lane(k), (k * 8 + c + 2) as f32);
            }
        }
        let [low, high] = l.pairs(
            #[inline(always)]
            |k| (k as u64 + 0xffff_ffe0) | (k as u64 + 7) << 32,
        );
        for k in 0..L::WIDTH {
            assert_eq!((low.lane(k), high.lane(k)), (k as i32 - 32, k as i32 + 7));
        }
    }
}

#[test]
fn transpose_moves_rows_to_columns() {
    Transpose.run(One);
    for level in Level::available() {
        level.run(Transpose);
    }
}

#[test]
fn min_and_max_have_a_nan_rule() {
    assert_eq!(Num::min(f32::NAN, 1.0), 1.0);
    assert_eq!(Num::max(f32::NAN, 1.0), 1.0);
    assert_eq!(Num::saturate(f32::NAN), 0.0);
}
