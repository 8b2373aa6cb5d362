//! Pixel groups: connected sets of pixels that show the same item.

use super::item_buffer::ItemBuffer;

/// The group number of pixels that show nothing.
pub const NO_GROUP: u32 = u32::MAX;

/// The groups of a picture, numbered in the order of their first pixels.
pub struct PixelGroups {
    /// Group of each pixel, row by row.
    of_pixel: Vec<u32>,
    /// Topmost, bottommost, leftmost and rightmost pixel of each group; of several, the first in rows.
    corners: Vec<[u32; 4]>,
}

impl PixelGroups {
    /// Connects neighbours (left, right, above, below) that show the same item, breadth first.
    pub fn new(items: &ItemBuffer) -> Self {
        Self::of_items(items.width(), items.n_pixels(), |pixel| items.item(pixel))
    }

    fn of_items(width: usize, n_pixels: usize, item: impl Fn(usize) -> Option<u32>) -> Self {
        let mut groups = Self { of_pixel: vec![NO_GROUP; n_pixels], corners: Vec::new() };
        let mut queue = Vec::new();
        for start in 0..n_pixels {
            let Some(wanted) = item(start).filter(|_| groups.of_pixel[start] == NO_GROUP) else { continue };
            let group = groups.corners.len() as u32;
            queue.clear();
            queue.push(start);
            groups.of_pixel[start] = group;
            let mut n_visited = 0;
            while n_visited < queue.len() {
                let pixel = queue[n_visited];
                n_visited += 1;
                for neighbour in neighbours(pixel, width, n_pixels) {
                    if groups.of_pixel[neighbour] == NO_GROUP && item(neighbour) == Some(wanted) {
                        groups.of_pixel[neighbour] = group;
                        queue.push(neighbour);
                    }
                }
            }
            groups.corners.push(corners(&queue, width));
        }
        groups
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether nothing is seen.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The group of each pixel, or [`NO_GROUP`].
    pub fn of_pixels(&self) -> &[u32] {
        &self.of_pixel
    }

    /// The corner pixels of each group: top, bottom, left, right.
    pub fn corners(&self) -> &[[u32; 4]] {
        &self.corners
    }
}

fn neighbours(pixel: usize, width: usize, n_pixels: usize) -> impl Iterator<Item = usize> {
    let x = pixel % width;
    let left = (x > 0).then(|| pixel - 1);
    let right = (x + 1 < width).then_some(pixel + 1);
    let above = pixel.checked_sub(width);
    let below = Some(pixel + width).filter(|&p| p < n_pixels);
    [above, left, right, below].into_iter().flatten()
}

fn corners(pixels: &[usize], width: usize) -> [u32; 4] {
    let (column, row) = (|p: usize| p % width, |p: usize| p / width);
    let best = |key: &dyn Fn(usize) -> (usize, usize)| {
        let best = pixels.iter().copied().min_by_key(|&p| key(p));
        best.expect("a group has a pixel") as u32
    };
    [
        best(&|p| (row(p), column(p))),
        best(&|p| (usize::MAX - row(p), column(p))),
        best(&|p| (column(p), row(p))),
        best(&|p| (usize::MAX - column(p), row(p))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(rows: &[&str]) -> PixelGroups {
        let text: Vec<u8> = rows.iter().flat_map(|row| row.bytes()).collect();
        let item = |p: usize| (text[p] != b'.').then_some(u32::from(text[p]));
        PixelGroups::of_items(rows[0].len(), text.len(), item)
    }

    #[test]
    fn equal_items_that_only_touch_at_a_corner_are_two_groups() {
        let groups = groups(&["aa..", "..a.", ".bb."]);
        let none = NO_GROUP;
        assert_eq!(groups.of_pixels(), [0, 0, none, none, none, none, 1, none, none, 2, 2, none]);
    }

    #[test]
    fn corners_are_the_outermost_pixels() {
        let groups = groups(&["..a..", ".aaa.", "aaaaa", "..a.."]);
        assert_eq!((groups.len(), groups.corners()[0]), (1, [2, 17, 10, 14]));
    }
}
