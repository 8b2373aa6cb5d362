//! From what faces are numbered by in turn, half-edges or patches, to the face and back: in a quarter of a byte each,
//! and half a byte a face, for mixed polygons, and none for quads.

/// Of so many faces where the first one starts is written down.
const FACES_PER_MARK: u32 = 8;

/// Where each face's half-edges start, or its patches.
#[derive(Debug)]
pub enum FaceIndex {
    /// Every face has four corners.
    Quads {
        /// Number of faces.
        n_faces: u32,
    },
    /// Faces of any size.
    Mixed {
        /// Number of faces.
        n_faces: u32,
        /// Number of half-edges.
        n_things: u32,
        /// First half-edge of every eighth face.
        marks: Vec<u32>,
        /// A bit per half-edge, set where a face starts, and one more at the end.
        is_start: Vec<u64>,
        /// Number of set bits before each word of `is_start`.
        rank: Vec<u32>,
    },
}

impl FaceIndex {
    /// An index for faces of the given sizes.
    pub fn new(sizes: &[u32]) -> Self {
        if sizes.iter().all(|&n| n == 4) {
            return FaceIndex::Quads { n_faces: sizes.len() as u32 };
        }
        Self::mixed(sizes.iter().copied())
    }

    /// An index for faces that have as many things each, at least one, and fewer than 2^32 together.
    pub fn mixed(sizes: impl ExactSizeIterator<Item = u32>) -> Self {
        let (n_faces, mut marks) = (sizes.len() as u32, Vec::new());
        let (mut is_start, mut total) = (vec![1u64], 0);
        for (face, n) in (0..n_faces).zip(sizes) {
            if face % FACES_PER_MARK == 0 {
                marks.push(total);
            }
            total += n;
            is_start.resize(total as usize / 64 + 1, 0);
            is_start[total as usize / 64] |= 1 << (total % 64);
        }
        is_start.shrink_to_fit();
        let mut before = 0;
        let rank = is_start
            .iter()
            .map(|w| {
                before += w.count_ones();
                before - w.count_ones()
            })
            .collect();
        FaceIndex::Mixed { n_faces, n_things: total, marks, is_start, rank }
    }

    /// Number of faces.
    pub fn n_faces(&self) -> usize {
        match self {
            FaceIndex::Quads { n_faces } | FaceIndex::Mixed { n_faces, .. } => *n_faces as usize,
        }
    }

    /// Number of half-edges or patches.
    pub fn n_things(&self) -> usize {
        match self {
            FaceIndex::Quads { n_faces } => 4 * *n_faces as usize,
            FaceIndex::Mixed { n_things, .. } => *n_things as usize,
        }
    }

    /// The face that half-edge (or patch) `h` belongs to.
    #[inline]
    pub fn face(&self, h: u32) -> u32 {
        match self {
            FaceIndex::Quads { .. } => h / 4,
            FaceIndex::Mixed { is_start, rank, .. } => {
                let (word, bit) = (h as usize / 64, h % 64);
                rank[word] + (is_start[word] & (u64::MAX >> (63 - bit))).count_ones() - 1
            }
        }
    }

    /// Which of its face's half-edges (or patches) `h` is.
    #[inline(always)]
    pub fn place(&self, h: u32) -> u32 {
        match self {
            FaceIndex::Quads { .. } => h % 4,
            FaceIndex::Mixed { is_start, .. } => h - Self::first(is_start, h),
        }
    }

    /// The half-edge that is first of those of the face of `h`.
    #[inline(always)]
    fn first(is_start: &[u64], h: u32) -> u32 {
        let mut word = h as usize / 64;
        let mut starts = is_start[word] & (u64::MAX >> (63 - h % 64));
        while starts == 0 {
            word -= 1;
            starts = is_start[word];
        }
        64 * word as u32 + 63 - starts.leading_zeros()
    }

    /// Where the first face starts that does not start before `h`.
    #[inline(always)]
    fn start_from(is_start: &[u64], h: u32) -> u32 {
        let mut word = h as usize / 64;
        let mut starts = is_start[word] & (u64::MAX << (h % 64));
        while starts == 0 {
            word += 1;
            starts = is_start[word];
        }
        64 * word as u32 + starts.trailing_zeros()
    }

    /// Where the face starts that comes so many faces after the one that starts at `h`.
    #[inline(always)]
    fn start_after(is_start: &[u64], h: u32, mut n_faces: u32) -> u32 {
        let mut word = h as usize / 64;
        let mut starts = is_start[word] & (u64::MAX << (h % 64));
        while starts.count_ones() <= n_faces {
            n_faces -= starts.count_ones();
            word += 1;
            starts = is_start[word];
        }
        (0..n_faces).for_each(|_| starts &= starts - 1);
        64 * word as u32 + starts.trailing_zeros()
    }

    #[inline(always)]
    fn starts(is_start: &[u64], h: u32) -> bool {
        (is_start[h as usize / 64] >> (h % 64)) & 1 == 1
    }

    /// The half-edge after `h` in its face.
    #[inline(always)]
    pub fn next(&self, h: u32) -> u32 {
        match self {
            FaceIndex::Quads { .. } => h & !3 | (h + 1) & 3,
            FaceIndex::Mixed { is_start, .. } if Self::starts(is_start, h + 1) => Self::first(is_start, h),
            FaceIndex::Mixed { .. } => h + 1,
        }
    }

    /// The half-edge before `h` in its face.
    #[inline(always)]
    pub fn prev(&self, h: u32) -> u32 {
        match self {
            FaceIndex::Quads { .. } => h & !3 | h.wrapping_sub(1) & 3,
            FaceIndex::Mixed { is_start, .. } if Self::starts(is_start, h) => Self::start_from(is_start, h + 1) - 1,
            FaceIndex::Mixed { .. } => h - 1,
        }
    }

    /// First half-edge of the face of `h`, and their number.
    #[inline(always)]
    pub fn corners_at(&self, h: u32) -> (u32, u32) {
        match self {
            FaceIndex::Quads { .. } => (h & !3, 4),
            FaceIndex::Mixed { is_start, .. } => {
                let first = Self::first(is_start, h);
                (first, Self::start_from(is_start, h + 1) - first)
            }
        }
    }

    /// First half-edge (or patch) and number of them of a face.
    #[inline]
    pub fn corners(&self, face: u32) -> (u32, u32) {
        match self {
            FaceIndex::Quads { .. } => (4 * face, 4),
            FaceIndex::Mixed { marks, is_start, .. } => {
                let mark = marks[(face / FACES_PER_MARK) as usize];
                let first = Self::start_after(is_start, mark, face % FACES_PER_MARK);
                (first, Self::start_from(is_start, first + 1) - first)
            }
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match self {
            FaceIndex::Quads { .. } => 0,
            FaceIndex::Mixed { marks, is_start, rank, .. } => 4 * marks.len() + 8 * is_start.len() + 4 * rank.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_and_corners_invert_each_other() {
        let mixed: Vec<u32> = (0..500).map(|i| if i % 5 == 0 { 4 } else { 3 + (i * 7) % 290 }).collect();
        [mixed, vec![4; 100], vec![64; 5]].iter().for_each(|sizes| check(sizes));
    }

    fn check(sizes: &[u32]) {
        let index = FaceIndex::new(sizes);
        for f in 0..sizes.len() as u32 {
            let (start, n) = index.corners(f);
            assert_eq!(n, sizes[f as usize]);
            for h in start..start + n {
                assert_eq!((index.face(h), index.corners_at(h)), (f, (start, n)));
                assert_eq!(index.next(h), start + (h - start + 1) % n);
                assert_eq!(index.prev(index.next(h)), h);
            }
        }
    }
}
