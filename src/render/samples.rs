//! Several samples a pixel, and few where they would be alike.
//!
//! Of every pixel that is not interpolated the first sample is traced, before any other. Where it is **even** with
//! those around it a second one decides: if that agrees, the pixel is **settled** with two. All others take every
//! sample. Pixels are even if they show nearly the same colour, and their light has taken the same way; if it has taken
//! another there is an edge somewhere between, which does not matter if both its sides have the same colour and the
//! surface goes on across it.
//!
//! What is thinner than a pixel may lie between the first two samples of some pixels along it, but not of all. So a
//! pixel stays settled only while all samples of the pixels around it are like its own: where one is not, it takes
//! every sample as well, and so on along the line, as edges are followed into groups. Patterns are looked up: nothing
//! is settled where one of their edges passes. What glass shows, and mirrors of something bright, may be as small as a
//! point, and has to be more alike.
//!
//! # Invariants
//! 1. A settled pixel has two samples, a corner or probe of a cell that holds its first one alone, any other traced one
//!    all, bit for bit those that it has without groups.
//! 2. Pixels at the sides of a tile are never settled: their neighbours beyond are not known.

use super::adaptive::{CREASE_COSINE, Worker};
use super::cells::{Cell, Tile, TracedProbe};
use super::film::PixelRecord;
use super::follow::{Shown, around, follow};
use super::tiles::PixelRect;
use super::tracer::Tracer;
use super::workers::Exposure;
use crate::ids::MeshId;
use glam::{DVec2, DVec3, Vec3};

/// Samples of a settled pixel.
const SETTLED: u32 = 2;

/// How far from a pixel settled ones take all samples if one of its own is not like theirs.
const REACH: i32 = 1;

/// How far the way between two points of one surface may lead out of their tangent planes, as a sine. Where normals
/// turn as far as they may, a circle has 0.32.
const MAX_SINE: f64 = 0.3;

impl<T: Tracer> Worker<'_, '_, T> {
    /// Whether pixels have several samples, some of which may be saved.
    pub(super) fn is_sampled_by_need(&self) -> bool {
        self.job.settings.spp > 1 && self.job.is_possible()
    }

    /// Traces the first sample of every pixel that is not interpolated.
    pub(super) fn look_everywhere(&mut self, tile: PixelRect) {
        let is_split = |tile: &Tile, pixel| matches!(tile.find(pixel).1, Cell::Split(_));
        self.along_curve(tile, |worker, pixels| worker.trace_probes(pixels, is_split));
    }

    /// Traces as many samples of a pixel as it needs, where its first may have been traced.
    pub(super) fn expose(&mut self, pixel: [u32; 2]) -> Exposure {
        let mut exposure = self.first_sample(pixel);
        if !self.is_sampled_by_need() {
            self.job.pixels().expose(&mut self.shader, pixel, &mut exposure, self.job.settings.spp);
        } else if !(self.is_even(pixel) && self.is_confirmed(pixel, &mut exposure)) {
            self.complete(pixel, &mut exposure);
        }
        exposure
    }

    /// Traces all samples of the settled pixels that samples around them contradict, and so on.
    pub(super) fn follow_samples(&mut self, tile: PixelRect, records: &mut [PixelRecord]) {
        let is_settled = |record: &PixelRecord| record.samples == SETTLED && SETTLED < self.job.settings.spp;
        let settled = tile.pixels().zip(&*records).filter(|(_, record)| is_settled(record)).map(|(pixel, _)| pixel);
        follow(tile, REACH, settled.collect(), |pixel| {
            let record = &mut records[tile.idx(pixel).expect("samples are followed within the tile")];
            let is_wrong = is_settled(record) && self.is_contradicted(tile, pixel);
            if is_wrong {
                let mut exposure = self.first_sample(pixel);
                self.complete(pixel, &mut exposure);
                *record = PixelRecord { reason: record.reason, ..exposure.record() };
            }
            is_wrong
        });
    }

    /// The first sample of a pixel of the tile, if it was traced.
    pub(super) fn first_sample(&self, pixel: [u32; 2]) -> Exposure {
        self.tile.probe(pixel).map_or(Exposure::default(), |p| Exposure::new(&p.probe.sample, p.misses))
    }

    /// Traces the rest of a pixel's samples.
    fn complete(&mut self, pixel: [u32; 2], exposure: &mut Exposure) {
        self.job.pixels().expose(&mut self.shader, pixel, exposure, self.job.settings.spp);
        self.tile.note_seen(pixel, exposure.range().map(Shown::new));
    }

    /// Whether some sample of the pixels around a traced one, as far as they are traced, is not like its first.
    fn is_contradicted(&self, tile: PixelRect, pixel: [u32; 2]) -> bool {
        let Some(own) = self.tile.probe(pixel) else { return false };
        let most = if self.shows_points(own) { 1.0 } else { 2.0 } * self.job.settings.tolerance;
        let mut beside = around(tile, pixel, REACH).filter_map(|beside| self.tile.probe(beside));
        beside.any(|beside| beside.seen.iter().any(|seen| own.shown.difference(*seen) > most))
    }

    /// Traces a second sample of a pixel; whether it agrees with the first: what is smaller than a pixel, neighbours do
    /// not show.
    fn is_confirmed(&mut self, pixel: [u32; 2], exposure: &mut Exposure) -> bool {
        let Some(first) = self.tile.probe(pixel).map(|probe| probe.shown) else { return false };
        self.job.pixels().expose(&mut self.shader, pixel, exposure, SETTLED);
        first.difference(Shown::new(exposure.mean())) <= 0.5 * self.job.settings.tolerance
    }

    /// Whether a traced pixel and those around it, all of the tile, are alike.
    fn is_even(&self, pixel: [u32; 2]) -> bool {
        let Some(own) = self.tile.probe(pixel) else { return false };
        let is_alike = |beside| match self.tile.probe(beside) {
            Some(other) => self.is_alike((pixel, own), (beside, other)),
            None => matches!(self.tile.find(beside).1, Cell::Holds { .. }),
        };
        let area = self.tile.area();
        // What reaches a pixel and was not seen in it is thin: samples that miss cost little, so that background is
        // never even.
        around(area, pixel, 1).count() == 9
            && around(area, pixel, 1).all(is_alike)
            && own.probe.smooth.is_some_and(|own| self.shows_no_edge_of_pattern(pixel, own.mesh))
    }

    /// Whether the mesh that a pixel and those around it show has no pattern, or all their centres, between which the
    /// pixel's samples lie, are on one square of it.
    fn shows_no_edge_of_pattern(&self, pixel: [u32; 2], mesh: MeshId) -> bool {
        let position = |pixel: [u32; 2]| {
            let smooth = self.tile.probe(pixel)?.probe.smooth?;
            Some(self.position_at(pixel, smooth.inverse_depth))
        };
        let has_one_color = |beside| {
            let ends = position(pixel).zip(position(beside));
            ends.is_some_and(|(from, to)| self.job.appearance.has_one_color(mesh, from, to))
        };
        !self.job.appearance.is_patterned(mesh) || around(self.tile.area(), pixel, 1).all(has_one_color)
    }

    /// Whether samples between two pixels are like those at their centres, as far as one can tell. A pixel reaches half
    /// way to the next, so that twice the tolerance may lie between them where colour changes smoothly. Light that took
    /// another way tells of an edge nearby, beyond which all of a pixel's samples may lie.
    fn is_alike(&self, (pixel, own): Place<'_>, (beside, other): Place<'_>) -> bool {
        let (difference, tolerance) = (own.shown.difference(other.shown), self.job.settings.tolerance);
        if own.probe.trail() == other.probe.trail() {
            difference <= 2.0 * tolerance
        } else {
            difference <= tolerance && !self.shows_points(own) && self.is_one_surface((pixel, own), (beside, other))
        }
    }

    /// Whether glass is seen, or a mirror in which there may be something bright: of its pixels more has to be alike.
    fn shows_points(&self, seen: &TracedProbe) -> bool {
        seen.probe.smooth.is_some_and(|smooth| !self.job.appearance.reflects_little(smooth.mesh))
    }

    /// Whether a smooth surface leads from what is seen at one pixel to what is seen at the other: neither a border,
    /// with which thin things begin, nor a crease is between them.
    fn is_one_surface(&self, (pixel, own): Place<'_>, (beside, other): Place<'_>) -> bool {
        let (Some(from), Some(to)) = (own.probe.smooth, other.probe.smooth) else { return false };
        let way = self.position_at(beside, to.inverse_depth) - self.position_at(pixel, from.inverse_depth);
        let lies_along = |normal: Vec3| way.dot(normal.as_dvec3()).abs() <= MAX_SINE * way.length();
        from.mesh == to.mesh
            && from.normal.dot(to.normal) >= CREASE_COSINE
            && lies_along(from.normal)
            && lies_along(to.normal)
    }

    /// What is seen at a pixel's centre, in world space.
    fn position_at(&self, pixel: [u32; 2], inverse_depth: f32) -> DVec3 {
        let center = DVec2::from(pixel.map(f64::from)) + 0.5;
        self.job.position(center, inverse_depth).0
    }
}

/// A pixel and what is seen there.
type Place<'p> = ([u32; 2], &'p TracedProbe);
