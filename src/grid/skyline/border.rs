//! The sheet's open edges, and rectangles over which it is a graph.

use super::sheet::{Frame, NearPatch};
use super::view::ROUNDING;
use crate::math::Bounds;
use glam::{DVec2, Vec2, Vec3};

/// A line around what there is of a patch.
struct Side<'a> {
    ends: [[i32; 3]; 2],
    points: &'a [[i32; 3]],
}

impl<'a> Side<'a> {
    fn new(points: &'a [[i32; 3]]) -> Self {
        Self { ends: [points[0], points[points.len() - 1]], points }
    }

    /// Whether two sides are one, run through from opposite ends.
    fn is_joined_to(&self, other: &Self) -> bool {
        self.ends[0] == other.ends[1]
            && self.ends[1] == other.ends[0]
            && self.points.len() == other.points.len()
            && self.points.iter().eq(other.points.iter().rev())
    }
}

/// The lines around patches that are no points, but for those that are joined to exactly one other.
fn open_sides(patches: &[NearPatch]) -> Vec<Side<'_>> {
    let lines = patches.iter().flat_map(|patch| &patch.outline.lines).filter(|points| points.len() > 1);
    let sides: Vec<Side<'_>> = lines.map(|points| Side::new(points)).collect();
    let partners: Vec<Option<usize>> = (0..sides.len()).map(|side| partner(&sides, side)).collect();
    let is_open = |number: usize| partners[number].is_none_or(|partner| partners[partner] != Some(number));
    sides.into_iter().enumerate().filter_map(|(number, side)| is_open(number).then_some(side)).collect()
}

/// The only side that is the same as this one.
fn partner(sides: &[Side<'_>], side: usize) -> Option<usize> {
    let mut partners = (0..sides.len()).filter(|other| *other != side && sides[side].is_joined_to(&sides[*other]));
    partners.next().filter(|_| partners.next().is_none())
}

/// Leaves out what is run through as often from one end as from the other, edge by edge: where not all blocks of a
/// patch are there, its lines are not those of the patches beyond.
fn open_lines(sides: &[Side<'_>]) -> Vec<Vec<[i32; 3]>> {
    let mut edges: Vec<Edge> = Vec::new();
    for (line, side) in sides.iter().enumerate() {
        edges.extend(side.points.windows(2).enumerate().map(|(place, ends)| Edge::new(ends, [line, place])));
    }
    edges.sort_unstable_by_key(|edge| (edge.ends, edge.place));
    let mut is_open: Vec<Vec<bool>> = sides.iter().map(|side| vec![true; side.points.len() - 1]).collect();
    for same in edges.chunk_by(|a, b| a.ends == b.ends) {
        let n_back = same.iter().filter(|edge| edge.is_back).count();
        let n_joined = n_back.min(same.len() - n_back);
        for is_back in [false, true] {
            for edge in same.iter().filter(|edge| edge.is_back == is_back).take(n_joined) {
                is_open[edge.place[0]][edge.place[1]] = false;
            }
        }
    }
    let mut lines = Vec::new();
    for (side, is_open) in sides.iter().zip(&is_open) {
        let mut place = 0;
        for run in is_open.chunk_by(|a, b| a == b) {
            if run[0] {
                lines.push(side.points[place..=place + run.len()].to_vec());
            }
            place += run.len();
        }
    }
    lines
}

/// An edge of a line.
struct Edge {
    /// In order.
    ends: [[i32; 3]; 2],
    /// Whether the line runs from the second to the first.
    is_back: bool,
    /// Which line, and which of its edges.
    place: [usize; 2],
}

impl Edge {
    fn new(ends: &[[i32; 3]], place: [usize; 2]) -> Self {
        let [a, b] = [ends[0], ends[1]];
        Self { ends: [a.min(b), a.max(b)], is_back: b < a, place }
    }
}

/// The open sides of the sheet.
pub(super) struct Border {
    sides: Vec<OpenSide>,
}

struct OpenSide {
    /// Around the places.
    low: DVec2,
    high: DVec2,
    places: Vec<DVec2>,
}

impl OpenSide {
    fn new(places: Vec<DVec2>) -> Self {
        let low = places.iter().copied().reduce(DVec2::min).unwrap_or_default();
        let high = places.iter().copied().reduce(DVec2::max).unwrap_or_default();
        Self { low, high, places }
    }
}

/// How far a place is from a box along x and along y.
fn away(from: DVec2, low: DVec2, high: DVec2) -> DVec2 {
    (low - from).max(from - high).max(DVec2::ZERO)
}

impl Border {
    pub fn of(frame: &Frame, patches: &[NearPatch]) -> Self {
        let placed = |points: &[[i32; 3]]| OpenSide::new(points.iter().map(|p| frame.place(*p)).collect());
        let sides = open_sides(patches);
        let sides = match patches.iter().all(|patch| patch.outline.is_whole) {
            true => sides.iter().map(|side| placed(side.points)).collect(),
            false => open_lines(&sides).iter().map(|line| placed(line)).collect(),
        };
        Self { sides }
    }

    /// A rectangle around that box which no edge enters, and over each of whose points there is one of the sheet; its
    /// least and greatest x and y.
    pub fn clearing(&self, around: &Bounds, widths: Vec3) -> Option<[Vec2; 2]> {
        let middle = around.center().as_dvec3().truncate();
        let widths = widths.as_dvec3().truncate();
        let mut reach = f64::INFINITY;
        let mut windings = 0;
        for side in &self.sides {
            let is_crossed = side.low.y <= middle.y && middle.y <= side.high.y && middle.x <= side.high.x;
            if !is_crossed && (away(middle, side.low, side.high) / widths).max_element() >= reach {
                continue;
            }
            for ends in side.places.windows(2) {
                let [a, b] = [ends[0], ends[1]];
                reach = reach.min((away(middle, a.min(b), a.max(b)) / widths).max_element());
                windings += winding(middle, a, b);
            }
        }
        let reach = reach * (1.0 - f64::from(ROUNDING)) * widths;
        let square = [middle - reach, middle + reach];
        if windings * windings != 1 || !reach.is_finite() || !is_within(around, square.map(DVec2::as_vec2)) {
            return None;
        }
        Some(self.grown(square, f64::from(ROUNDING) * widths).map(DVec2::as_vec2))
    }

    /// The rectangle as far as it may grow, side by side, until an edge is as near as the margin.
    fn grown(&self, [mut low, mut high]: [DVec2; 2], margin: DVec2) -> [DVec2; 2] {
        for axis in 0..2 {
            let across = 1 - axis;
            let (mut below, mut above) = (f64::NEG_INFINITY, f64::INFINITY);
            let is_beside = |a: f64, b: f64| b >= low[across] && a <= high[across];
            for side in self.sides.iter().filter(|side| is_beside(side.low[across], side.high[across])) {
                for ends in side.places.windows(2) {
                    let (least, most) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
                    if is_beside(least[across], most[across]) {
                        match most[axis] < low[axis] {
                            true => below = below.max(most[axis]),
                            false => above = above.min(least[axis]),
                        }
                    }
                }
            }
            (low[axis], high[axis]) = (low[axis].min(below + margin[axis]), high[axis].max(above - margin[axis]));
        }
        [low, high]
    }
}

/// Whether the half-line from a place towards greater x is crossed on the way from a to b, and from which side: 1, -1
/// or 0.
fn winding(from: DVec2, a: DVec2, b: DVec2) -> i32 {
    if (a.y <= from.y) == (b.y <= from.y) || a.x + (from.y - a.y) / (b.y - a.y) * (b.x - a.x) <= from.x {
        return 0;
    }
    if a.y <= from.y { 1 } else { -1 }
}

pub(super) fn is_within(b: &Bounds, [low, high]: [Vec2; 2]) -> bool {
    b.min.x >= low.x && b.min.y >= low.y && b.max.x <= high.x && b.max.y <= high.y
}

pub(super) fn is_apart(b: &Bounds, [low, high]: [Vec2; 2]) -> bool {
    b.max.x < low.x || b.max.y < low.y || b.min.x > high.x || b.min.y > high.y
}

/// What of a box is not within: at each of the four sides.
pub(super) fn beyond(b: &Bounds, [low, high]: [Vec2; 2]) -> impl Iterator<Item = Bounds> {
    let (below, above) = (b.max.min(low.extend(f32::INFINITY)), b.min.max(high.extend(f32::NEG_INFINITY)));
    let sides = [
        Bounds { max: Vec3 { x: below.x, ..b.max }, ..*b },
        Bounds { max: Vec3 { y: below.y, ..b.max }, ..*b },
        Bounds { min: Vec3 { x: above.x, ..b.min }, ..*b },
        Bounds { min: Vec3 { y: above.y, ..b.min }, ..*b },
    ];
    sides.into_iter().filter(|side| side.min.cmple(side.max).all())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::tests::support::Random;

    /// The border of a square of half-width `r`, that many times around.
    fn square(r: f64, times: usize) -> Border {
        let corners = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(x, y)| DVec2::new(x, y));
        let side = |k: usize| OpenSide::new(vec![corners[k % 4], corners[(k + 1) % 4]]);
        Border { sides: (0..4 * times).map(side).collect() }
    }

    #[test]
    fn clearings_lie_within_borders_that_wind_once() {
        let box_at = |x: f32| Bounds { min: Vec3::new(x - 1.0, -1.0, 0.0), max: Vec3::new(x + 1.0, 1.0, 1.0) };
        let clearing = |border: &Border, x: f32| border.clearing(&box_at(x), Vec3::ONE);
        let [low, high] = clearing(&square(4.0, 1), 1.0).expect("room for the box");
        let is_near = |corner: Vec2, to: f32| (corner - to).abs().max_element() < 0.01;
        assert!(low.min_element() > -4.0 && high.max_element() < 4.0, "{low} {high}");
        assert!(is_near(low, -4.0) && is_near(high, 4.0), "as large as may be: {low} {high}");
        // A spike from the left: the clearing grows to the other sides.
        let mut spiked = square(4.0, 1);
        spiked
            .sides
            .push(OpenSide::new([(-4.0, 0.5), (-0.5, 0.0), (-4.0, 0.5)].map(|(x, y)| DVec2::new(x, y)).to_vec()));
        let [low, high] = clearing(&spiked, 1.0).expect("room beside the spike");
        assert!((-0.5..-0.49).contains(&low.x) && is_near(high, 4.0), "{low} {high}");
        assert!(clearing(&square(4.0, 1), 3.5).is_none(), "the border enters the box");
        assert!(clearing(&square(4.0, 1), 6.0).is_none(), "outside");
        assert!(clearing(&square(4.0, 2), 1.0).is_none(), "two of the sheet above each place");
        assert!(clearing(&square(4.0, 0), 1.0).is_none(), "no border");
    }

    #[test]
    fn what_of_a_box_is_beyond_a_rectangle_is_all_there() {
        let mut random = Random(0xbe1);
        let mut n_beyond = 0;
        for _ in 0..500 {
            let mut rectangle = || -> Bounds { (0..2).map(|_| random.point(1.0).as_vec3()).collect() };
            let (b, within) = (rectangle(), rectangle());
            let within = [within.min.truncate(), within.max.truncate()];
            let boxes: Vec<Bounds> = beyond(&b, within).collect();
            for _ in 0..50 {
                let p = b.min + (random.point(0.5) + 0.5).as_vec3() * (b.max - b.min);
                let is_beyond = p.truncate().cmplt(within[0]).any() || p.truncate().cmpgt(within[1]).any();
                let is_there = |b: &Bounds| b.min.cmple(p).all() && p.cmple(b.max).all();
                assert!(!is_beyond || boxes.iter().any(is_there), "{p} of {b:?} beyond {within:?}");
                n_beyond += usize::from(is_beyond);
            }
            assert!(boxes.iter().all(|of| b.union(*of) == b), "no more than the box");
        }
        assert!(n_beyond > 1000);
    }
}
