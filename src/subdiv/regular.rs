//! Uniform bicubic B-spline patches: evaluation, derivatives, and the Bézier hull of a part.

use super::eval::Point;

/// 16 control points, u fastest; the patch lies between `[5]`, `[6]`, `[9]` and `[10]`.
pub type ControlPoints = [Point; 16];

/// Values of the four cubic B-spline basis functions at `t` in 0..=1.
#[inline(always)]
pub fn basis(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    let (t2, s2) = (t * t, s * s);
    let (t3, s3) = (t2 * t, s2 * s);
    let sixth = 1.0 / 6.0;
    [sixth * s3, sixth * (3.0 * t3 - 6.0 * t2 + 4.0), sixth * (3.0 * s3 - 6.0 * s2 + 4.0), sixth * t3]
}

/// First derivatives of [`basis`].
#[inline(always)]
pub fn basis_derivative(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-0.5 * s * s, 0.5 * t * (3.0 * t - 4.0), -0.5 * s * (3.0 * s - 4.0), 0.5 * t * t]
}

/// The sum of products of four weights and points `c[0], c[stride], ..`.
#[inline(always)]
pub fn combine(weights: &[f64; 4], c: [Point; 4]) -> Point {
    ((c[0] * weights[0] + c[1] * weights[1]) + c[2] * weights[2]) + c[3] * weights[3]
}

/// The four points of the v-curve at basis `b`, one per column of control points.
#[inline(always)]
pub fn columns(c: &ControlPoints, b: &[f64; 4]) -> [Point; 4] {
    std::array::from_fn(|i| combine(b, [c[i], c[4 + i], c[8 + i], c[12 + i]]))
}

/// Weights that turn four B-spline points into the four Bézier points of the part [a, b] of their segment: its blossom
/// at (a,a,a), (a,a,b), (a,b,b), (b,b,b) (Ramshaw 1989).
fn bezier_weights(a: f64, b: f64) -> [[f64; 4]; 4] {
    let blossom = |x: f64, y: f64, z: f64| -> [f64; 4] {
        let q = [[(1.0 - x) / 3.0, (x + 2.0) / 3.0], [(2.0 - x) / 3.0, (x + 1.0) / 3.0], [(3.0 - x) / 3.0, x / 3.0]];
        let r = [[(1.0 - y) / 2.0, (y + 1.0) / 2.0], [(2.0 - y) / 2.0, y / 2.0]];
        let s = [1.0 - z, z];
        let mut w = [0.0; 4];
        for (k, sk) in s.iter().enumerate() {
            for l in 0..2 {
                for m in 0..2 {
                    w[k + l + m] += sk * r[k][l] * q[k + l][m];
                }
            }
        }
        w
    };
    [blossom(a, a, a), blossom(a, a, b), blossom(a, b, b), blossom(b, b, b)]
}

/// The 16 Bézier points of the part `[u0, u1] x [v0, v1]`; their convex hull holds that part of the patch.
pub fn bezier_points(c: &ControlPoints, [u0, u1]: [f64; 2], [v0, v1]: [f64; 2]) -> ControlPoints {
    let (wu, wv) = (bezier_weights(u0, u1), bezier_weights(v0, v1));
    let mut out = [Point::ZERO; 16];
    for (j, w) in wv.iter().enumerate() {
        let row = columns(c, w);
        for (i, w) in wu.iter().enumerate() {
            out[4 * j + i] = combine(w, row);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control_points() -> ControlPoints {
        std::array::from_fn(|k| {
            let (i, j) = ((k % 4) as f64, (k / 4) as f64);
            Point::new(i + 0.1 * j * j, j - 0.2 * i * i, (i * 1.3 + j * 0.7).sin())
        })
    }

    fn at(c: &ControlPoints, u: f64, v: f64) -> Point {
        combine(&basis(u), columns(c, &basis(v)))
    }

    #[test]
    fn basis_sums_to_one_and_its_derivative_to_zero() {
        for k in 0..=10 {
            let t = f64::from(k) / 10.0;
            assert!((basis(t).iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!(basis_derivative(t).iter().sum::<f64>().abs() < 1e-15);
        }
    }

    #[test]
    fn bezier_corners_of_a_part_lie_on_the_patch() {
        let c = control_points();
        let b = bezier_points(&c, [0.25, 0.7], [0.1, 0.6]);
        for (k, u, v) in [(0, 0.25, 0.1), (3, 0.7, 0.1), (12, 0.25, 0.6), (15, 0.7, 0.6)] {
            let difference = b[k] - at(&c, u, v);
            assert!(difference.max_abs() < 1e-14, "corner {k}: {difference:?}");
        }
    }
}
