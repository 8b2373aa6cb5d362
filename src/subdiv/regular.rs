//! Uniform bicubic B-spline patches: evaluation, derivatives, and the Bézier hull of a part.

use super::eval::Point;
use super::extent::{Extent, PartExtent};
use super::parts::across;
use crate::math::point_grid::LANES;
use crate::math::simd::{self, Kernel, Task};
use crate::math::{Plate, PointGrid};
use glam::DVec3;

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

/// Four points and their weights, summed in the order of [`combine`].
#[inline(always)]
fn combine_lanes<K: Kernel>(k: K, weights: &[f64; 4], c: [K::D; 4]) -> K::D {
    let product = [
        k.mul4(c[0], k.splat4(weights[0])),
        k.mul4(c[1], k.splat4(weights[1])),
        k.mul4(c[2], k.splat4(weights[2])),
        k.mul4(c[3], k.splat4(weights[3])),
    ];
    k.add4(k.add4(k.add4(product[0], product[1]), product[2]), product[3])
}

/// [`columns`] in registers.
#[inline(always)]
fn column_lanes<K: Kernel>(k: K, c: &ControlPoints, b: &[f64; 4]) -> [K::D; 4] {
    let [mut c0, mut c1, mut c2, mut c3] = [k.splat4(0.0); 4];
    for (i, out) in [&mut c0, &mut c1, &mut c2, &mut c3].into_iter().enumerate() {
        let column = [k.load4(&c[i].0), k.load4(&c[4 + i].0), k.load4(&c[8 + i].0), k.load4(&c[12 + i].0)];
        *out = combine_lanes(k, b, column);
    }
    [c0, c1, c2, c3]
}

/// The basis functions' values at four parameters: one list for each function.
pub(super) type Basis = [[f64; LANES]; 4];

/// [`basis`] at four parameters, by the same operations.
#[inline(always)]
fn basis_lanes<K: Kernel>(k: K, t: K::D) -> Basis {
    let (sixth, three, six, four) = (k.splat4(1.0 / 6.0), k.splat4(3.0), k.splat4(6.0), k.splat4(4.0));
    let s = k.sub4(k.splat4(1.0), t);
    let (t2, s2) = (k.mul4(t, t), k.mul4(s, s));
    let (t3, s3) = (k.mul4(t2, t), k.mul4(s2, s));
    let inner = [
        k.add4(k.sub4(k.mul4(three, t3), k.mul4(six, t2)), four),
        k.add4(k.sub4(k.mul4(three, s3), k.mul4(six, s2)), four),
    ];
    [
        k.store4(k.mul4(sixth, s3)),
        k.store4(k.mul4(sixth, inner[0])),
        k.store4(k.mul4(sixth, inner[1])),
        k.store4(k.mul4(sixth, t3)),
    ]
}

/// The basis at parameters, four by four, the last one repeated.
#[derive(Debug, Default)]
pub(super) struct BasisList {
    parameters: Vec<f64>,
    basis: Vec<Basis>,
}

/// Fills a list.
struct FillBasis<'a>(&'a mut BasisList);

impl Task for FillBasis<'_> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let BasisList { parameters, basis } = self.0;
        basis.clear();
        for four in parameters.chunks(LANES) {
            let mut all = [four[four.len() - 1]; LANES];
            all[..four.len()].copy_from_slice(four);
            basis.push(basis_lanes(k, k.load4(&all)));
        }
    }
}

/// Lists that are remembered: those of pieces at a few rates, and of the ever smaller parts at an irregular corner.
const N_LISTS: usize = 64;

/// The bases of the last lists of parameters: the pieces of a mesh have few different ones.
#[derive(Debug)]
pub(super) struct BasisCache([BasisList; N_LISTS]);

impl Default for BasisCache {
    fn default() -> Self {
        Self(std::array::from_fn(|_| BasisList::default()))
    }
}

impl BasisCache {
    /// The basis at a list of parameters, which is not empty.
    #[inline]
    pub fn get(&mut self, parameters: &[f64]) -> &BasisList {
        let (n, last) = (parameters.len(), parameters[parameters.len() - 1]);
        let key = parameters[0].to_bits().rotate_left(32) ^ last.to_bits() ^ n as u64;
        // The upper bits of a product depend on all bits of the key (Knuth 1998, 6.4).
        let place = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - N_LISTS.ilog2())) as usize;
        let list = &mut self.0[place];
        if list.parameters != parameters {
            list.parameters.clear();
            list.parameters.extend_from_slice(parameters);
            simd::run(FillBasis(list));
        }
        list
    }
}

/// Coordinates of control points, one list of rows for each axis.
#[inline(always)]
fn by_axis<K: Kernel>(k: K, c: &ControlPoints) -> [[K::D; 4]; 3] {
    let zero = k.splat4(0.0);
    let mut axes = [[zero; 4]; 3];
    for j in 0..4 {
        let row = [k.load4(&c[4 * j].0), k.load4(&c[4 * j + 1].0), k.load4(&c[4 * j + 2].0), k.load4(&c[4 * j + 3].0)];
        let [x, y, z, _] = k.transpose4(row);
        (axes[0][j], axes[1][j], axes[2][j]) = (x, y, z);
    }
    axes
}

/// Position and derivatives along u and v at one place, by the operations of [`combine`].
pub(super) struct PointAndTangents<'a> {
    pub control: &'a ControlPoints,
    pub u: f64,
    pub v: f64,
}

impl Task for PointAndTangents<'_> {
    type Output = [Point; 3];
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> [Point; 3] {
        let Self { control, u, v } = self;
        let along_u = basis(u);
        let columns = column_lanes(k, control, &basis(v));
        let columns_dv = column_lanes(k, control, &basis_derivative(v));
        let point = combine_lanes(k, &along_u, columns);
        let du = combine_lanes(k, &basis_derivative(u), columns);
        let dv = combine_lanes(k, &along_u, columns_dv);
        [Point(k.store4(point)), Point(k.store4(du)), Point(k.store4(dv))]
    }
}

/// Positions at all pairs of parameters: point `first + (i, j)` of `out` is at `(u[i], v[j])`. Up to three numbers
/// behind each row are overwritten.
pub(super) struct Positions<'a> {
    pub control: &'a ControlPoints,
    pub u: &'a BasisList,
    pub v: &'a BasisList,
    pub out: &'a mut PointGrid,
    pub first: [usize; 2],
}

impl Task for Positions<'_> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        // Rows of up to 12 points have their loops written out: regular blocks take 0.96 of the time.
        let bases = self.u.basis.as_slice();
        if let Some(three) = bases.as_array::<3>() {
            self.fill_rows(k, three);
        } else if let Some(two) = bases.as_array::<2>() {
            self.fill_rows(k, two);
        } else {
            self.fill_rows(k, bases);
        }
    }
}

impl Positions<'_> {
    #[inline(always)]
    fn fill_rows<K: Kernel, B: AsRef<[Basis]> + ?Sized>(self, k: K, bases: &B) {
        let Self { control, v, out, first: [i0, j0], .. } = self;
        let control = by_axis(k, control);
        for j in 0..v.parameters.len() {
            let four = &v.basis[j / LANES];
            let lane = j % LANES;
            let v = [four[0][lane], four[1][lane], four[2][lane], four[3][lane]];
            for (axis, rows) in control.iter().enumerate() {
                let curve = k.store4(combine_lanes(k, &v, *rows));
                let curve = [k.splat4(curve[0]), k.splat4(curve[1]), k.splat4(curve[2]), k.splat4(curve[3])];
                let bases = bases.as_ref();
                let row = out.run_mut(axis, [i0, j0 + j], LANES * bases.len());
                for (out, u) in row.as_chunks_mut::<LANES>().0.iter_mut().zip(bases) {
                    *out = k.store4(combine_curve(k, u, curve));
                }
            }
        }
    }
}

/// Four points of a curve, one coordinate of each; `curve` is that of its control points.
#[inline(always)]
fn combine_curve<K: Kernel>(k: K, u: &Basis, curve: [K::D; 4]) -> K::D {
    let product = [
        k.mul4(curve[0], k.load4(&u[0])),
        k.mul4(curve[1], k.load4(&u[1])),
        k.mul4(curve[2], k.load4(&u[2])),
        k.mul4(curve[3], k.load4(&u[3])),
    ];
    k.add4(k.add4(k.add4(product[0], product[1]), product[2]), product[3])
}

/// Weights of four control points for each of four Bézier points.
pub(super) type BezierWeights = [[f64; 4]; 4];

/// Weights that turn four B-spline points into the four Bézier points of the part [a, b] of their segment: its blossom
/// at (a,a,a), (a,a,b), (a,b,b), (b,b,b) (Ramshaw 1989).
pub(super) fn bezier_weights([a, b]: [f64; 2]) -> BezierWeights {
    [blossom(a, a, a), blossom(a, a, b), blossom(a, b, b), blossom(b, b, b)]
}

#[inline(always)]
fn blossom(x: f64, y: f64, z: f64) -> [f64; 4] {
    let (third, half) = (1.0 / 3.0, 0.5);
    let q = [
        [(1.0 - x) * third, (x + 2.0) * third],
        [(2.0 - x) * third, (x + 1.0) * third],
        [(3.0 - x) * third, x * third],
    ];
    let r = [[(1.0 - y) * half, (y + 1.0) * half], [(2.0 - y) * half, y * half]];
    // Two levels of de Boor's triangle, from the top: weights of two, three and four points.
    let s = [1.0 - z, z];
    let t = [s[0] * r[0][0], s[0] * r[0][1] + s[1] * r[1][0], s[1] * r[1][1]];
    [t[0] * q[0][0], t[0] * q[0][1] + t[1] * q[1][0], t[1] * q[1][1] + t[2] * q[2][0], t[2] * q[2][1]]
}

/// The box around the 16 Bézier points of a part of a regular patch, which holds that part: [low, high].
pub(super) struct Hull<'a> {
    pub control: &'a ControlPoints,
    pub u: &'a BezierWeights,
    pub v: &'a BezierWeights,
}

impl Task for Hull<'_> {
    type Output = [Point; 2];
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> [Point; 2] {
        let (mut low, mut high) = (k.splat4(f64::INFINITY), k.splat4(f64::NEG_INFINITY));
        for v in self.v {
            let row = column_lanes(k, self.control, v);
            for u in self.u {
                let p = combine_lanes(k, u, row);
                (low, high) = (k.min4(low, p), k.max4(high, p));
            }
        }
        [Point(k.store4(low)), Point(k.store4(high))]
    }
}

/// [`Hull`] of a whole patch, whose weights are multiples of a sixth.
pub(super) struct WholeHull<'a> {
    pub control: &'a ControlPoints,
}

/// Six times the Bézier points of a segment.
#[inline(always)]
pub(super) fn bezier_points<K: Kernel>(k: K, c: [K::D; 4]) -> [K::D; 4] {
    let (twice_1, twice_2) = (k.add4(c[1], c[1]), k.add4(c[2], c[2]));
    let (inner_1, inner_2) = (k.add4(twice_1, c[2]), k.add4(c[1], twice_2));
    [
        k.add4(k.add4(c[0], twice_1), inner_1),
        k.add4(inner_1, inner_1),
        k.add4(inner_2, inner_2),
        k.add4(inner_2, k.add4(twice_2, c[3])),
    ]
}

/// As [`bezier_points`] of two segments side by side: the last one of the first is the first one of the second.
#[inline(always)]
pub(super) fn bezier_points_of_two<K: Kernel>(k: K, c: [K::D; 5]) -> [K::D; 7] {
    let [p0, p1, p2, p3] = bezier_points(k, [c[0], c[1], c[2], c[3]]);
    let [_, p4, p5, p6] = bezier_points(k, [c[1], c[2], c[3], c[4]]);
    [p0, p1, p2, p3, p4, p5, p6]
}

/// The lowest and the highest of 36 times the Bézier points of a patch.
#[inline(always)]
fn whole_hull<K: Kernel>(k: K, c: &[K::D; 16]) -> (K::D, K::D) {
    let mut rows = [[k.splat4(0.0); 4]; 4];
    for i in 0..4 {
        let column = bezier_points(k, [c[i], c[4 + i], c[8 + i], c[12 + i]]);
        for (row, p) in rows.iter_mut().zip(column) {
            row[i] = p;
        }
    }
    let (mut low, mut high) = (k.splat4(f64::INFINITY), k.splat4(f64::NEG_INFINITY));
    for row in rows {
        for p in bezier_points(k, row) {
            (low, high) = (k.min4(low, p), k.max4(high, p));
        }
    }
    (low, high)
}

impl Task for WholeHull<'_> {
    type Output = [Point; 2];
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> [Point; 2] {
        let mut control = [k.splat4(0.0); 16];
        for (lanes, point) in control.iter_mut().zip(self.control) {
            *lanes = k.load4(&point.0);
        }
        let (low, high) = whole_hull(k, &control);
        let scale = k.splat4(1.0 / 36.0);
        [Point(k.store4(k.mul4(low, scale))), Point(k.store4(k.mul4(high, scale)))]
    }
}

/// Parts along a side that [`GridHulls`] has at most.
pub(super) const MOST_PARTS: usize = 4;

/// How far `SIDE` x `SIDE` equal parts (2 or 4 a side) of a rectangle of a regular patch reach: each part's Bézier
/// points, with heights across its corners. Those of the rectangle are halved, so that parts share what they have in
/// common.
pub(super) struct GridHulls<'a, const SIDE: usize> {
    pub control: &'a ControlPoints,
    /// Of the rectangle.
    pub u: &'a BezierWeights,
    pub v: &'a BezierWeights,
    /// Part (a, b) at `MOST_PARTS * b + a`.
    pub out: &'a mut [PartExtent],
}

/// How far the quarters of a patch reach together: low, high. Heights are those of the control points.
pub(super) struct QuarterHulls<'a> {
    pub control: &'a ControlPoints,
    /// Of the whole patch.
    pub u: &'a BezierWeights,
    pub v: &'a BezierWeights,
}

/// The Bézier points of `SIDE` equal parts of a segment, from its B-spline points.
#[inline(always)]
fn split_points<K: Kernel, const SIDE: usize>(k: K, weights: &BezierWeights, c: [K::D; 4]) -> [[K::D; 4]; SIDE] {
    let whole = [
        combine_lanes(k, &weights[0], c),
        combine_lanes(k, &weights[1], c),
        combine_lanes(k, &weights[2], c),
        combine_lanes(k, &weights[3], c),
    ];
    let [low, high] = halves(k, whole);
    let mut out = [high; SIDE];
    if SIDE == 2 {
        out[0] = low;
    } else {
        out.copy_from_slice(&quarters(k, low, high));
    }
    out
}

/// The halves of halves.
#[inline(always)]
fn quarters<K: Kernel>(k: K, low: [K::D; 4], high: [K::D; 4]) -> [[K::D; 4]; 4] {
    let ([a, b], [c, d]) = (halves(k, low), halves(k, high));
    [a, b, c, d]
}

/// Both halves of a Bézier curve (de Casteljau).
#[inline(always)]
fn halves<K: Kernel>(k: K, [a, b, c, d]: [K::D; 4]) -> [[K::D; 4]; 2] {
    let (ab, bc, cd) = (middle(k, a, b), middle(k, b, c), middle(k, c, d));
    let (abc, bcd) = (middle(k, ab, bc), middle(k, bc, cd));
    let m = middle(k, abc, bcd);
    [[a, ab, abc, m], [m, bcd, cd, d]]
}

#[inline(always)]
fn middle<K: Kernel>(k: K, a: K::D, b: K::D) -> K::D {
    k.mul4(k.add4(a, b), k.splat4(0.5))
}

/// Columns of Bézier points of `SIDE` parts along v: column i of part b at `[i][b]`.
#[inline(always)]
fn split_columns<K: Kernel, const SIDE: usize>(k: K, v: &BezierWeights, c: &ControlPoints) -> [[[K::D; 4]; SIDE]; 4] {
    let mut columns = [[[k.splat4(0.0); 4]; SIDE]; 4];
    for (i, column) in columns.iter_mut().enumerate() {
        let c = [k.load4(&c[i].0), k.load4(&c[4 + i].0), k.load4(&c[8 + i].0), k.load4(&c[12 + i].0)];
        *column = split_points::<K, SIDE>(k, v, c);
    }
    columns
}

/// Four points in a row, for each of `SIDE` parts.
type Row<K, const SIDE: usize> = [[<K as Kernel>::D; 4]; SIDE];

/// Row `j` of the parts `b` along v.
#[inline(always)]
fn row<K: Kernel, const SIDE: usize>(
    k: K,
    u: &BezierWeights,
    [c0, c1, c2, c3]: &[[[K::D; 4]; SIDE]; 4],
    b: usize,
    j: usize,
) -> Row<K, SIDE> {
    split_points::<K, SIDE>(k, u, [c0[b][j], c1[b][j], c2[b][j], c3[b][j]])
}

/// The least and the greatest of four points, each coordinate by itself.
#[inline(always)]
fn ends_of_row<K: Kernel>(k: K, [p, q, r, s]: [K::D; 4]) -> (K::D, K::D) {
    (k.min4(k.min4(p, q), k.min4(r, s)), k.max4(k.max4(p, q), k.max4(r, s)))
}

/// How far 16 points reach, with heights across their corners.
#[inline(always)]
fn part_extent<K: Kernel>(k: K, rows: [[K::D; 4]; 4]) -> PartExtent {
    let (mut low, mut high) = ends_of_row(k, rows[0]);
    for row in &rows[1..] {
        let (l, h) = ends_of_row(k, *row);
        (low, high) = (k.min4(low, l), k.max4(high, h));
    }
    let mut corners = [DVec3::ZERO; 4];
    for (corner, p) in corners.iter_mut().zip([rows[0][0], rows[0][3], rows[3][3], rows[3][0]]) {
        let [x, y, z, _] = k.store4(p);
        *corner = DVec3::new(x, y, z);
    }
    let normal = Plate::normal_along(across(corners));
    let [a, b, c] = normal;
    let [a, b, c] = [k.splat4(f64::from(a)), k.splat4(f64::from(b)), k.splat4(f64::from(c))];
    let (mut lowest, mut highest) = (k.splat4(f64::INFINITY), k.splat4(f64::NEG_INFINITY));
    for row in rows {
        let [x, y, z, _] = k.transpose4(row);
        let heights = k.add4(k.add4(k.mul4(x, a), k.mul4(y, b)), k.mul4(z, c));
        (lowest, highest) = (k.min4(lowest, heights), k.max4(highest, heights));
    }
    let (mut low, mut high) = (Point(k.store4(low)), Point(k.store4(high)));
    let [p, q, r, s] = k.store4(lowest);
    low.0[3] = p.min(q).min(r.min(s));
    let [p, q, r, s] = k.store4(highest);
    high.0[3] = p.max(q).max(r.max(s));
    PartExtent { extent: Extent { low, high }, normal }
}

impl<const SIDE: usize> Task for GridHulls<'_, SIDE> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let Self { control, u, v, out } = self;
        let columns = split_columns::<K, SIDE>(k, v, control);
        // The last row of one part is the first of the next one.
        let mut first = row(k, u, &columns, 0, 0);
        for b in 0..SIDE {
            let last = row(k, u, &columns, b, 3);
            let (second, third) = (row(k, u, &columns, b, 1), row(k, u, &columns, b, 2));
            for (a, out) in out[MOST_PARTS * b..].iter_mut().take(SIDE).enumerate() {
                *out = part_extent(k, [first[a], second[a], third[a], last[a]]);
            }
            first = last;
        }
    }
}

impl Task for QuarterHulls<'_> {
    type Output = [Point; 2];
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> [Point; 2] {
        let columns = split_columns::<K, 2>(k, self.v, self.control);
        let (mut low, mut high) = (k.splat4(f64::INFINITY), k.splat4(f64::NEG_INFINITY));
        // The last row of the first part is the first of the other.
        for (b, j) in [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3)] {
            let row: Row<K, 2> = row(k, self.u, &columns, b, j);
            for points in row {
                let (l, h) = ends_of_row(k, points);
                (low, high) = (k.min4(low, l), k.max4(high, h));
            }
        }
        [Point(k.store4(low)), Point(k.store4(high))]
    }
}

#[cfg(test)]
mod tests {
    use super::super::extent::with_heights;
    use super::*;
    use crate::math::simd::run;

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
        let (wu, wv) = (bezier_weights([0.25, 0.7]), bezier_weights([0.1, 0.6]));
        for (i, j, u, v) in [(0, 0, 0.25, 0.1), (3, 0, 0.7, 0.1), (0, 3, 0.25, 0.6), (3, 3, 0.7, 0.6)] {
            let difference = combine(&wu[i], columns(&c, &wv[j])) - at(&c, u, v);
            assert!(difference.max_abs() < 1e-14, "corner {i} {j}: {difference:?}");
        }
    }

    #[test]
    fn a_hull_holds_its_part_and_little_more() {
        let c = control_points();
        let (u, v) = ([0.25, 0.7], [0.1, 0.6]);
        let [low, high] = run(Hull { control: &c, u: &bezier_weights(u), v: &bezier_weights(v) });
        let mut tight = [Point([f64::INFINITY; 4]), Point([f64::NEG_INFINITY; 4])];
        for k in 0..=400 {
            let (s, t) = (f64::from(k % 21) / 20.0, f64::from(k / 21).min(20.0) / 20.0);
            let p = at(&c, u[0] + s * (u[1] - u[0]), v[0] + t * (v[1] - v[0]));
            for axis in 0..3 {
                assert!(low.0[axis] <= p.0[axis] + 1e-12 && p.0[axis] <= high.0[axis] + 1e-12);
                tight[0].0[axis] = tight[0].0[axis].min(p.0[axis]);
                tight[1].0[axis] = tight[1].0[axis].max(p.0[axis]);
            }
        }
        for axis in 0..3 {
            let excess = [tight[0].0[axis] - low.0[axis], high.0[axis] - tight[1].0[axis]];
            assert!(excess.iter().all(|e| *e < 0.2), "{axis}: {excess:?}");
        }
    }

    #[test]
    fn the_hull_of_a_whole_patch_is_that_of_its_bezier_points() {
        let c = control_points();
        let whole = bezier_weights([0.0, 1.0]);
        let expected = run(Hull { control: &c, u: &whole, v: &whole });
        let hull = run(WholeHull { control: &c });
        assert!((0..2).all(|k| (hull[k] - expected[k]).max_abs() < 1e-14), "{hull:?} {expected:?}");
    }

    #[test]
    fn a_grid_reaches_as_far_as_its_parts() {
        let c = control_points();
        for (side, u, v) in [(2, [0.5, 0.75], [0.0, 1.0]), (4, [0.0, 1.0], [0.0, 0.5])] {
            let mut out = [PartExtent::EMPTY; MOST_PARTS * MOST_PARTS];
            let (control, of_u, of_v, extents) = (&c, &bezier_weights(u), &bezier_weights(v), &mut out[..]);
            match side {
                2 => run(GridHulls::<2> { control, u: of_u, v: of_v, out: extents }),
                _ => run(GridHulls::<4> { control, u: of_u, v: of_v, out: extents }),
            }
            for (a, b) in (0..side).flat_map(|b| (0..side).map(move |a| (a, b))) {
                let part = |[low, high]: [f64; 2], i: usize| {
                    let step = (high - low) / side as f64;
                    bezier_weights([low + step * i as f64, low + step * (i + 1) as f64])
                };
                let PartExtent { extent: Extent { low, high }, normal } = out[MOST_PARTS * b + a];
                let control = with_heights(&c, normal);
                let expected = run(Hull { control: &control, u: &part(u, a), v: &part(v, b) });
                let far = (low - expected[0]).max_abs().max((high - expected[1]).max_abs());
                assert!(far < 1e-12, "{side} {a} {b}: {low:?} {high:?} {expected:?}");
            }
        }
    }

    #[test]
    fn every_kernel_gives_the_tangents_of_the_plain_sum() {
        let control = &control_points();
        for (u, v) in [(0.0, 0.0), (0.3, 0.7), (1.0, 0.1)] {
            let dv = combine(&basis(u), columns(control, &basis_derivative(v)));
            let du = combine(&basis_derivative(u), columns(control, &basis(v)));
            assert_eq!(run(PointAndTangents { control, u, v }), [at(control, u, v), du, dv]);
        }
    }

    #[test]
    fn every_kernel_gives_the_positions_of_the_plain_sum() {
        let c = control_points();
        let t: Vec<f64> = (0..9).map(|i| f64::from(i) / 8.0).collect();
        let mut out = PointGrid::default();
        out.reset(11, 4);
        let (u, v) = (&t[..], &t[2..5]);
        let [mut of_u, mut of_v] = [BasisCache::default(), BasisCache::default()];
        run(Positions { control: &c, u: of_u.get(u), v: of_v.get(v), out: &mut out, first: [2, 1] });
        for (j, &v) in v.iter().enumerate() {
            for (i, &u) in u.iter().enumerate() {
                assert_eq!(out.point(2 + i, 1 + j), at(&c, u, v).0[..3]);
            }
        }
    }
}
