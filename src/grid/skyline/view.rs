//! The view from a patch's parts: what is near, then boxes of all that is far.

use super::border::{Border, beyond, is_apart, is_within};
use super::octants::{Between, Extent, NOTHING, octant};
use super::sheet::{Frame, LeftPart, NearPatch, SkylineSheet};
use super::{NEVER, PartSkyline, Skyline, UNITS};
use crate::math::Bounds;
use crate::math::simd::{self, Kernel, Task};
use glam::{Vec2, Vec3};

/// Roundings of places in the frame, as a share of the patch.
pub(super) const ROUNDING: f32 = 1.0 / 1024.0;

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
    use super::super::outline::Outline;
    use super::*;

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
