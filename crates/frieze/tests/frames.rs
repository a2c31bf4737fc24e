//! What documents 000 and 001 say about tangent frames, and where they err (E3 to E6b), as plain mathematics with the
//! library's own functions.

use frieze::math::exact;
use frieze::math::vec::{Mat4, Vec2, Vec3};
use frieze::mesh::tangent::{games101_tangent, gram_schmidt, solve};
use frieze::shade::surface::from_normal;

/// Small numbers without pattern, -1 .. 1.
fn random(seed: &mut u32) -> f32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*seed >> 8) as f32 / (1 << 23) as f32 - 1.0
}

fn vector(seed: &mut u32) -> Vec3 {
    Vec3::new(random(seed), random(seed), random(seed))
}

/// Largest entry of `TBNᵀ TBN - I`.
fn skew(axes: [Vec3; 3]) -> f32 {
    let entry = |i: usize, j: usize| (axes[i].dot(axes[j]) - f32::from(u8::from(i == j))).abs();
    (0..9).map(|k| entry(k / 3, k % 3)).fold(0.0, f32::max)
}

#[test]
fn row_63_and_e3_the_transpose_is_the_inverse_after_gram_schmidt_only() {
    let mut seed = 5;
    let (mut raw, mut done, mut count) = (f32::INFINITY, 0.0f32, 0);
    while count < 500 {
        let (e1, e2) = (vector(&mut seed), vector(&mut seed));
        let d = [0, 1].map(|_| Vec2::new(random(&mut seed), random(&mut seed)));
        let n = e1.cross(e2).normalize();
        let Some((t, b)) = solve(e1, e2, d[0], d[1]).filter(|_| (d[0].x * d[1].y - d[1].x * d[0].y).abs() > 0.1) else {
            continue;
        };
        count += 1;
        // As row 58 leaves them: not of unit length, not perpendicular. Of unit length: still not perpendicular.
        raw = raw.min(skew([t, b, n]));
        let t = gram_schmidt(t, n).unwrap();
        done = done.max(skew([t, n.cross(t), n]));
    }
    // The row's bound.
    assert!(done < 1e-6, "{done}");
    assert!(raw > 1e-3, "{raw}");
}

#[test]
fn row_61_and_e3b_columns_turn_to_the_world_and_rows_to_the_surface() {
    let n = Vec3::new(0.48, 0.6, 0.64);
    let t = gram_schmidt(Vec3::new(1.0, 0.2, -0.3), n).unwrap();
    let b = n.cross(t);
    // mat3(T, B, N) of GLSL has them as columns.
    let columns = Mat4::from_axes(t, b, n, Vec3::splat(0.0));
    let z = Vec3::new(0.0, 0.0, 1.0);
    assert!((columns.direction(z) - n).length() < 1e-6);
    // The matrix as document 001 prints it, T, B, N as rows, times a column vector: from the world to the surface.
    let rows = columns.transpose();
    assert!((rows.direction(n) - z).length() < 1e-6 && (rows.direction(z) - n).length() > 0.1);
}

#[test]
fn e4_a_point_has_w_1_and_e4b_turning_at_vertices_is_not_turning_at_fragments() {
    // E4: with w = 0 the translation is lost.
    let model = Mat4::translation(Vec3::new(5.0, 0.0, 0.0));
    let p = Vec3::new(0.0, 1.0, 0.0);
    assert_eq!(model.point(p) - model.direction(p), Vec3::new(5.0, 0.0, 0.0));
    // E4b: two vertices of a curved surface, 30 degrees apart. The direction to a light, turned into each vertex's frame
    // and then interpolated, against turned into the interpolated frame.
    let frame = |degrees: f64| {
        let (s, c) = exact::sin_cos_f64(degrees.to_radians());
        let n = Vec3::new(s as f32, 0.0, c as f32);
        let t = Vec3::new(c as f32, 0.0, -s as f32);
        [t, n.cross(t), n]
    };
    let light = Vec3::new(0.2, 0.3, 0.9);
    let turned = |f: [Vec3; 3]| Vec3::new(f[0].dot(light), f[1].dot(light), f[2].dot(light));
    let between = |apart: f64| {
        let vertices = (turned(frame(-apart / 2.0)) + turned(frame(apart / 2.0))) * 0.5;
        (vertices.normalize() - turned(frame(0.0)).normalize()).length()
    };
    assert!(between(30.0) > 1e-3 && between(0.0) < 1e-6);
    // It falls with the square of the angle: cos(a / 2) shortens two of three components.
    let ratio = between(30.0) / between(15.0);
    assert!((3.8..4.3).contains(&ratio), "{ratio}");
}

#[test]
fn row_64_and_e5_the_four_by_four_normal_matrix_leaves_a_w() {
    let model = Mat4::translation(Vec3::new(2.0, -1.0, 3.0)).times(&Mat4::scale(Vec3::new(1.0, 2.0, 3.0)));
    let whole = model.inverse().unwrap().transpose();
    let n = Vec3::new(0.6, 0.0, 0.8);
    // As document 000 prints it: a vector, whose w is not 0. Its x, y and z are right.
    let four = whole.apply(n.extend(0.0));
    assert!(four.w.abs() > 0.1, "{four:?}");
    let three = model.normal_matrix().direction(n).normalize();
    assert!((four.xyz().normalize() - three).length() < 1e-6);
    // "Only rigid is safe": so is a uniform scale, once normals are of unit length again.
    let uniform = Mat4::rotation([0.3, -0.2, 0.5, 0.8]).times(&Mat4::scale(Vec3::splat(3.0)));
    let (a, b) = (uniform.direction(n).normalize(), uniform.normal_matrix().direction(n).normalize());
    assert!((a - b).length() < 1e-6);
    assert!((model.direction(n).normalize() - three).length() > 0.1);
}

#[test]
fn row_66_and_e6_the_tangent_is_the_normal_turned_by_a_right_angle_in_one_order_only() {
    let mut seed = 11;
    for _ in 0..200 {
        let n = vector(&mut seed).normalize();
        let s = (n.x * n.x + n.z * n.z).sqrt();
        if n.length2() < 0.5 || s < 0.1 || n.y.abs() < 0.1 {
            continue;
        }
        let (c, d) = (n.x / s, n.z / s);
        // The first and the last matrix as document 001 prints them, and R_z(90°) between.
        let axes = |r: [[f32; 3]; 3]| {
            let [x, y, z] = [0, 1, 2].map(|k| Vec3::new(r[0][k], r[1][k], r[2][k]));
            Mat4::from_axes(x, y, z, Vec3::splat(0.0))
        };
        let first = axes([[c, 0.0, d], [0.0, 1.0, 0.0], [-d, 0.0, c]]);
        let quarter = axes([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        let last = axes([[c, 0.0, -d], [0.0, 1.0, 0.0], [d, 0.0, c]]);
        let right = last.times(&quarter).times(&first).direction(n);
        let t = games101_tangent(n, true);
        // A few products of numbers up to 1.
        assert!((right - t).length() < 1e-6, "{right:?} {t:?}");
        assert!((from_normal(n, -1.0)[0] - t).length() < 1e-6);
        // In the printed order it is another vector, unless z is 0.
        let printed = first.times(&quarter).times(&last).direction(n);
        assert!(n.z.abs() < 0.05 || (printed - t).length() > 1e-3, "{n:?}");
    }
}

#[test]
fn e6b_the_normal_is_the_product_of_both_derivatives_of_place() {
    // A ball: P(u, v), and its normal is P itself.
    let at = |u: f64, v: f64| {
        let ((su, cu), (sv, cv)) = (exact::sin_cos_f64(u), exact::sin_cos_f64(v));
        Vec3::new((cu * cv) as f32, sv as f32, (su * cv) as f32) * 2.0
    };
    let (u, v, h) = (0.7, 0.3, 1e-2);
    let pu = at(u + h, v) - at(u - h, v);
    let pv = at(u, v + h) - at(u, v - h);
    let nv = (at(u, v + h) - at(u, v - h)) * 0.5;
    let n = pv.cross(pu).normalize();
    // Central differences of 0.01: their error is along the curve, and its cube.
    assert!((n - at(u, v).normalize()).length() < 1e-4);
    // As printed, P_u x N_v: on a ball it is parallel to the normal by chance, but of another length; on a cylinder along
    // v the normal does not change along v, and the product is 0.
    assert!((pu.cross(nv).length() / pu.cross(pv).length() - 0.5).abs() < 1e-3);
    let cylinder = |u: f64, v: f64| {
        let (s, c) = exact::sin_cos_f64(u);
        (Vec3::new(c as f32, v as f32, s as f32), Vec3::new(c as f32, 0.0, s as f32))
    };
    let (_, n0) = cylinder(u, v - h);
    let (_, n1) = cylinder(u, v + h);
    let pu = cylinder(u + h, v).0 - cylinder(u - h, v).0;
    assert_eq!(pu.cross(n1 - n0).length(), 0.0);
}
