//! Lattice vertices of a rectangle of cells, as dicing leaves them and pieces are written from them.

use super::simd::{self, Kernel, Task};

/// Integers that can be read from the start of any row, whatever its length.
pub const WINDOW: usize = 12;

/// Lattice vertices in rows, one list for each axis. After the last column of a row its vertex is repeated, once at least,
/// up to a multiple of four.
#[derive(Clone, Debug, Default)]
pub struct LatticeGrid {
    columns: usize,
    rows: usize,
    stride: usize,
    /// `WINDOW` more than `rows * stride` integers each.
    axes: [Vec<i32>; 3],
    /// For each four vertices, which of them lie within the guard of a rounding boundary.
    near: Vec<u8>,
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
        self.stride = (columns + 1).next_multiple_of(4);
        let n = rows * self.stride + WINDOW;
        for axis in &mut self.axes {
            axis.resize(n, 0);
        }
        self.near.resize(rows * self.stride / 4, 0);
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
        let end = if i + 1 == self.columns { (j + 1) * self.stride } else { at + 1 };
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

    /// Takes points, i fastest, `columns` to a row, and rounds them to whole numbers.
    pub fn round<P: AsRef<[f64; 4]>>(&mut self, points: &[P], columns: usize, rounding: Rounding) {
        self.reset(columns, points.len() / columns);
        simd::run(Round { points, rounding, grid: self });
    }

    /// Whether vertex (i, j) was within the guard of a rounding boundary.
    #[inline(always)]
    pub fn is_near(&self, i: usize, j: usize) -> bool {
        let at = j * self.stride + i;
        self.near[at / 4] >> (at % 4) & 1 == 1
    }
}

/// How coordinates become whole numbers: to the nearest one of `x + shift`.
#[derive(Clone, Copy, Debug)]
pub struct Rounding {
    /// Added before.
    pub shift: f64,
    /// A vertex with a coordinate this near to a rounding boundary is told by [`LatticeGrid::is_near`].
    pub guard: f64,
}

struct Round<'a, P> {
    points: &'a [P],
    rounding: Rounding,
    grid: &'a mut LatticeGrid,
}

impl<P: AsRef<[f64; 4]>> Task for Round<'_, P> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let LatticeGrid { columns, stride, axes, near, .. } = self.grid;
        let Rounding { shift, guard } = self.rounding;
        let (shift, low, high) = (k.splat4(shift + 0.5), k.splat4(guard), k.splat4(1.0 - guard));
        let last = *columns - 1;
        for (j, row) in self.points.chunks_exact(*columns).enumerate() {
            for i in (0..*stride).step_by(4) {
                let [mut a, mut b, mut c, mut d] = [k.splat4(0.0); 4];
                let mut mask = 0;
                for (lane, out) in [&mut a, &mut b, &mut c, &mut d].into_iter().enumerate() {
                    let shifted = k.add4(k.load4(row[(i + lane).min(last)].as_ref()), shift);
                    *out = k.floor4(shifted);
                    let fraction = k.sub4(shifted, *out);
                    let is_near = (k.lt4(fraction, low) | k.lt4(high, fraction)) & 0b111;
                    mask |= u8::from(is_near != 0) << lane;
                }
                let at = j * *stride + i;
                near[at / 4] = mask;
                for (axis, four) in axes.iter_mut().zip(k.transposed_integers([a, b, c, d])) {
                    axis[at..at + 4].copy_from_slice(&four);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Point([f64; 4]);

    impl AsRef<[f64; 4]> for Point {
        fn as_ref(&self) -> &[f64; 4] {
            &self.0
        }
    }

    #[test]
    fn points_round_to_the_nearest_and_tell_when_they_are_near_a_boundary() {
        for columns in 1..=9 {
            let point = |k: usize| Point([k as f64 * 1.37 - 9.0, 0.25 + 1e-9 * (k % 2) as f64, -0.1, 0.0]);
            let points: Vec<Point> = (0..columns * 3).map(point).collect();
            let mut grid = LatticeGrid::default();
            grid.round(&points, columns, Rounding { shift: 0.25, guard: 1e-6 });
            for (k, p) in points.iter().enumerate() {
                let (i, j) = (k % columns, k / columns);
                let rounded = p.0.map(|x| (x + 0.75).floor() as i32);
                assert_eq!(grid.point(i, j), rounded[..3]);
                assert!(grid.is_near(i, j), "y lies on a boundary");
                assert_eq!(grid.window(0, j)[columns], grid.point(columns - 1, j)[0], "the last one is repeated");
            }
            assert_eq!(grid.points().count(), points.len());
        }
    }

    #[test]
    fn what_is_set_comes_back() {
        let points: Vec<[i32; 3]> = (0..12).map(|k| [k, -k, 7 * k]).collect();
        let grid = LatticeGrid::from_points(&points, 4);
        assert_eq!(grid.size(), [4, 3]);
        assert_eq!(grid.points().collect::<Vec<_>>(), points);
    }
}
