//! Points of a rectangle of cells before they are rounded: a list for each coordinate, so that four points are one
//! register.

/// Lanes that are written at a time, so that as many less one behind a row may be overwritten.
pub const LANES: usize = 4;

/// Points in rows, one list for each axis. Behind the last column there is room for whatever lanes hold besides points.
#[derive(Clone, Debug, Default)]
pub struct PointGrid {
    columns: usize,
    rows: usize,
    stride: usize,
    /// x of all rows, then y, then z.
    axes: Vec<f64>,
}

impl PointGrid {
    /// Makes room for so many columns and rows, their points undefined.
    pub fn reset(&mut self, columns: usize, rows: usize) {
        self.columns = columns;
        self.rows = rows;
        self.stride = row_stride(columns);
        self.axes.resize(3 * rows * self.stride, 0.0);
    }

    /// Columns and rows.
    #[inline(always)]
    pub fn size(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// Numbers from one row to the next.
    #[inline(always)]
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The coordinates `axis` of all rows.
    #[inline(always)]
    pub fn axis(&self, axis: usize) -> &[f64] {
        let n = self.rows * self.stride;
        &self.axes[axis * n..][..n]
    }

    /// `n` coordinates `axis` from point (i, j) on, of which those beyond the row are not points.
    #[inline(always)]
    pub fn run_mut(&mut self, axis: usize, [i, j]: [usize; 2], n: usize) -> &mut [f64] {
        &mut self.axes[(axis * self.rows + j) * self.stride + i..][..n]
    }

    /// Point (i, j).
    pub fn point(&self, i: usize, j: usize) -> [f64; 3] {
        std::array::from_fn(|axis| self.axis(axis)[j * self.stride + i])
    }

    /// Replaces point (i, j).
    pub fn set(&mut self, i: usize, j: usize, p: [f64; 3]) {
        for (axis, x) in p.into_iter().enumerate() {
            self.run_mut(axis, [i, j], 1)[0] = x;
        }
    }
}

/// The stride of rows with so many columns: a multiple of [`LANES`] that leaves room for all but one of them.
#[inline(always)]
pub fn row_stride(columns: usize) -> usize {
    (columns + LANES - 1).next_multiple_of(LANES)
}
