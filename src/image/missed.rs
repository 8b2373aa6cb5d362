//! Objects that one picture shows and the other does not.
//!
//! A small object that is lost altogether hardly moves a mean, yet it is the worst that sparse sampling can do.
//! [`missed_ids`] is exact but needs id planes; [`missed_objects`] makes do with two pictures.

use super::difference::largest_difference;

/// How far an object has to stand out from its surroundings, in display units (25 of 255 8-bit steps).
const STANDS_OUT: f32 = 0.1;

/// Number of objects of `reference` that are missing in `test`, both display values.
///
/// A candidate is a connected set (8 neighbours) of pixels that differ by more than a tenth between the pictures. It is
/// an object if in the reference its mean colour differs from that of the pixels around it by more than a tenth, and it
/// is missing if in the test its mean colour is nearer to those surroundings than halfway.
/// A border that moved is none: it lies between its two sides in both pictures.
pub fn missed_objects(width: usize, reference: &[[f32; 3]], test: &[[f32; 3]]) -> usize {
    let differs: Vec<_> = reference.iter().zip(test).map(|(a, b)| largest_difference(*a, *b) > STANDS_OUT).collect();
    let mut count = 0;
    for_each_component(
        width,
        reference.len(),
        |p| differs[p],
        |_, _| true,
        |component, ring| {
            count += usize::from(is_missing(component, ring, reference, test));
        },
    );
    count
}

fn is_missing(component: &[usize], ring: &[usize], reference: &[[f32; 3]], test: &[[f32; 3]]) -> bool {
    if ring.is_empty() {
        return false;
    }
    let around = mean(ring, reference);
    let stood_out = largest_difference(mean(component, reference), around);
    stood_out > STANDS_OUT && largest_difference(mean(component, test), around) < 0.5 * stood_out
}

fn mean(places: &[usize], pixels: &[[f32; 3]]) -> [f32; 3] {
    let sum = places.iter().fold([0.0; 3], |sum: [f64; 3], &p| [0, 1, 2].map(|c| sum[c] + f64::from(pixels[p][c])));
    sum.map(|s| (s / places.len() as f64) as f32)
}

/// Number of connected sets (8 neighbours) of pixels with one id in `reference` such that `test` has that id neither
/// there nor next to it. Pixels with id `none` are no object.
pub fn missed_ids(width: usize, reference: &[u32], test: &[u32], none: u32) -> usize {
    let mut count = 0;
    for_each_component(
        width,
        reference.len(),
        |p| reference[p] != none,
        |p, q| reference[p] == reference[q],
        |component, ring| {
            let id = reference[component[0]];
            count += usize::from(!component.iter().chain(ring).any(|&p| test[p] == id));
        },
    );
    count
}

/// Calls `found` with the pixels of each connected set of pixels that satisfy `inside`, neighbours being connected if
/// `same` says so, and with the pixels around the set.
fn for_each_component(
    width: usize,
    n_pixels: usize,
    inside: impl Fn(usize) -> bool,
    same: impl Fn(usize, usize) -> bool,
    mut found: impl FnMut(&[usize], &[usize]),
) {
    let mut seen = vec![false; n_pixels];
    let (mut component, mut ring) = (Vec::new(), Vec::new());
    for start in 0..n_pixels {
        if seen[start] || !inside(start) {
            continue;
        }
        component.clear();
        ring.clear();
        component.push(start);
        seen[start] = true;
        let mut n_visited = 0;
        while n_visited < component.len() {
            let p = component[n_visited];
            n_visited += 1;
            for q in neighbours(p, width, n_pixels) {
                if !(inside(q) && same(p, q)) {
                    ring.push(q);
                } else if !seen[q] {
                    seen[q] = true;
                    component.push(q);
                }
            }
        }
        ring.sort_unstable();
        ring.dedup();
        found(&component, &ring);
    }
}

/// The up to eight pixels around pixel `p`.
fn neighbours(p: usize, width: usize, n_pixels: usize) -> impl Iterator<Item = usize> {
    let (x, y, height) = (p % width, p / width, n_pixels / width);
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    let columns = x.saturating_sub(1)..(x + 2).min(width);
    rows.flat_map(move |y| columns.clone().map(move |x| y * width + x)).filter(move |&q| q != p)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `#` is white, `+` light grey, anything else black; rows of equal length.
    fn picture(rows: &[&str]) -> Vec<[f32; 3]> {
        let value = |c| match c {
            b'#' => [1.0; 3],
            b'+' => [0.8; 3],
            _ => [0.0; 3],
        };
        rows.iter().flat_map(|row| row.bytes().map(value)).collect()
    }

    #[test]
    fn a_dot_and_a_line_that_vanish_are_two_objects() {
        let with = picture(&["#.....", "......", "..####", "......"]);
        let without = picture(&["......"; 4]);
        assert_eq!(missed_objects(6, &with, &without), 2);
        assert_eq!(missed_objects(6, &without, &with), 0, "what the reference lacks is not missed");
        assert_eq!(missed_objects(6, &with, &with), 0);
    }

    #[test]
    fn an_object_that_only_changed_its_shade_is_not_missed() {
        let (bright, dimmer) = (picture(&["......", ".##...", "......"]), picture(&["......", ".++...", "......"]));
        assert_eq!(missed_objects(6, &bright, &dimmer), 0);
    }

    #[test]
    fn a_border_that_moved_is_not_missed() {
        let (before, after) = (picture(&["###..."; 3]), picture(&["##...."; 3]));
        assert_eq!(missed_objects(6, &before, &after), 0);
    }

    #[test]
    fn ids_are_missed_if_they_are_neither_there_nor_beside() {
        let reference = [9, 9, 9, 9, 9, 1, 9, 2, 9, 9, 9, 9];
        let moved = [9, 9, 9, 9, 1, 9, 9, 9, 9, 9, 9, 9];
        assert_eq!(missed_ids(4, &reference, &moved, u32::MAX), 1);
        assert_eq!(missed_ids(4, &reference, &reference, u32::MAX), 0);
        assert_eq!(missed_ids(4, &reference, &[2; 12], 9), 1, "background is no object");
    }
}
