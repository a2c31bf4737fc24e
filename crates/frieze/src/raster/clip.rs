//! The few triangles that cross the near plane or leave the guard band.

use super::GUARD;

/// A homogeneous picture position: x and y in pixels times w, z / w the reversed depth.
pub type Clip = [f64; 4];

/// Distance to each plane that a projected point must not be behind: near (z <= w), and the guard band's sides.
fn distance(p: &Clip, plane: usize) -> f64 {
    let g = f64::from(GUARD);
    match plane {
        // A hair in front of the near plane, so that w stays positive even where near is 0.
        0 => p[3] - p[2],
        1 => p[0] + g * p[3],
        2 => g * p[3] - p[0],
        3 => p[1] + g * p[3],
        4 => g * p[3] - p[1],
        _ => p[3] - 1e-30,
    }
}

/// Whether a point can be projected as it is.
pub fn is_inside(p: &Clip) -> bool {
    (0..6).all(|k| distance(p, k) >= 0.0)
}

/// Clips a triangle to the near plane and the guard band; up to 9 corners.
///
/// New corners are computed from the inner to the outer end of an edge, so that two triangles that share the
/// edge get the same bits (Sutherland and Hodgman 1974).
pub fn clip(triangle: [Clip; 3], out: &mut Vec<Clip>) {
    out.clear();
    out.extend_from_slice(&triangle);
    let mut from: Vec<Clip> = Vec::with_capacity(9);
    for plane in 0..6 {
        if out.iter().all(|p| distance(p, plane) >= 0.0) {
            continue;
        }
        std::mem::swap(&mut from, out);
        out.clear();
        for (k, a) in from.iter().enumerate() {
            let b = &from[(k + 1) % from.len()];
            let (da, db) = (distance(a, plane), distance(b, plane));
            if da >= 0.0 {
                out.push(*a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                let (inner, outer, di, d) = if da >= 0.0 { (a, b, da, db) } else { (b, a, db, da) };
                let t = di / (di - d);
                out.push(core::array::from_fn(|c| inner[c] + (outer[c] - inner[c]) * t));
            }
        }
        if out.len() < 3 {
            out.clear();
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shared_edge_is_cut_at_the_same_point_from_both_sides() {
        let (a, b) = ([3.0, 5.0, 0.1, 1.0], [700.0, -90.0, 0.1, -0.3]);
        let (mut one, mut two) = (Vec::new(), Vec::new());
        clip([a, b, [0.0, 1.0, 0.1, 2.0]], &mut one);
        clip([b, a, [9.0, 4.0, 0.1, 0.7]], &mut two);
        let near = |v: &[Clip]| -> Vec<[u64; 4]> { v.iter().map(|p| p.map(f64::to_bits)).collect() };
        let (one, two) = (near(&one), near(&two));
        // The corner and the cut of the shared edge.
        assert_eq!(one.iter().filter(|p| two.contains(p)).count(), 2);
    }

    #[test]
    fn what_is_behind_vanishes_and_what_is_inside_stays() {
        let mut out = Vec::new();
        clip([[0.0, 0.0, 1.0, -1.0], [1.0, 0.0, 1.0, -1.0], [0.0, 1.0, 1.0, -2.0]], &mut out);
        assert!(out.is_empty());
        let t = [[0.0, 0.0, 0.5, 1.0], [1.0, 0.0, 0.5, 1.0], [0.0, 1.0, 0.5, 1.0]];
        clip(t, &mut out);
        assert_eq!(out, t);
    }
}
