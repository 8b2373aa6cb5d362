//! Rows of sparse matrices, packed: what a plan library mostly consists of.
//!
//! Few rows differ in their **weights**, so that each distinct list, a **mask**, is kept once, in f64. Terms are in the
//! order of their weights: then rows that differ in the order of their columns have one mask. A row is a mask and a
//! list of columns; equal rows are kept once, and rows that are used together are a list of their numbers. Columns and
//! numbers take two bytes each as long as there are no more than 65,536 of them; equal lists are kept once, too.

use super::rules::Row;
use rustc_hash::FxHashMap;

/// Rows of a [`RowStore`]: a list of their numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SparseRows {
    first: u32,
    len: u32,
}

impl SparseRows {
    /// Number of rows.
    #[inline(always)]
    pub fn len(self) -> usize {
        self.len as usize
    }

    /// Whether there is no row.
    pub fn is_empty(self) -> bool {
        self.len == 0
    }
}

/// A list of indices in a [`RowStore`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Span {
    first: u32,
    len: u32,
}

impl Span {
    /// Number of indices.
    #[inline(always)]
    pub fn len(self) -> usize {
        self.len as usize
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.len == 0
    }

    /// Its first `n` indices, and the others.
    #[inline(always)]
    pub fn split_at(self, n: u32) -> [Self; 2] {
        debug_assert!(n <= self.len);
        [Self { first: self.first, len: n }, Self { first: self.first + n, len: self.len - n }]
    }
}

/// A row: where its columns and its weights start, and how many there are.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
struct PackedRow {
    columns: u32,
    weights: u32,
    len: u32,
}

/// Column numbers and other indices of points.
#[derive(Clone, Debug)]
enum Indices {
    Narrow(Vec<u16>),
    /// Once a ring has had more points than 16 bits can tell apart.
    Wide(Vec<u32>),
}

/// The rows of all nodes of a library.
#[derive(Clone, Debug)]
pub struct RowStore {
    rows: Vec<PackedRow>,
    weights: Vec<f64>,
    /// Columns of rows, numbers of rows, and what else is listed.
    indices: Indices,
    /// Rows that are there, while others are added.
    known_rows: FxHashMap<PackedRow, u32>,
    /// Where masks start, by the bits of their weights.
    known_masks: FxHashMap<Vec<u64>, u32>,
    /// Where lists of indices start, while they are added.
    known_lists: FxHashMap<Vec<u32>, u32>,
    /// Scratch: a row in the order of its weights, its columns, and the bits of its weights.
    sorted: Row,
    list: Vec<u32>,
    bits: Vec<u64>,
    numbers: Vec<u32>,
}

impl Default for RowStore {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            weights: Vec::new(),
            indices: Indices::Narrow(Vec::new()),
            known_rows: FxHashMap::default(),
            known_masks: FxHashMap::default(),
            known_lists: FxHashMap::default(),
            sorted: Row::new(),
            list: Vec::new(),
            bits: Vec::new(),
            numbers: Vec::new(),
        }
    }
}

/// An index of either width.
pub trait Index: Copy {
    /// For slices.
    fn idx(self) -> usize;
}

impl Index for u8 {
    #[inline(always)]
    fn idx(self) -> usize {
        usize::from(self)
    }
}

impl Index for u16 {
    #[inline(always)]
    fn idx(self) -> usize {
        usize::from(self)
    }
}

impl Index for u32 {
    #[inline(always)]
    fn idx(self) -> usize {
        self as usize
    }
}

impl Indices {
    fn len(&self) -> usize {
        match self {
            Indices::Narrow(indices) => indices.len(),
            Indices::Wide(indices) => indices.len(),
        }
    }

    fn get(&self, i: usize) -> u32 {
        match self {
            Indices::Narrow(indices) => u32::from(indices[i]),
            Indices::Wide(indices) => indices[i],
        }
    }

    fn push(&mut self, index: u32) {
        match (&mut *self, u16::try_from(index)) {
            (Indices::Narrow(indices), Ok(index)) => indices.push(index),
            (Indices::Wide(indices), _) => indices.push(index),
            (Indices::Narrow(indices), Err(_)) => {
                let mut wide: Vec<u32> = indices.iter().map(|&i| u32::from(i)).collect();
                wide.push(index);
                *self = Indices::Wide(wide);
            }
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Indices::Narrow(indices) => 2 * indices.len(),
            Indices::Wide(indices) => 4 * indices.len(),
        }
    }
}

/// Rows and the store that they are in, its indices of a known width: what inner loops take.
#[derive(Clone, Copy)]
pub(super) struct RowsView<'s, I> {
    /// Numbers of the rows.
    list: &'s [I],
    rows: &'s [PackedRow],
    weights: &'s [f64],
    indices: &'s [I],
}

impl<'s, I: Index> RowsView<'s, I> {
    /// Columns and weights of row `i`.
    #[inline(always)]
    pub fn row(&self, i: usize) -> (&'s [I], &'s [f64]) {
        let PackedRow { columns, weights: first, len } = self.rows[self.list[i].idx()];
        let (columns, first, len) = (columns as usize, first as usize, len as usize);
        (&self.indices[columns..columns + len], &self.weights[first..first + len])
    }
}

/// Does something with a [`RowsView`] and the store's indices, of either width.
macro_rules! with_rows {
    ($store:expr, $rows:expr, |$view:ident, $indices:ident| $body:expr) => {
        match $store.widths() {
            $crate::subdiv::rows::Width::Narrow($indices) => {
                let $view = $store.view($rows, $indices);
                $body
            }
            $crate::subdiv::rows::Width::Wide($indices) => {
                let $view = $store.view($rows, $indices);
                $body
            }
        }
    };
}
pub(super) use with_rows;

/// Puts the terms of a row into the order in which they are kept.
pub(super) fn sort_by_weight(row: &mut Row) {
    row.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
}

#[inline(always)]
fn copy_listed<T: Copy, I: Index>(list: &[I], from: &[T], to: &mut [T]) {
    for (to, i) in to.iter_mut().zip(list) {
        *to = from[i.idx()];
    }
}

/// The indices of a store.
pub(super) enum Width<'s> {
    Narrow(&'s [u16]),
    Wide(&'s [u32]),
}

impl RowStore {
    /// Adds rows.
    pub fn push<'a>(&mut self, rows: impl IntoIterator<Item = &'a Row>) -> SparseRows {
        let (mut sorted, mut numbers) = (std::mem::take(&mut self.sorted), std::mem::take(&mut self.numbers));
        numbers.clear();
        for row in rows {
            sorted.clear();
            sorted.extend_from_slice(row);
            sort_by_weight(&mut sorted);
            numbers.push(self.row_number(&sorted));
        }
        let list = self.push_indices(&numbers);
        (self.sorted, self.numbers) = (sorted, numbers);
        SparseRows { first: list.first, len: list.len }
    }

    fn row_number(&mut self, sorted: &Row) -> u32 {
        let columns = self.list_start(sorted.iter().map(|&(column, _)| column));
        let row = PackedRow { columns, weights: self.mask(sorted), len: sorted.len() as u32 };
        let rows = &mut self.rows;
        *self.known_rows.entry(row).or_insert_with(|| {
            rows.push(row);
            rows.len() as u32 - 1
        })
    }

    /// Adds a list of indices.
    pub fn push_indices(&mut self, indices: &[u32]) -> Span {
        Span { first: self.list_start(indices.iter().copied()), len: indices.len() as u32 }
    }

    /// Where a list starts, added if it is new.
    fn list_start(&mut self, list: impl Iterator<Item = u32>) -> u32 {
        self.list.clear();
        self.list.extend(list);
        if let Some(&start) = self.known_lists.get(&self.list) {
            return start;
        }
        let start = self.indices.len() as u32;
        self.list.iter().for_each(|&i| self.indices.push(i));
        self.known_lists.insert(self.list.clone(), start);
        start
    }

    /// Where the weights of a row start.
    fn mask(&mut self, row: &Row) -> u32 {
        self.bits.clear();
        self.bits.extend(row.iter().map(|&(_, w)| w.to_bits()));
        if let Some(&start) = self.known_masks.get(&self.bits) {
            return start;
        }
        let start = self.weights.len() as u32;
        self.weights.extend(row.iter().map(|&(_, w)| w));
        self.known_masks.insert(self.bits.clone(), start);
        start
    }

    /// Row `i` of some rows.
    pub fn row(&self, rows: SparseRows, i: usize) -> Row {
        with_rows!(self, rows, |view, _indices| {
            let (columns, weights) = view.row(i);
            columns.iter().zip(weights).map(|(c, &w)| (c.idx() as u32, w)).collect()
        })
    }

    /// The first column of row `i` of some rows.
    pub fn first_column(&self, rows: SparseRows, i: usize) -> usize {
        with_rows!(self, rows, |view, _indices| view.row(i).0[0].idx())
    }

    /// Index `i` of a list.
    #[inline(always)]
    pub fn index(&self, list: Span, i: usize) -> usize {
        self.indices.get(list.first as usize + i) as usize
    }

    #[inline(always)]
    pub(super) fn widths(&self) -> Width<'_> {
        match &self.indices {
            Indices::Narrow(indices) => Width::Narrow(indices),
            Indices::Wide(indices) => Width::Wide(indices),
        }
    }

    #[inline(always)]
    pub(super) fn view<'s, I>(&'s self, rows: SparseRows, indices: &'s [I]) -> RowsView<'s, I> {
        RowsView {
            list: &indices[rows.first as usize..][..rows.len()],
            rows: &self.rows,
            weights: &self.weights,
            indices,
        }
    }

    /// A list of indices, of which [`widths`](Self::widths) gave the width.
    #[inline(always)]
    pub(super) fn list<'s, I>(&self, list: Span, indices: &'s [I]) -> &'s [I] {
        &indices[list.first as usize..][..list.len()]
    }

    /// Copies the listed ones of `from` to `to`, which is as long as the list.
    #[inline]
    pub(super) fn gather<T: Copy>(&self, list: Span, from: &[T], to: &mut [T]) {
        match self.widths() {
            Width::Narrow(indices) => copy_listed(self.list(list, indices), from, to),
            Width::Wide(indices) => copy_listed(self.list(list, indices), from, to),
        }
    }

    /// Appends the listed ones of `from`.
    #[inline]
    pub(super) fn gather_to<T: Copy>(&self, list: Span, from: &[T], to: &mut Vec<T>) {
        match self.widths() {
            Width::Narrow(indices) => to.extend(self.list(list, indices).iter().map(|i| from[i.idx()])),
            Width::Wide(indices) => to.extend(self.list(list, indices).iter().map(|i| from[i.idx()])),
        }
    }

    /// Drops what only adding needs.
    pub fn seal(&mut self) {
        (self.known_rows, self.known_masks, self.known_lists) = Default::default();
        (self.sorted, self.list, self.bits, self.numbers) = Default::default();
        self.rows.shrink_to_fit();
        self.weights.shrink_to_fit();
        match &mut self.indices {
            Indices::Narrow(indices) => indices.shrink_to_fit(),
            Indices::Wide(indices) => indices.shrink_to_fit(),
        }
    }

    /// Whether numbers of 32 bits might not do for many more.
    pub(super) fn is_nearly_full(&self) -> bool {
        const MANY: usize = 1 << 28;
        self.indices.len().max(self.weights.len()).max(self.rows.len()) + MANY > u32::MAX as usize
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let known_masks: usize = self.known_masks.keys().map(|k| 8 * k.len() + 40).sum();
        let known_lists: usize = self.known_lists.keys().map(|k| 4 * k.len() + 40).sum();
        known_masks
            + known_lists
            + 20 * self.known_rows.capacity()
            + size_of_val(&self.rows[..])
            + size_of_val(&self.weights[..])
            + self.indices.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_as_they_went_in_whatever_their_width() {
        let mut store = RowStore::default();
        let few: Vec<Row> = vec![vec![(3, 0.25), (1, 0.75)], vec![(3, 0.25), (2, 0.75)], vec![]];
        let narrow = store.push(&few);
        store.push([&vec![(1, 0.75), (3, 0.25)]]);
        assert_eq!(store.weights.len(), 2, "equal weights are kept once");
        assert_eq!(store.rows.len(), 3, "equal rows are kept once");
        assert_eq!(store.indices.len(), 4 + 3 + 1, "equal lists are kept once");
        let wide = store.push([&vec![(70_000, 1.5)]]);
        let list = store.push_indices(&[5, 100_000]);
        for (i, row) in few.iter().enumerate() {
            assert_eq!(&store.row(narrow, i), row);
        }
        assert_eq!(store.row(wide, 0), vec![(70_000, 1.5)]);
        assert_eq!([store.index(list, 0), store.index(list, 1)], [5, 100_000]);
    }
}
