//! Following edges from where they are seen into the groups around.
//!
//! Shadows and mirror images may end between the probes of a cell that holds. But what reaches into such a cell from
//! outside is seen there, in pixels that are traced. An interpolated pixel is **surprised** by one beside it that was
//! traced and is not as the interpolation, continued by a pixel, would have it. It is traced then, and if it turns out
//! to **contradict** its interpolation, so are all those around it, two deep, and so on: an edge is followed, pixel by
//! pixel, to its end.
//!
//! # Invariants
//! 1. Which pixels are traced does not depend on the order they are looked at in: a pixel is if it was surprised, which
//!    is decided before any is followed, or lies close to one that contradicts.

use super::cells::TILE_SIDE;
use super::tiles::PixelRect;
use crate::image::display::display_value;
use glam::Vec3;

/// Steps to the pixels beside one.
const AROUND: [[i32; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// How a pixel got its colour, as far as edges are concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    Interpolated,
    /// Traced for itself alone.
    Traced,
    /// Background, or a probe that its cell agrees with.
    Other,
}

/// A pixel that may surprise another.
#[derive(Clone, Copy)]
pub(super) struct Look {
    pub origin: Origin,
    /// Linear radiance.
    pub color: Vec3,
    /// What lies on different meshes surprises nobody.
    pub mesh: u32,
}

/// Whether what lies one of the steps that `counts` from an interpolated pixel is not as that and the one behind let
/// expect.
pub(super) fn is_surprised(
    pixel: [u32; 2],
    tolerance: f32,
    counts: impl Fn([u32; 2]) -> bool,
    look: impl Fn([u32; 2]) -> Option<Look>,
) -> bool {
    let Some(here) = look(pixel).filter(|here| here.origin == Origin::Interpolated) else { return false };
    let shown_here = Shown::new(here.color).0;
    AROUND.into_iter().any(|[dx, dy]| {
        let beside = neighbour(pixel, [dx, dy]).filter(|&beside| counts(beside)).and_then(&look);
        let Some(beside) = beside.filter(|b| b.origin == Origin::Traced && b.mesh == here.mesh) else { return false };
        let behind = neighbour(pixel, [-dx, -dy]).and_then(&look);
        let behind = behind.filter(|behind| behind.origin == Origin::Interpolated);
        let shown_behind = behind.map_or(shown_here, |behind| Shown::new(behind.color).0);
        largest(2.0 * shown_here - shown_behind - Shown::new(beside.color).0) > tolerance
    })
}

/// Interpolated pixels of a tile beside a traced one: all that can be surprised. `origins` are those of its pixels, row
/// by row.
pub(super) fn beside_traced(tile: PixelRect, origins: impl Iterator<Item = Origin>) -> impl Iterator<Item = [u32; 2]> {
    let mut traced = [0u128; TILE_SIDE as usize + 2];
    let mut interpolated = [0u128; TILE_SIDE as usize];
    for ([x, y], origin) in tile.pixels().zip(origins) {
        let (row, bit) = ((y - tile.y0) as usize, 1 << (x - tile.x0 + 1));
        match origin {
            Origin::Interpolated => interpolated[row] |= bit,
            Origin::Traced => traced[row + 1] |= bit,
            Origin::Other => {}
        }
    }
    let is_beside = move |[x, y]: &[u32; 2]| {
        let (row, column) = ((y - tile.y0) as usize, x - tile.x0);
        let around = traced[row] | traced[row + 1] | traced[row + 2];
        interpolated[row] >> (column + 1) & 1 != 0 && around >> column & 7 != 0
    };
    tile.pixels().filter(is_beside)
}

/// Goes on from each of the `waiting` pixels, up to `reach` pixels from one that contradicts. `trace` traces one if it
/// is not traced yet, and then says whether it contradicts.
pub(super) fn follow(area: PixelRect, reach: i32, mut waiting: Vec<[u32; 2]>, mut trace: impl FnMut([u32; 2]) -> bool) {
    while let Some(pixel) = waiting.pop() {
        if trace(pixel) {
            waiting.extend(around(area, pixel, reach));
        }
    }
}

/// The pixels of an area up to `reach` from one, and that one.
pub(super) fn around(area: PixelRect, pixel: [u32; 2], reach: i32) -> impl Iterator<Item = [u32; 2]> {
    let side = 2 * reach + 1;
    let steps = (0..side * side).map(move |k| [k % side - reach, k / side - reach]);
    steps.filter_map(move |step| neighbour(pixel, step)).filter(move |&pixel| area.idx(pixel).is_some())
}

fn neighbour([x, y]: [u32; 2], [dx, dy]: [i32; 2]) -> Option<[u32; 2]> {
    Some([x.checked_add_signed(dx)?, y.checked_add_signed(dy)?])
}

/// A colour in display units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown(Vec3);

impl Shown {
    /// What a linear radiance looks like.
    pub fn new(radiance: Vec3) -> Self {
        Self(Vec3::from(radiance.to_array().map(display_value)))
    }

    /// The largest difference of a channel, in display units.
    pub fn difference(self, other: Self) -> f32 {
        largest(self.0 - other.0)
    }
}

/// The largest difference between two radiances, in display units.
pub(super) fn display_difference(a: Vec3, b: Vec3) -> f32 {
    Shown::new(a).difference(Shown::new(b))
}

fn largest(difference: Vec3) -> f32 {
    difference.abs().max_element()
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: PixelRect = PixelRect { x0: 10, y0: 20, x1: 20, y1: 26 };

    /// Pixels of `AREA`: `#` is white where traced and black where interpolated, letters were traced before.
    const PICTURE: [&str; 6] = ["..........", "TTT.......", "WWW##.....", "TTT..##...", "....#....#", ".........#"];

    fn at([x, y]: [u32; 2]) -> u8 {
        PICTURE[(y - AREA.y0) as usize].as_bytes()[(x - AREA.x0) as usize]
    }

    fn look(pixel: [u32; 2]) -> Option<Look> {
        AREA.idx(pixel)?;
        let origin = if b"TW".contains(&at(pixel)) { Origin::Traced } else { Origin::Interpolated };
        let color = Vec3::splat(if at(pixel) == b'W' { 1.0 } else { 0.0 });
        Some(Look { origin, color, mesh: 0 })
    }

    #[test]
    fn a_line_is_followed_to_its_end_and_what_it_does_not_reach_is_left() {
        let surprised: Vec<_> = AREA.pixels().filter(|&pixel| is_surprised(pixel, 0.1, |_| true, look)).collect();
        assert_eq!(surprised, [[13, 21], [13, 22], [13, 23]]);
        let mut traced = Vec::new();
        follow(AREA, 2, surprised, |pixel| {
            let is_new = at(pixel) != b'W' && at(pixel) != b'T' && !traced.contains(&pixel);
            if is_new {
                traced.push(pixel);
            }
            is_new && at(pixel) == b'#'
        });
        let found = |wanted: u8| traced.iter().filter(|&&pixel| at(pixel) == wanted).count();
        assert_eq!((found(b'#'), traced.contains(&[19, 24]), traced.contains(&[19, 20])), (5, false, false));
    }

    #[test]
    fn a_steady_slope_surprises_nobody() {
        let slope = |[x, y]: [u32; 2]| {
            AREA.idx([x, y])?;
            let origin = if x < 13 { Origin::Traced } else { Origin::Interpolated };
            let color = Vec3::splat(0.05 + 0.01 * (x - AREA.x0) as f32);
            Some(Look { origin, color, mesh: 0 })
        };
        assert!(AREA.pixels().all(|pixel| !is_surprised(pixel, 0.02, |_| true, slope)));
    }
}
