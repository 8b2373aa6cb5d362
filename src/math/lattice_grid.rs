//! Lattice vertices of a rectangle of cells, as dicing leaves them and pieces are written from them.

use super::point_grid::{LANES, PointGrid, row_stride};
use super::simd::{self, Kernel, Task};

/// Integers that can be read from the start of any row, whatever its length.
pub const WINDOW: usize = 12;

/// Lattice vertices in rows, one list for each axis. After the last column of a row its vertex is repeated once.
#[derive(Clone, Debug, Default)]
pub struct LatticeGrid {
    columns: usize,
    rows: usize,
    stride: usize,
    /// `WINDOW` more than `rows * stride` integers each.
    axes: [Vec<i32>; 3],
}

impl LatticeGrid {
    /// From vertices, i fastest, `columns` to a row.
    pub fn from_points(points: &[[i32; 3]], columns: usize) -> Self {
        let mut grid = Self::default();
        grid.reset(columns, points.len() / columns);
        for (k, p) in points.iter().enumerate() {
            grid.set(k % columns, k / columns, *p);
        }
        grid
    }

    /// Makes room for so many columns and rows, their vertices undefined.
    fn reset(&mut self, columns: usize, rows: usize) {
        self.columns = columns;
        self.rows = rows;
        self.stride = row_stride(columns);
        let n = rows * self.stride + WINDOW;
        for axis in &mut self.axes {
            axis.resize(n, 0);
        }
    }

    /// Columns and rows.
    #[inline(always)]
    pub fn size(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// Vertex (i, j).
    #[inline]
    pub fn point(&self, i: usize, j: usize) -> [i32; 3] {
        debug_assert!(i < self.columns && j < self.rows);
        let at = j * self.stride + i;
        [self.axes[0][at], self.axes[1][at], self.axes[2][at]]
    }

    /// Replaces vertex (i, j).
    pub fn set(&mut self, i: usize, j: usize, p: [i32; 3]) {
        let at = j * self.stride + i;
        let end = if i + 1 == self.columns { at + 2 } else { at + 1 };
        for (axis, x) in self.axes.iter_mut().zip(p) {
            axis[at..end].fill(x);
        }
    }

    /// All vertices, i fastest.
    pub fn points(&self) -> impl Iterator<Item = [i32; 3]> {
        (0..self.rows).flat_map(move |j| (0..self.columns).map(move |i| self.point(i, j)))
    }

    /// The coordinates `axis` from the start of row `j`: the row, what is repeated, and whatever comes then.
    #[inline(always)]
    pub fn window(&self, axis: usize, j: usize) -> &[i32; WINDOW] {
        self.axes[axis][j * self.stride..].first_chunk().expect("room after the last row")
    }

    /// Takes points and rounds them to whole numbers. Says whether [`Rounding::near`] may find any of them: if not, it
    /// finds none.
    pub fn round(&mut self, points: &PointGrid, rounding: Rounding) -> bool {
        let [columns, rows] = points.size();
        self.reset(columns, rows);
        simd::run(Round { points, rounding, grid: self })
    }
}

/// How coordinates become whole numbers: to the nearest one of `x + shift`, the even one of two.
#[derive(Clone, Copy, Debug)]
pub struct Rounding {
    /// Added before.
    pub shift: f64,
    /// [`Rounding::near`] tells which vertices have a coordinate this near to a rounding boundary.
    pub guard: f64,
}

/// Vertices that [`Rounding::near`] looks at, at most.
pub const MOST_NEAR: usize = 32;

impl Rounding {
    /// Which of `n` (up to [`MOST_NEAR`]) vertices from (i, j) on, along axis 0 or 1 of the grid, have a coordinate
    /// within the guard of a rounding boundary, as bits.
    pub fn near(self, points: &PointGrid, from: [usize; 2], along: usize, n: usize) -> u32 {
        debug_assert!(n <= MOST_NEAR);
        let step = if along == 0 { 1 } else { points.stride() };
        simd::run(Near { points, rounding: self, first: from[1] * points.stride() + from[0], step, n })
    }
}

struct Near<'a> {
    points: &'a PointGrid,
    rounding: Rounding,
    first: usize,
    step: usize,
    n: usize,
}

impl Task for Near<'_> {
    type Output = u32;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> u32 {
        let Self { points, rounding: Rounding { shift, guard }, first, step, n } = self;
        let shift = k.splat4(shift + 0.5);
        let [xs, ys, zs] = [0, 1, 2].map(|axis| &points.axis(axis)[first..]);
        let mut mask = 0;
        for i in (0..n).step_by(LANES) {
            let x = fraction(k, k.add4(four(k, xs, i, n, step), shift));
            let y = fraction(k, k.add4(four(k, ys, i, n, step), shift));
            let z = fraction(k, k.add4(four(k, zs, i, n, step), shift));
            let (least, most) = (k.min4(k.min4(x, y), z), k.max4(k.max4(x, y), z));
            mask |= (k.lt4(least, k.splat4(guard)) | k.lt4(k.splat4(1.0 - guard), most)) << i;
        }
        mask & (u32::MAX >> (MOST_NEAR - n))
    }
}

/// What is above the next lower whole number.
#[inline(always)]
fn fraction<K: Kernel>(k: K, x: K::D) -> K::D {
    k.sub4(x, k.floor4(x))
}

/// Four numbers from the `i`-th on, `step` apart; in place of those from the `n`-th on, the last one, or what comes
/// after it if that can be loaded at once.
#[inline(always)]
fn four<K: Kernel>(k: K, numbers: &[f64], i: usize, n: usize, step: usize) -> K::D {
    if step == 1
        && let Some(four) = numbers[i..].first_chunk()
    {
        return k.load4(four);
    }
    let at = |lane: usize| numbers[(i + lane).min(n - 1) * step];
    k.load4(&[at(0), at(1), at(2), at(3)])
}

struct Round<'a> {
    points: &'a PointGrid,
    rounding: Rounding,
    grid: &'a mut LatticeGrid,
}

/// What one operation errs by at most: coordinates are below 2^25.
const ROUNDING_ERROR: f64 = 1.0 / (1 << 28) as f64;

impl Task for Round<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> bool {
        let LatticeGrid { columns, rows, stride, axes } = self.grid;
        let shift = k.splat4(self.rounding.shift);
        // Of everything there is room for, points or not: nearly always none of it is near a boundary.
        let mut farthest = k.splat4(0.0);
        for (axis, out) in axes.iter_mut().enumerate() {
            let out = &mut out[..*rows * *stride];
            for (out, x) in out.as_chunks_mut::<LANES>().0.iter_mut().zip(self.points.axis(axis).as_chunks().0) {
                let x = k.add4(k.load4(x), shift);
                *out = k.nearest4(x);
                farthest = k.max4(k.abs4(k.sub4(x, k.round4(x))), farthest);
            }
            for row in out.chunks_exact_mut(*stride) {
                row[*columns] = row[*columns - 1];
            }
        }
        k.lt4(k.splat4(0.5 - self.rounding.guard - ROUNDING_ERROR), farthest) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_round_to_the_nearest_and_tell_when_they_are_near_a_boundary() {
        let rounding = Rounding { shift: 0.25, guard: 1e-6 };
        for columns in 1..=9 {
            let point = |k: usize| [k as f64 * 1.37 - 9.0, 0.25 + 1e-9 * (k % 2) as f64, -0.1];
            let mut points = PointGrid::default();
            points.reset(columns, 3);
            (0..columns * 3).for_each(|k| points.set(k % columns, k / columns, point(k)));
            let mut grid = LatticeGrid::default();
            assert!(grid.round(&points, rounding), "y lies on a boundary");
            for k in 0..columns * 3 {
                let (i, j) = (k % columns, k / columns);
                assert_eq!(grid.point(i, j), point(k).map(|x| (x + 0.25).round_ties_even() as i32));
                assert_eq!(grid.window(0, j)[columns], grid.point(columns - 1, j)[0], "the last one is repeated");
            }
            assert_eq!(rounding.near(&points, [0, 1], 0, columns), (1 << columns) - 1, "y lies on a boundary");
            assert_eq!(grid.points().count(), columns * 3);
        }
    }

    #[test]
    fn whatever_is_near_a_boundary_is_told_while_rounding() {
        let rounding = Rounding { shift: 1.0 / 3.0, guard: 1e-6 };
        let mut points = PointGrid::default();
        points.reset(9, 9);
        for (place, whole) in (0..81).flat_map(|place| [-8_000_000.0, -1.0, 0.0, 8_000_000.0].map(|x| (place, x))) {
            for (distance, is_near) in [(0.999e-6, true), (-0.999e-6, true), (1.1e-6, false), (-1.1e-6, false)] {
                (0..81).for_each(|k| points.set(k % 9, k / 9, [0.25, 7.5, -3.25]));
                let mut p = [0.25, 7.5, -3.25];
                p[place % 3] = whole + 0.5 - rounding.shift + distance;
                points.set(place % 9, place / 9, p);
                let mut grid = LatticeGrid::default();
                assert_eq!(grid.round(&points, rounding), is_near, "{place}, {whole}, {distance}");
                assert_eq!(rounding.near(&points, [place % 9, place / 9], 0, 1) == 1, is_near);
            }
        }
    }

    #[test]
    fn single_points_are_told_to_be_near_a_boundary() {
        let rounding = Rounding { shift: 0.25, guard: 1e-6 };
        let mut points = PointGrid::default();
        points.reset(5, 7);
        for k in 0..35 {
            points.set(k % 5, k / 5, [7.0, -3.1, if k.is_multiple_of(3) { 0.25 - 1e-9 } else { 0.3 }]);
        }
        let bits = |at: &dyn Fn(usize) -> usize, n: usize| {
            (0..n).filter(|&k| at(k).is_multiple_of(3)).fold(0, |m, k| m | 1 << k)
        };
        assert_eq!(rounding.near(&points, [1, 2], 0, 4), bits(&|k| 11 + k, 4));
        assert_eq!(rounding.near(&points, [4, 1], 1, 6), bits(&|k| 9 + 5 * k, 6));
    }

    #[test]
    fn what_is_set_comes_back() {
        let points: Vec<[i32; 3]> = (0..12).map(|k| [k, -k, 7 * k]).collect();
        let grid = LatticeGrid::from_points(&points, 4);
        assert_eq!(grid.size(), [4, 3]);
        assert_eq!(grid.points().collect::<Vec<_>>(), points);
    }
}
