//! The view from a patch's parts: what is near, then boxes of all that is far.

use super::octants::{Between, Extent, NOTHING, octant};
use super::sheet::{Frame, LeftPart, NearPatch, SkylineSheet};
use super::{NEVER, PartSkyline, Skyline, UNITS};
use crate::math::Bounds;
use crate::math::simd::{self, Kernel, Task};
use glam::{DVec2, Vec2, Vec3};

/// Roundings of places in the frame, as a share of the patch.
const ROUNDING: f32 = 1.0 / 1024.0;

/// Roundings of lattice points and rays, in steps.
const STEPS: f32 = 4.0;

/// By how much elevations are raised for the roundings of rays, as a share.
const MARGIN: f32 = 1.0 / 256.0;

/// The same in height over way.
const MARGIN_OF_STEEPNESS: f32 = 1.0 / 64.0;

/// The most that is seen of a patch: each of its parts to be left in some directions.
pub struct SkylineView {
    frame: Frame,
    parts: Vec<Part>,
    /// All parts.
    from: Start,
    /// The lowest elevations of all parts.
    lowest: [f32; 8],
}

/// Where rays start.
#[derive(Clone, Copy)]
struct Start {
    extent: Extent,
    /// Heights are counted from there: the least.
    floor: f32,
}

impl Start {
    fn in_box(b: &Bounds) -> Self {
        Self { extent: Extent::around(b), floor: b.min.z }
    }

    /// How high a box stands at most, octant by octant.
    #[inline(always)]
    fn elevations<K: Kernel>(&self, k: K, extent: &Extent) -> K::F {
        Between::of(k, &self.extent, extent).elevations(k, self.floor)
    }
}

/// A part of the patch that may be left.
struct Part {
    number: usize,
    from: Start,
    elevations: [f32; 8],
}

impl SkylineSheet {
    /// The view from the first of the patches, past all of them.
    pub fn view(self) -> SkylineView {
        let Self { frame, own, parts: left, patches, others, .. } = self;
        let border = Border::of(&frame, &patches);
        let widths = 0.5 * (own.max - own.min);
        let margin = margin(&frame, widths);
        let (mut parts, mut everywhere) = (Vec::new(), Bounds::EMPTY);
        for LeftPart { number, bounds, normals } in left {
            let around = Bounds { min: bounds.min - margin, max: bounds.max + margin };
            let Some(within) = border.clearing(&around, widths) else { continue };
            let from = Start::in_box(&around);
            let look = LookAround { from, within, patches: &patches, others: &others };
            let [near, far] = simd::run(look);
            if normals.iter().all(|normal| lets_pass(&near, *normal)) {
                let higher = |[near, far]: [f32; 2]| if near > far { near } else { far };
                let elevations = std::array::from_fn(|octant| higher([near[octant], far[octant]]));
                parts.push(Part { number, from, elevations });
                everywhere = everywhere.union(around);
            }
        }
        let mut view = SkylineView { frame, parts, from: Start::in_box(&everywhere), lowest: [NOTHING; 8] };
        view.see(&Sight { extent: Extent::NONE, gain: 0.0 });
        view
    }
}

/// What boxes of parts are larger by.
fn margin(frame: &Frame, widths: Vec3) -> Vec3 {
    let lengths = Vec3::from_array(frame.axes.map(Vec3::length));
    let aside = (frame.lift + STEPS) * lengths + ROUNDING * widths;
    // Nothing starts below the surface, but for roundings.
    Vec3::new(aside.x, aside.y, STEPS * lengths.z + ROUNDING * widths.truncate().max_element() * lengths.z / lengths.x)
}

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

/// Leaves out what is run through as often from one end as from the other, edge by edge: where not all blocks of a patch
/// are there, its lines are not those of the patches beyond.
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
struct Border {
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
    fn of(frame: &Frame, patches: &[NearPatch]) -> Self {
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
    fn clearing(&self, around: &Bounds, widths: Vec3) -> Option<[Vec2; 2]> {
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

fn is_within(b: &Bounds, [low, high]: [Vec2; 2]) -> bool {
    b.min.x >= low.x && b.min.y >= low.y && b.max.x <= high.x && b.max.y <= high.y
}

fn is_apart(b: &Bounds, [low, high]: [Vec2; 2]) -> bool {
    b.max.x < low.x || b.max.y < low.y || b.min.x > high.x || b.min.y > high.y
}

/// What of a box is not within: at each of the four sides.
fn beyond(b: &Bounds, [low, high]: [Vec2; 2]) -> impl Iterator<Item = Bounds> {
    let (below, above) = (b.max.min(low.extend(f32::INFINITY)), b.min.max(high.extend(f32::NEG_INFINITY)));
    let sides = [
        Bounds { max: Vec3 { x: below.x, ..b.max }, ..*b },
        Bounds { max: Vec3 { y: below.y, ..b.max }, ..*b },
        Bounds { min: Vec3 { x: above.x, ..b.min }, ..*b },
        Bounds { min: Vec3 { y: above.y, ..b.min }, ..*b },
    ];
    sides.into_iter().filter(|side| side.min.cmple(side.max).all())
}

/// Finds the elevations of what is near a part, and of other patches that are near.
struct LookAround<'a> {
    from: Start,
    /// Where the sheet is above each place once.
    within: [Vec2; 2],
    patches: &'a [NearPatch],
    others: &'a [Extent],
}

impl Task for LookAround<'_> {
    type Output = [[f32; 8]; 2];

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> [[f32; 8]; 2] {
        let Self { from, within, patches, others } = self;
        let (mut near, mut far) = (k.splat(NOTHING), k.splat(NOTHING));
        for patch in patches {
            for block in &patch.blocks {
                let between = Between::of(k, &from.extent, &block.extent);
                if !is_apart(&block.bounds, within) {
                    near = k.max(near, between.only(k, k.load(&block.steepness)));
                }
                if is_apart(&block.bounds, within) {
                    far = k.max(far, between.elevations(k, from.floor));
                } else if !is_within(&block.bounds, within) {
                    for beyond in beyond(&block.bounds, within) {
                        let between = Between::of(k, &from.extent, &Extent::of(k, &beyond));
                        far = k.max(far, between.elevations(k, from.floor));
                    }
                }
            }
        }
        for other in others {
            far = k.max(far, from.elevations(k, other));
        }
        [k.store(near), k.store(far)]
    }
}

/// Whether what leaves a triangle along its normal stays above what is near.
fn lets_pass(near: &[f32; 8], normal: Vec3) -> bool {
    let [x, y, z] = normal.to_array();
    let ways = [x.abs(), y.abs()];
    let octant = octant(ways, [x, y].map(|way| u32::from(way < 0.0)));
    let least = near[octant as usize];
    // Rays that start on a triangle without area, which has no normal, are not said to start above it.
    z == 0.0 || z > (least + MARGIN * least.abs() + MARGIN_OF_STEEPNESS) * ways[0].max(ways[1])
}

/// A box as it is seen.
pub struct Sight {
    extent: Extent,
    /// By how many of its units the skyline may rise, if this is added; not positive: not at all.
    pub gain: f32,
}

struct Look<'a> {
    view: &'a SkylineView,
    at: &'a Bounds,
}

impl Task for Look<'_> {
    type Output = Sight;

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Sight {
        let Self { view, at } = self;
        let extent = Extent::of(k, &view.frame.around(at));
        let gains = k.store(k.sub(view.from.elevations(k, &extent), k.load(&view.lowest)));
        let mut most = NOTHING;
        for gain in gains {
            most = if most < gain { gain } else { most };
        }
        Sight { extent, gain: UNITS * most }
    }
}

struct See<'a> {
    view: &'a mut SkylineView,
    sight: &'a Sight,
}

impl Task for See<'_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let Self { view, sight } = self;
        let mut lowest = k.splat(f32::INFINITY);
        for part in &mut view.parts {
            let all = k.max(k.load(&part.elevations), part.from.elevations(k, &sight.extent));
            part.elevations = k.store(all);
            lowest = k.min(lowest, all);
        }
        view.lowest = k.store(lowest);
    }
}

impl SkylineView {
    /// Whether no part can be left, whatever else there is.
    pub fn is_shut(&self) -> bool {
        self.parts.is_empty()
    }

    /// A box of the lattice as it is seen.
    pub fn look(&self, at: &Bounds) -> Sight {
        simd::run(Look { view: self, at })
    }

    /// Adds what was looked at.
    pub fn see(&mut self, sight: &Sight) {
        simd::run(See { view: self, sight });
    }

    /// The skyline, when all else was seen.
    pub fn skyline(&self) -> Skyline {
        let mut skyline = Skyline { frame: self.frame.packed, lift: self.frame.lift, ..Skyline::NONE };
        for part in &self.parts {
            skyline.elevations[part.number] = part.elevations.map(rounded_up);
        }
        skyline
    }

    /// The same as seen from a part.
    pub fn part_skyline(&self) -> PartSkyline {
        let elevations = [[NEVER; 8]; 4];
        let mut skyline = PartSkyline { frame: self.frame.packed, lift: self.frame.lift, unused: 0, elevations };
        for part in &self.parts {
            skyline.elevations[part.number] = part.elevations.map(rounded_up);
        }
        skyline
    }
}

/// In units of the skyline, with some margin; [`NEVER`] if it is too much.
fn rounded_up(elevation: f32) -> i8 {
    let units = ((elevation + MARGIN * elevation.abs() + MARGIN_OF_STEEPNESS) * UNITS).ceil();
    if units < f32::from(NEVER) { units.max(f32::from(i8::MIN)) as i8 } else { NEVER }
}

#[cfg(test)]
mod tests {
    use super::super::measure::Block;
    use super::super::sheet::Outline;
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

    #[test]
    fn a_block_that_reaches_beyond_the_clearing_stands_there_as_a_box() {
        let at =
            |x: [f32; 2], z: [f32; 2]| Bounds { min: Vec3::new(x[0], -1.0, z[0]), max: Vec3::new(x[1], 1.0, z[1]) };
        let from = Start::in_box(&at([-1.0, 1.0], [0.0, 0.0]));
        let block = |bounds: Bounds| Block { extent: Extent::around(&bounds), bounds, ..Block::EMPTY };
        let outline = Outline { lines: Vec::new(), is_whole: true };
        let patches = &[NearPatch { blocks: vec![block(at([2.0, 6.0], [0.0, 50.0]))], outline }];
        let far = |to: f32| {
            let within = [Vec2::new(-8.0, -8.0), Vec2::new(to, 8.0)];
            simd::run(LookAround { from, within, patches, others: &[] })[1][0]
        };
        assert!(far(7.0) <= NOTHING, "it is within");
        // Of what is beyond 5, at most 50 above, 4 ahead at least.
        assert!((12.5..13.0).contains(&far(5.0)), "{}", far(5.0));
        assert!((50.0..51.0).contains(&far(1.0)), "all of it, 1 ahead: {}", far(1.0));
    }

    #[test]
    fn normals_that_lean_into_a_wall_do_not_pass() {
        let mut near = [0.0; 8];
        near[0] = 2.0;
        assert!(lets_pass(&near, Vec3::new(-1.0, -0.5, 0.1)), "away from it");
        assert!(lets_pass(&near, Vec3::new(1.0, 0.5, 3.0)), "steeper than it");
        assert!(!lets_pass(&near, Vec3::new(1.0, 0.5, 1.0)));
    }
}
