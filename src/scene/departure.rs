//! Rays that leave a patch so high that they do not meet it again, or meet nothing at all: most secondary rays. Their
//! own patch would otherwise be what they are tested against most, since they start in the midst of its boxes.
//!
//! How high a patch rises above each part of itself, its [`Horizon`], is found from its pieces when enough rays have
//! left it. When many more have left to that side, its [`Skyline`] is found, which says as much of all that is seen from
//! the patch: rays that clear that need no walk. A part of it from which many rays did not clear it has a
//! [`PartSkyline`]. Pieces that are not in the cache, and of a skyline's own patch all, are
//! diced for it and forgotten, so that what is tested does not depend on what the cache holds: a trace of look-ups can
//! be replayed for any size. Both are remembered as long as no other patch takes their place. They decide only what is
//! tested, never what is hit.

use super::builder::{Builder, PatchContext};
use super::pieces::{n_pieces, with_pieces};
use super::skyline;
use super::world::{GridCache, WorldMesh};
use crate::cache::{MemoTable, Pin, Slot, Visit};
use crate::grid::{CellRect, Horizon, LatticeRay, PartSkyline, SeenFrom, Skyline, cells_of};
use crate::ids::{MeshId, PatchId};
use crate::math::simd::{self, Kernel};
use crate::math::{PrimitiveRef, Ray};
use serde::Serialize;
use std::ops::AddAssign;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Patches whose horizons are remembered at most: 2 MiB. With a quarter of them, occlusion, diffuse and shuffled rays
/// on meshes of 30,000 faces (38,000 to 47,000 patches; rates 8 and 16) ran at 0.82 to 1.00 of the speed.
const MOST_HORIZONS: usize = 1 << 16;

/// Patches whose skylines are remembered at most: 2.5 MiB. Four times as many gain nothing more there.
const MOST_SKYLINES: usize = 1 << 14;

/// Parts of patches whose own skylines are remembered at most: 2 MiB. (Other numbers were not tried.)
const MOST_PART_SKYLINES: usize = 1 << 15;

/// Pieces of a patch whose horizon is found at most. With 64 instead, ambient occlusion of bigguy and monsterfrog at
/// 1920x1080 and one cell a pixel took 1.14 and 1.09 times as long.
const MOST_PIECES: usize = 256;

/// Rays that leave a patch, for each of its pieces, before its horizon is found. Renders by pixel groups send few: trex
/// at 960x540 took 0.2 % more instructions with 16 than with 8, and as many at 1920x1080 with 4 as with 8.
const RAYS_PER_PIECE: u32 = 8;

/// Rays that leave a patch whose horizon is known before its skyline is found, and for each of its pieces so many more.
/// To find it takes some 80 µs for patches of one piece, 135 for four and 310 for sixteen, and spares a ray 30 to 50 ns
/// on average: about as many rays win that back.
const RAYS_BEFORE_SKYLINE: [u32; 2] = [1664, 160];

/// Rays that start in a part of a patch and do not clear the patch's skyline before the part's own is found, and so
/// many more for each of the patch's pieces. To find a skyline, on the mean of those of patches and of parts, took 0.8
/// million instructions on spot at 8, and 1.3 at 16. With 480 and 32, and finer blocks that took 2.1 million, occlusion
/// rays on spot at 16 ran at 0.76 of the speed.
const RAYS_BEFORE_PART: [u32; 2] = [1216, 256];

/// One of so many of them is counted: who counts writes what all threads read.
const RAYS_PER_COUNT: u32 = 32;

/// Pieces of a patch whose skyline is found at most: those of all its neighbours are looked at as well.
const MOST_PIECES_OF_SKYLINE: usize = 16;

/// If parts see so little more than their patches by their own skylines, on the mean of a mesh so far and in percent of
/// rays, few more are sought. (Other shares were not tried.)
const LEAST_GAIN: u32 = 10;

/// Rays may start so many times as high as the one for which a part's skyline is found, and as many lattice steps more.
const LIFT_OF_PART: [f32; 2] = [4.0, 64.0];

/// If the mean openness of a mesh's skylines so far, in percent, is less, few more are sought: where few rays clear
/// them they do not win back what they take.
const LEAST_OPENNESS: u32 = 40;

/// Skylines from which that is seen.
const FIRST_SKYLINES: u64 = 32;

/// One of so many of a mesh's patches is looked at even so: those before may have been in a corner.
const PATCHES_PER_TRY: u32 = 16;

/// What a mesh's skylines that were found are worth.
#[derive(Default)]
struct Worth {
    n: AtomicU64,
    /// Of percents of rays.
    sum: AtomicU64,
    /// Patches that were passed over.
    n_passed_over: AtomicU32,
}

impl Worth {
    fn note(&self, percent: u32) {
        self.n.fetch_add(1, Ordering::Relaxed);
        self.sum.fetch_add(u64::from(percent), Ordering::Relaxed);
    }

    /// Whether another one is worth while, which takes so many percent.
    fn is_worth_while(&self, least: u32) -> bool {
        let n = self.n.load(Ordering::Relaxed);
        n < FIRST_SKYLINES
            || self.sum.load(Ordering::Relaxed) >= n * u64::from(least)
            || self.n_passed_over.fetch_add(1, Ordering::Relaxed) % PATCHES_PER_TRY == PATCHES_PER_TRY - 1
    }
}

/// What is known of the rays that left patches, and of the patches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DepartureCounts {
    /// Horizons found, those that were forgotten and found again counted again.
    pub horizons: u64,
    /// Skylines found, likewise.
    pub skylines: u64,
    /// Skylines of parts of patches found, likewise.
    pub part_skylines: u64,
    /// Rays that left above a skyline, and were not walked at all. (Those that pass their own patch by alone are too
    /// many to be counted: primary rays ran at 0.99 of the speed.)
    pub rays_past_all: u64,
}

impl AddAssign for DepartureCounts {
    fn add_assign(&mut self, other: Self) {
        self.horizons += other.horizons;
        self.skylines += other.skylines;
        self.part_skylines += other.part_skylines;
        self.rays_past_all += other.rays_past_all;
    }
}

/// The horizons and skylines of patches that rays have left, for all threads.
pub(super) struct Departures {
    /// By the numbers of patches among those of all meshes. No entries if there are too many for numbers of 32 bits.
    horizons: MemoTable<3>,
    /// Likewise, of those that many rays have left.
    skylines: MemoTable<{ Skyline::WORDS }>,
    /// By 16 times the patch's number and the part, of those that many rays have left which did not clear the patch's
    /// skyline.
    part_skylines: MemoTable<{ PartSkyline::WORDS }>,
    /// Of each mesh: how open skylines are, and by how much more those of parts.
    worth: Box<[[Worth; 2]]>,
    /// How many patches there are before those of each mesh.
    first: Box<[u32]>,
}

/// What is known of the patch that a ray leaves.
#[derive(Clone, Copy)]
pub(super) struct Leaving<'c> {
    /// The patch that it starts on, unless it is known that it has to be tested against it.
    patch: PatchId,
    /// Who is to be asked whether it has left that patch; `None` if it has.
    unknown: Option<&'c Departures>,
}

/// Where a ray leaves a mesh.
#[derive(Clone, Copy)]
pub(super) struct Start {
    /// The patch's among those of all meshes.
    number: u32,
    patch: PatchId,
    cell: [u16; 2],
    /// How far above, in world units.
    above: f32,
}

/// A ray that leaves a patch, and what it takes to look around from there.
struct Departing<'a, 'w> {
    ray: &'a LatticeRay,
    at: Start,
    of: PatchContext<'a>,
    cache: &'a GridCache,
    builder: &'a mut Builder<'w>,
    pin: &'a mut Pin<'w>,
}

impl<'c> Leaving<'c> {
    /// A ray that may meet whatever is there.
    pub const NOTHING: Self = Self { patch: PatchId(u32::MAX), unknown: None };

    /// Of a ray at the mesh that starts there, if it does. `in_lattice` is the same ray there.
    #[inline(always)]
    pub fn of<K: Kernel>(
        k: K,
        start: Option<Start>,
        (id, mesh): (MeshId, &WorldMesh),
        in_lattice: &LatticeRay,
        cache: &'c GridCache,
        (builder, pin): (&mut Builder<'c>, &mut Pin<'c>),
    ) -> Self {
        let departures = cache.departures();
        let Some(at @ Start { number, patch, .. }) = start else { return Self::NOTHING };
        let Some(words) = departures.horizons.get(number) else {
            return Self { patch, unknown: Some(departures) };
        };
        let horizon = Horizon::from_words(words);
        if in_lattice.is_one_in(RAYS_PER_COUNT) {
            let of = PatchContext { id, mesh, patch };
            departures.ask_for_skyline(horizon, Departing { ray: in_lattice, at, of, cache, builder, pin });
        }
        if horizon.is_cleared_by(k, in_lattice) { Self { patch, unknown: None } } else { Self::NOTHING }
    }

    /// Whether the ray need not be tested against this patch. `root` is the slot of its first block.
    #[inline(always)]
    pub fn has_left(
        self,
        ray: &LatticeRay,
        of: PatchContext<'_>,
        builder: &mut Builder<'_>,
        visit: &Visit<'_>,
        root: Slot<'_>,
    ) -> bool {
        of.patch == self.patch
            && self.unknown.is_none_or(|departures| departures.ask(ray, &mut Left { of, builder, visit, root }))
    }
}

impl Departures {
    /// For meshes with so many patches each.
    pub fn new(n_patches: impl Iterator<Item = usize> + Clone) -> Self {
        let first = n_patches.clone().scan(0u32, |next, n| Some(std::mem::replace(next, next.wrapping_add(n as u32))));
        let [n_horizons, n_skylines, n_parts] = entries_for(n_patches.sum());
        let (horizons, skylines) = (MemoTable::new(n_horizons), MemoTable::new(n_skylines));
        let first: Box<[u32]> = first.collect();
        let worth = first.iter().map(|_| Default::default()).collect();
        Self { first, horizons, skylines, part_skylines: MemoTable::new(n_parts), worth }
    }

    /// Bytes of the tables for meshes with so many patches in all: some 6.5 MiB at most.
    pub fn bytes_for(n_patches: usize) -> usize {
        let [n_horizons, n_skylines, n_parts] = entries_for(n_patches);
        MemoTable::<3>::bytes_for(n_horizons)
            + MemoTable::<{ Skyline::WORDS }>::bytes_for(n_skylines)
            + MemoTable::<{ PartSkyline::WORDS }>::bytes_for(n_parts)
    }

    /// Whether a ray that starts there is known to meet nothing of the mesh, by the skyline of its patch or of the
    /// part. `direction` is its direction in the lattice.
    #[inline(always)]
    pub fn meets_nothing<K: Kernel>(&self, k: K, start: Option<Start>, direction: K::D, mesh: &WorldMesh) -> bool {
        let Some(Start { number, cell, above, .. }) = start else { return false };
        let Some(skyline) = self.skylines.known(number) else { return false };
        let lift = above * mesh.lattice_per_world();
        if Skyline::is_cleared_by(k, direction, cell, lift, |word| skyline.word(word)) {
            return skyline.was_there();
        }
        let number = number_of_part(number, Skyline::part_of(skyline.word(0), cell));
        let Some(of_part) = self.part_skylines.known(number) else { return false };
        PartSkyline::is_cleared_by(k, direction, cell, lift, |word| of_part.word(word))
            && of_part.was_there()
            && skyline.was_there()
    }

    /// Where the ray leaves the mesh, if it does and that is known.
    #[inline(always)]
    pub fn start(&self, ray: &Ray, id: MeshId, mesh: &WorldMesh) -> Option<Start> {
        let PrimitiveRef { mesh: of, patch, cell, .. } = ray.from?;
        let above = ray.above?;
        (of == id && mesh.keeps_angles()).then(|| Start { number: self.number(id, patch), patch, cell, above })
    }

    /// A patch's number among those of all meshes.
    #[inline(always)]
    fn number(&self, mesh: MeshId, patch: PatchId) -> u32 {
        self.first[mesh.idx()].wrapping_add(patch.0)
    }

    /// Whether a ray has left the patch it starts on, once enough rays have that its horizon is found.
    ///
    /// It takes the entry of another patch in an eighth of cases only: where there are more of them than entries, none
    /// would keep its own.
    #[cold]
    #[inline(never)]
    fn ask(&self, ray: &LatticeRay, left: &mut Left<'_, '_, '_, '_>) -> bool {
        let number = self.number(left.of.id, left.of.patch);
        if !self.horizons.is_due(number, ray.is_one_in(8), || RAYS_PER_PIECE * left.n_pieces() as u32) {
            return false;
        }
        let horizon = left.horizon(ray);
        left.builder.departures.horizons += 1;
        self.horizons.put(number, horizon.to_words());
        horizon.is_cleared_by(simd::Portable, ray)
    }

    /// Finds the skyline of a patch once enough rays have left it to the side of its horizon, and of one of its parts
    /// once enough more have not cleared that.
    #[cold]
    #[inline(never)]
    fn ask_for_skyline(&self, horizon: Horizon, departing: Departing<'_, '_>) {
        if !horizon.is_on_side_of(departing.ray) {
            return;
        }
        let number = departing.at.number;
        if let Some(words) = self.skylines.get(number) {
            return self.ask_for_part(Skyline::from_words(words), departing);
        }
        let Departing { ray, of, cache, builder, pin, .. } = departing;
        if !self.skylines.is_due(number, may_replace(ray), || rays_counted(RAYS_BEFORE_SKYLINE, of, builder)) {
            return;
        }
        let [worth, _] = &self.worth[of.id.idx()];
        if !may_have_skyline(of, builder) || !worth.is_worth_while(LEAST_OPENNESS) {
            return self.skylines.put_off(number);
        }
        builder.departures.skylines += 1;
        match skyline::view_from(of, SeenFrom::Patch, ray, cache, builder, &pin.visit()) {
            Some(view) => {
                let skyline = view.skyline();
                worth.note(skyline.openness());
                self.skylines.put(number, skyline.to_words());
            }
            None => {
                worth.note(0);
                self.skylines.put_off(number);
            }
        }
    }

    /// As [`ask_for_skyline`](Self::ask_for_skyline) for the part where the ray starts.
    fn ask_for_part(&self, of_patch: Skyline, departing: Departing<'_, '_>) {
        let Departing { ray, at: Start { number, cell, above, .. }, of, cache, builder, pin } = departing;
        let part = of_patch.part(cell);
        let number = number_of_part(number, part);
        if !self.part_skylines.is_due(number, may_replace(ray), || rays_counted(RAYS_BEFORE_PART, of, builder)) {
            return;
        }
        let [_, worth] = &self.worth[of.id.idx()];
        if !may_have_skyline(of, builder) || !worth.is_worth_while(LEAST_GAIN) {
            return self.part_skylines.put_off(number);
        }
        builder.departures.part_skylines += 1;
        let [times, more] = LIFT_OF_PART;
        let seen_from =
            SeenFrom::Part { number: part as usize, lift: times * above * of.mesh.lattice_per_world() + more };
        let view = skyline::view_from(of, seen_from, ray, cache, builder, &pin.visit());
        let skyline = view.map(|view| view.part_skyline());
        let gain = skyline.map_or(0, |of_part| of_part.openness().saturating_sub(of_patch.openness_of_part(part)));
        worth.note(gain);
        match skyline.filter(|_| gain > 0) {
            Some(skyline) => self.part_skylines.put(number, skyline.to_words()),
            None => self.part_skylines.put_off(number),
        }
    }
}

/// A part's number among those of all patches; where they are too many to be numbered, there are no entries either.
#[inline(always)]
fn number_of_part(patch: u32, part: u32) -> u32 {
    patch.wrapping_mul(Skyline::N_PARTS).wrapping_add(part)
}

/// Where there are more patches than entries, none would keep its own if it were easily taken over.
fn may_replace(ray: &LatticeRay) -> bool {
    ray.is_one_in(32 * RAYS_PER_COUNT)
}

/// Of the rays that go before a skyline, how many are counted.
fn rays_counted([rays, more]: [u32; 2], of: PatchContext<'_>, builder: &mut Builder<'_>) -> u32 {
    (rays + more * n_pieces(builder.cells_of(of)) as u32) / RAYS_PER_COUNT
}

fn may_have_skyline(of: PatchContext<'_>, builder: &mut Builder<'_>) -> bool {
    n_pieces(builder.cells_of(of)) <= MOST_PIECES_OF_SKYLINE && !of.mesh.surface().edited().has_holes()
}

/// Entries for horizons, for skylines and for those of parts.
fn entries_for(n_patches: usize) -> [usize; 3] {
    let (n_numbered, n_parts) = (u32::MAX as usize - 1, Skyline::N_PARTS as usize * n_patches);
    [(n_patches, MOST_HORIZONS), (n_patches, MOST_SKYLINES), (n_parts, MOST_PART_SKYLINES)]
        .map(|(n, most)| if n < n_numbered { n.min(most) } else { 0 })
}

/// The patch that is left.
struct Left<'a, 'v, 'p, 'w> {
    of: PatchContext<'a>,
    builder: &'a mut Builder<'w>,
    visit: &'v Visit<'p>,
    /// Of its first block.
    root: Slot<'v>,
}

impl<'v> Left<'_, 'v, '_, '_> {
    /// All of the patch's cells.
    #[inline(always)]
    fn cells(&mut self) -> CellRect {
        match self.visit.peek(self.root) {
            Some(block) => cells_of(block.bytes()),
            None => self.builder.cells_of(self.of),
        }
    }

    /// Pieces of the patch.
    fn n_pieces(&mut self) -> usize {
        n_pieces(self.cells())
    }

    /// The patch's horizon on the side to which the ray leaves it; none if it has too many pieces.
    fn horizon(&mut self, ray: &LatticeRay) -> Horizon {
        let n_pieces = self.n_pieces();
        if n_pieces > MOST_PIECES || self.of.mesh.surface().edited().has_holes() {
            return Horizon::NONE;
        }
        let borders = self.builder.borders_of(self.of);
        let block = self.visit.peek(self.root);
        with_pieces(self.of, block, self.visit, self.builder, |pieces| {
            Horizon::of_pieces(pieces.iter().copied(), &borders, ray)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skylines_that_are_seldom_cleared_are_seldom_sought() {
        let worth = Worth::default();
        (1..FIRST_SKYLINES).for_each(|_| worth.note(LEAST_OPENNESS - 10));
        assert!(worth.is_worth_while(LEAST_OPENNESS), "too few to tell");
        worth.note(LEAST_OPENNESS - 10);
        let tries = (0..10 * PATCHES_PER_TRY).filter(|_| worth.is_worth_while(LEAST_OPENNESS)).count();
        assert_eq!(tries, 10, "one of sixteen is tried");
        (0..FIRST_SKYLINES).for_each(|_| worth.note(LEAST_OPENNESS + 10));
        assert!(worth.is_worth_while(LEAST_OPENNESS), "others found at the same time may be better");
    }
}
