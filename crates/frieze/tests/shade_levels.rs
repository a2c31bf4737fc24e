//! Law 6 for shading: the same bits at every SIMD level and width. Slow to compile (every level inlines the whole
//! of shading), hence a crate of its own.

use frieze::image::pyramid::Pyramid;
use frieze::image::{Encoding, Image, Pixels};
use frieze::map::{Footprint, Map};
use frieze::math::lane::{Int, Kernel, Lane, Level, Num, One};
use frieze::math::vec::{Vec2, Vec3, Vec4};
use frieze::scene::{Falloff, Light, LightKind, Material, Model, NormalMap, TangentFrame, TbnPath, Texture};
use frieze::shade::{Lamp, Lights, Look, Silent, Surface, shade};
use std::sync::Arc;

const Z: Vec3 = Vec3::new(0.0, 0.0, 1.0);

/// Shades 16 points and returns the bits of their colours.
struct Bits<'a>(&'a Look, &'a [Lamp]);
impl Kernel for Bits<'_> {
    type Out = Vec<u32>;
    #[inline(always)]
    fn run<L: Lane>(self, l: L) -> Vec<u32> {
        let lights = Lights { lamps: self.1, ambient: [0.1, 0.12, 0.14], per_light: true };
        let mut bits = Vec::new();
        for block in 0..16 / L::WIDTH {
            let x = (l.ramp() + (block * L::WIDTH) as i32).to_num() * 0.13 - 1.0;
            let zero = l.f(0.0);
            let s = Surface {
                active: l.mask(u32::MAX),
                position: Vec3::new(x, x * 0.5, x * x),
                view: Vec3::new(x * -0.4, x * x, l.f(1.0)).normalize(),
                normal: Vec3::new(x, x * 0.3 + 0.1, l.f(0.8)),
                plane: Vec3::new(x, x * 0.3 + 0.1, l.f(0.8)).normalize(),
                tangent: Vec3::new(l.f(1.0), x * 0.2, x * -0.4),
                sign: l.f(-1.0),
                object: [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)],
                uv: [Vec2::new(x * 0.7, x * 1.3); 2],
                footprint: [Footprint { dudx: l.f(0.1), dvdx: zero, dudy: zero, dvdy: l.f(0.3) }; 2],
                color: Vec4::splat(l.f(0.9)),
                lit: None,
            };
            let c = shade(l, self.0, &lights, &s, &mut Silent);
            for v in c.array() {
                let mut out = [0.0; 16];
                v.store(&mut out);
                bits.extend(out[..L::WIDTH].iter().map(|v| v.to_bits()));
            }
        }
        bits
    }
}

/// `bits` of blocks of one width in the order of the points.
fn sorted(bits: &[u32], width: usize) -> Vec<[u32; 4]> {
    (0..16).map(|k| core::array::from_fn(|c| bits[k / width * width * 4 + c * width + k % width])).collect()
}

struct Width;
impl Kernel for Width {
    type Out = usize;
    #[inline(always)]
    fn run<L: Lane>(self, _: L) -> usize {
        L::WIDTH
    }
}

#[test]
fn every_level_shades_the_same_bits() {
    let texels: Vec<u8> = (0..8 * 8 * 4).map(|k| (k * 37 % 251) as u8).collect();
    let image = Image::new(8, 8, 4, Pixels::U8(texels), Encoding::Linear).unwrap();
    let pyramid = Arc::new(Pyramid::new(&image, false));
    let bulb = Light { falloff: Falloff::InverseSquare, ..Light::point(Vec3::new(1.0, 1.0, 2.0)) };
    let spot = Light { kind: LightKind::Spot { inner: 10.0, outer: 50.0 }, range: Some(9.0), ..Light::point(Z * 3.0) };
    let sun = Light::directional(Vec3::new(0.3, 0.5, 1.0), Vec3::default());
    let lamps = [sun, bulb, spot].map(|light| Lamp::new(&light, None));
    for model in [Model::BlinnPhong, Model::Pbr] {
        for (shininess, tbn_path) in [(20.5, TbnPath::World), (64.0, TbnPath::Tangent)] {
            let material = Material {
                model,
                shininess,
                tbn_path,
                multi_scatter: true,
                metallic: 0.6,
                reflection: 0.2,
                albedo_map: Some(Texture::new(0)),
                roughness_map: Some(Texture::new(0)),
                specular_map: Some(Texture { rotate: 30.0, ..Texture::new(0) }),
                normal_map: Some(NormalMap { texture: Texture::new(0), scale: 1.0, y_down: false, channels: 3 }),
                tangent_frame: TangentFrame::Mikktspace,
                ..Material::default()
            };
            let look = Look::new(&material, |t, _| Map { pyramid: pyramid.clone(), filter: t.filter, wrap: t.wrap });
            let want = sorted(&Bits(&look, &lamps).run(One), 1);
            assert!(want.iter().flatten().all(|b| f32::from_bits(*b).is_finite()));
            for level in Level::available() {
                let got = sorted(&level.run(Bits(&look, &lamps)), level.run(Width));
                assert_eq!(got, want, "{}", level.name());
            }
        }
    }
}
