//! The view from a patch's parts: what is near, then boxes of all that is far.

use super::octants::{Between, Extent, NOTHING, octant};
use super::sheet::{Frame, NearPatch, SkylineSheet};
use super::{NEVER, Skyline, UNITS};
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
    /// The view from the first of the patches, past all of them; `None` if no part of it can be left.
    pub fn view(self) -> Option<SkylineView> {
        let Self { frame, patches, others, normals } = self;
        let border = Border::of(&frame, &sides(&patches));
        let own = patches[0].whole;
        let widths = 0.5 * (own.max - own.min);
        let margin = margin(&frame, widths);
        let (mut parts, mut everywhere) = (Vec::new(), Bounds::EMPTY);
        for (number, block) in patches[0].blocks.iter().enumerate().filter(|(_, block)| !block.bounds.is_empty()) {
            let around = Bounds { min: block.bounds.min - margin, max: block.bounds.max + margin };
            let Some(within) = border.clearing(&around, widths) else { continue };
            let from = Start::in_box(&around);
            let look = LookAround { from, within, patches: &patches, others: &others };
            let [near, far] = simd::run(look);
            if normals[number].iter().all(|normal| lets_pass(&near, *normal)) {
                let higher = |[near, far]: [f32; 2]| if near > far { near } else { far };
                let elevations = std::array::from_fn(|octant| higher([near[octant], far[octant]]));
                parts.push(Part { number, from, elevations });
                everywhere = everywhere.union(around);
            }
        }
        if parts.is_empty() {
            return None;
        }
        let mut view = SkylineView { frame, parts, from: Start::in_box(&everywhere), lowest: [NOTHING; 8] };
        view.see(&Sight { extent: Extent::NONE, gain: 0.0 });
        Some(view)
    }
}

/// What boxes of parts are larger by.
fn margin(frame: &Frame, widths: Vec3) -> Vec3 {
    let lengths = Vec3::from_array(frame.axes.map(Vec3::length));
    let aside = (frame.lift + STEPS) * lengths + ROUNDING * widths;
    // Nothing starts below the surface, but for roundings.
    Vec3::new(aside.x, aside.y, STEPS * lengths.z + ROUNDING * widths.truncate().max_element() * lengths.z / lengths.x)
}

/// A side of a patch.
struct Side<'a> {
    ends: [[i32; 3]; 2],
    points: &'a [[i32; 3]],
}

impl Side<'_> {
    /// Whether two sides are one, run through from opposite ends.
    fn is_joined_to(&self, other: &Self) -> bool {
        self.ends[0] == other.ends[1]
            && self.ends[1] == other.ends[0]
            && self.points.len() == other.points.len()
            && self.points.iter().eq(other.points.iter().rev())
    }
}

/// All sides that are no points.
fn sides(patches: &[NearPatch]) -> Vec<Side<'_>> {
    let all = patches.iter().flat_map(|patch| &patch.sides).filter(|points| points.len() > 1);
    all.map(|points| Side { ends: [points[0], points[points.len() - 1]], points }).collect()
}

/// The only side that is the same as this one.
fn partner(sides: &[Side<'_>], side: usize) -> Option<usize> {
    let mut partners = (0..sides.len()).filter(|other| *other != side && sides[side].is_joined_to(&sides[*other]));
    partners.next().filter(|_| partners.next().is_none())
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
    fn of(frame: &Frame, sides: &[Side<'_>]) -> Self {
        let partners: Vec<Option<usize>> = (0..sides.len()).map(|side| partner(sides, side)).collect();
        let mut open = Vec::new();
        for (number, side) in sides.iter().enumerate() {
            if partners[number].is_none_or(|partner| partners[partner] != Some(number)) {
                open.push(OpenSide::new(side.points.iter().map(|p| frame.place(*p)).collect()));
            }
        }
        Self { sides: open }
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
        let clearing = [middle - reach, middle + reach].map(|corner| corner.as_vec2());
        (windings * windings == 1 && reach.is_finite() && is_within(around, clearing)).then_some(clearing)
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
                if block.bounds.is_empty() {
                    continue;
                }
                let between = Between::of(k, &from.extent, &block.extent);
                if !is_apart(&block.bounds, within) {
                    near = k.max(near, between.only(k, k.load(&block.steepness)));
                }
                if !is_within(&block.bounds, within) {
                    far = k.max(far, between.elevations(k, from.floor));
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
}

/// In units of the skyline, with some margin; [`NEVER`] if it is too much.
fn rounded_up(elevation: f32) -> i8 {
    let units = ((elevation + MARGIN * elevation.abs() + MARGIN_OF_STEEPNESS) * UNITS).ceil();
    if units < f32::from(NEVER) { units.max(f32::from(i8::MIN)) as i8 } else { NEVER }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!(low.cmpgt(Vec2::new(-2.0, -3.0)).all() && high.cmplt(Vec2::new(4.0, 3.0)).all(), "{low} {high}");
        assert!(clearing(&square(4.0, 1), 3.5).is_none(), "the border enters the box");
        assert!(clearing(&square(4.0, 1), 6.0).is_none(), "outside");
        assert!(clearing(&square(4.0, 2), 1.0).is_none(), "two of the sheet above each place");
        assert!(clearing(&square(4.0, 0), 1.0).is_none(), "no border");
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
