//! From what faces are numbered by in turn, half-edges or patches, to the face and back: in a quarter of a byte each for mixed
//! polygons, and none for quads.

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
        /// First half-edge of each face, and the total at the end.
        start: Vec<u32>,
        /// A bit per half-edge, set where a face starts, and at the end.
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
        let mut start = Vec::with_capacity(sizes.len() + 1);
        let mut total = 0;
        for n in sizes {
            start.push(total);
            total += n;
        }
        let mut is_start = vec![0u64; total as usize / 64 + 1];
        for &s in &start {
            is_start[s as usize / 64] |= 1 << (s % 64);
        }
        // One more, for the last face's end.
        is_start[total as usize / 64] |= 1 << (total % 64);
        start.push(total);
        let mut before = 0;
        let rank = is_start
            .iter()
            .map(|w| {
                before += w.count_ones();
                before - w.count_ones()
            })
            .collect();
        FaceIndex::Mixed { start, is_start, rank }
    }

    /// Number of faces.
    pub fn n_faces(&self) -> usize {
        match self {
            FaceIndex::Quads { n_faces } => *n_faces as usize,
            FaceIndex::Mixed { start, .. } => start.len() - 1,
        }
    }

    /// Number of half-edges or patches.
    pub fn n_things(&self) -> usize {
        match self {
            FaceIndex::Quads { n_faces } => 4 * *n_faces as usize,
            FaceIndex::Mixed { start, .. } => start[start.len() - 1] as usize,
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

    /// First half-edge (or patch) and number of them of a face.
    #[inline]
    pub fn corners(&self, face: u32) -> (u32, u32) {
        match self {
            FaceIndex::Quads { .. } => (4 * face, 4),
            FaceIndex::Mixed { start, .. } => {
                let s = start[face as usize];
                (s, start[face as usize + 1] - s)
            }
        }
    }

    /// [`corners`](Self::corners) of the face of `h`: from the bits next to its own, which cost less than the face's number.
    #[inline]
    pub fn corners_at(&self, h: u32) -> (u32, u32) {
        match self {
            FaceIndex::Quads { .. } => (h & !3, 4),
            FaceIndex::Mixed { is_start, .. } => {
                let (word, bit) = (h as usize / 64, h % 64);
                let start = last_bit(is_start, word, is_start[word] & (u64::MAX >> (63 - bit)));
                let end = first_bit(is_start, word, is_start[word] & ((u64::MAX << bit) << 1));
                (start, end - start)
            }
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match self {
            FaceIndex::Quads { .. } => 0,
            FaceIndex::Mixed { start, is_start, rank } => 4 * start.len() + 8 * is_start.len() + 4 * rank.len(),
        }
    }
}

/// The last bit that is set in the words up to `word`, of which only `bits` count.
#[inline(always)]
fn last_bit(words: &[u64], mut word: usize, mut bits: u64) -> u32 {
    while bits == 0 {
        word -= 1;
        bits = words[word];
    }
    64 * word as u32 + 63 - bits.leading_zeros()
}

/// The first bit that is set in the words from `word` on, of which only `bits` count.
#[inline(always)]
fn first_bit(words: &[u64], mut word: usize, mut bits: u64) -> u32 {
    while bits == 0 {
        word += 1;
        bits = words[word];
    }
    64 * word as u32 + bits.trailing_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_and_corners_invert_each_other_for_mixed_sizes() {
        let sizes: Vec<u32> = (0..500).map(|i| 3 + (i * 7) % 90).collect();
        let index = FaceIndex::new(&sizes);
        for f in 0..sizes.len() as u32 {
            let (start, n) = index.corners(f);
            assert_eq!(n, sizes[f as usize]);
            assert!((start..start + n).all(|h| index.face(h) == f && index.corners_at(h) == (start, n)));
        }
    }
}
