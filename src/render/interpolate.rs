//! Interpolation of what the corner pixels of a group have seen.

use glam::{DVec2, Vec3};

/// Place (u, v) of `p` in the bilinear quad with corners at (0,0), (1,0), (1,1) and (0,1), each in 0..=1; a point
/// outside gets the nearest parameters along each axis. `None` where the quad has no area to speak of.
pub fn inverse_bilinear(p: DVec2, [a, b, c, d]: [DVec2; 4]) -> Option<DVec2> {
    let (e, f, g, h) = (b - a, d - a, a - b + c - d, p - a);
    let (k0, k1, k2) = (h.perp_dot(e), e.perp_dot(f) + h.perp_dot(g), g.perp_dot(f));
    let v = smaller_root(k2, k1, k0)?;
    let along = e + v * g;
    let u = if along.x.abs() > along.y.abs() { (h.x - v * f.x) / along.x } else { (h.y - v * f.y) / along.y };
    (u.is_finite() && v.is_finite()).then(|| DVec2::new(u, v).clamp(DVec2::ZERO, DVec2::ONE))
}

/// The root of k2 x² + k1 x + k0 nearest to the middle of 0..1.
fn smaller_root(k2: f64, k1: f64, k0: f64) -> Option<f64> {
    if k2.abs() < 1e-9 * k1.abs() {
        return Some(-k0 / k1);
    }
    let discriminant = k1 * k1 - 4.0 * k0 * k2;
    let q = -0.5 * (k1 + discriminant.max(0.0).sqrt().copysign(k1));
    let roots = [q / k2, k0 / q];
    let outside = |x: f64| (x - 0.5).abs();
    roots.into_iter().filter(|x| x.is_finite()).min_by(|a, b| outside(*a).total_cmp(&outside(*b)))
}

/// Four colours, those of (0,0), (1,0), (1,1) and (0,1), mixed at (u, v).
pub fn bilinear([a, b, c, d]: [Vec3; 4], uv: DVec2) -> Vec3 {
    let (u, v) = (uv.x as f32, uv.y as f32);
    a.lerp(b, u).lerp(d.lerp(c, u), v)
}

/// Mean value coordinates (Floater 2003) of `p` in a convex polygon given in order: weights that sum to 1. `None` where
/// the polygon has no area to speak of.
pub fn mean_value_weights(p: DVec2, polygon: [DVec2; 4]) -> Option<[f64; 4]> {
    let arms = polygon.map(|corner| corner - p);
    let lengths = arms.map(DVec2::length);
    if let Some(k) = lengths.iter().position(|&length| length < 1e-9) {
        return Some(std::array::from_fn(|i| f64::from(u8::from(i == k))));
    }
    // On an edge its two corners alone count; tangents are infinite there.
    let is_on_edge = |k: &usize| {
        let (a, b) = (arms[*k], arms[(k + 1) % 4]);
        a.perp_dot(b).abs() <= 1e-9 * lengths[*k] * lengths[(k + 1) % 4] && a.dot(b) < 0.0
    };
    if let Some(k) = (0..4).find(is_on_edge) {
        let (a, b) = (lengths[k], lengths[(k + 1) % 4]);
        let mut weights = [0.0; 4];
        (weights[k], weights[(k + 1) % 4]) = (b / (a + b), a / (a + b));
        return Some(weights);
    }
    let half_tangent = |k: usize| {
        let (a, b) = (arms[k], arms[(k + 1) % 4]);
        let cosine = a.dot(b) + lengths[k] * lengths[(k + 1) % 4];
        a.perp_dot(b) / cosine
    };
    let tangents: [f64; 4] = std::array::from_fn(half_tangent);
    let weights: [f64; 4] = std::array::from_fn(|k| (tangents[(k + 3) % 4] + tangents[k]) / lengths[k]);
    let sum: f64 = weights.iter().sum();
    let weights = weights.map(|w| w / sum);
    weights.iter().all(|w| w.is_finite()).then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_edges_are_mixed_of_their_ends() {
        let rhombus = [[2.0, 0.0], [4.0, 2.0], [2.0, 4.0], [0.0, 2.0]].map(DVec2::from);
        let near = |p: [f64; 2], polygon, expected: [f64; 4]| {
            let weights = mean_value_weights(p.into(), polygon).unwrap();
            assert!(weights.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{p:?}: {weights:?}");
        };
        near([3.0, 1.0], rhombus, [0.5, 0.5, 0.0, 0.0]);
        near([2.5, 0.5], rhombus, [0.75, 0.25, 0.0, 0.0]);
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(DVec2::from);
        near([0.0, 1.0], square, [0.75, 0.0, 0.0, 0.25]);
        near([2.0, 2.0], square, [0.25; 4]);
    }

    const KITE: [DVec2; 4] = [DVec2::new(3.0, 0.0), DVec2::new(7.0, 4.0), DVec2::new(4.0, 9.0), DVec2::new(0.0, 3.0)];

    fn at(u: f64, v: f64) -> DVec2 {
        let [a, b, c, d] = KITE;
        a.lerp(b, u).lerp(d.lerp(c, u), v)
    }

    #[test]
    fn a_point_of_a_quad_is_found_again() {
        for (u, v) in [(0.0, 0.0), (1.0, 1.0), (0.25, 0.5), (0.9, 0.1)] {
            let found = inverse_bilinear(at(u, v), KITE).unwrap();
            assert!((found - DVec2::new(u, v)).length() < 1e-9, "{found}");
        }
    }

    #[test]
    fn a_quad_without_area_has_no_places() {
        assert_eq!(inverse_bilinear(DVec2::ONE, [DVec2::ZERO; 4]), None);
    }

    #[test]
    fn mean_value_weights_give_back_the_point() {
        let p = at(0.3, 0.6);
        let weights = mean_value_weights(p, KITE).unwrap();
        let back: DVec2 = KITE.iter().zip(weights).map(|(corner, w)| w * *corner).sum();
        assert!((back - p).length() < 1e-9 && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
