//! Several samples a pixel, and few where they would be alike.
//!
//! Of every pixel that is not interpolated the first sample is traced, before any other. Where it is **even** with those
//! around it, in colour and in the way that its light took, a second one decides: if that agrees, the pixel is **settled**
//! with two. All others take every sample. What is thinner than a pixel may lie between the first two samples of some pixels
//! along it, but not of all: where all samples of a pixel contradict its first, or its first two, the settled pixels beside it
//! take every sample as well, and so on along the line, as edges are followed into groups. Patterns are looked up: nothing is
//! settled where one of their edges passes.
//!
//! # Invariants
//! 1. A settled pixel has two samples, any other traced one has all, bit for bit those that it has without groups.
//! 2. Pixels at the sides of a tile are never settled: their neighbours beyond are not known.

use super::adaptive::Worker;
use super::cells::{Cell, TracedProbe};
use super::film::PixelRecord;
use super::follow::{around, display_difference, follow};
use super::tiles::PixelRect;
use super::tracer::Tracer;
use super::workers::Exposure;
use crate::ids::MeshId;
use glam::DVec2;

/// Samples of a settled pixel.
const SETTLED: u32 = 2;

/// How far from a pixel that contradicts others take all samples. If only what differs by the tolerance contradicted, instead of
/// by half an edge, city would lose a line with 1, and with 2 take 8 % more rays (1920x1080, four samples, 5/255).
const REACH: i32 = 1;

impl<T: Tracer> Worker<'_, '_, T> {
    /// Whether pixels have several samples, some of which may be saved.
    pub(super) fn is_sampled_by_need(&self) -> bool {
        self.job.settings.spp > 1 && self.is_grouped()
    }

    /// Traces the first sample of every pixel that is not interpolated.
    pub(super) fn look_everywhere(&mut self, tile: PixelRect) {
        self.along_curve(tile, |worker, pixel| {
            if matches!(worker.tile.find(pixel).1, Cell::Split(_)) {
                worker.trace_probe(pixel);
            }
        });
    }

    /// Traces as many samples of a pixel as it needs, where its first may have been traced.
    pub(super) fn expose(&mut self, pixel: [u32; 2]) -> Exposure {
        let mut exposure = self.first_sample(pixel);
        if !self.is_sampled_by_need() {
            self.job.pixels().expose(&mut self.shader, pixel, &mut exposure, self.job.settings.spp);
        } else if !(self.is_even(pixel) && self.is_confirmed(pixel, &mut exposure))
            && self.complete(pixel, &mut exposure)
        {
            self.contradicting.push(pixel);
        }
        exposure
    }

    /// Traces all samples of the settled pixels beside those that contradict, and so on.
    pub(super) fn follow_samples(&mut self, tile: PixelRect, records: &mut [PixelRecord]) {
        let contradicting = std::mem::take(&mut self.contradicting);
        let beside = contradicting.iter().flat_map(|&pixel| around(tile, pixel, REACH)).collect();
        follow(tile, REACH, beside, |pixel| {
            let record = &mut records[tile.idx(pixel).expect("samples are followed within the tile")];
            record.samples == SETTLED && record.samples < self.job.settings.spp && {
                let mut exposure = self.first_sample(pixel);
                let contradicts = self.complete(pixel, &mut exposure);
                *record = PixelRecord { reason: record.reason, ..exposure.record() };
                contradicts
            }
        });
        self.contradicting = contradicting;
        self.contradicting.clear();
    }

    /// The first sample of a pixel of the tile, if it was traced.
    pub(super) fn first_sample(&self, pixel: [u32; 2]) -> Exposure {
        self.tile.probe(pixel).map_or(Exposure::default(), |p| Exposure::new(&p.probe.sample, p.misses))
    }

    /// Traces the rest of a pixel's samples; whether all of them contradict the first, or the first two. (Of an edge that two of
    /// four samples lie beyond, the first two may be one on each side.)
    fn complete(&mut self, pixel: [u32; 2], exposure: &mut Exposure) -> bool {
        let (pixels, spp) = (self.job.pixels(), self.job.settings.spp);
        let first = self.first_sample(pixel).mean();
        pixels.expose(&mut self.shader, pixel, exposure, SETTLED);
        let two = exposure.mean();
        pixels.expose(&mut self.shader, pixel, exposure, spp);
        [first, two].iter().any(|&mean| display_difference(mean, exposure.mean()) > 0.5 * self.job.edge())
    }

    /// Traces a second sample of a pixel; whether it agrees with the first: what is smaller than a pixel, neighbours do not show.
    fn is_confirmed(&mut self, pixel: [u32; 2], exposure: &mut Exposure) -> bool {
        let first = exposure.mean();
        self.job.pixels().expose(&mut self.shader, pixel, exposure, SETTLED);
        display_difference(first, exposure.mean()) <= 0.5 * self.job.settings.tolerance
    }

    /// Whether a traced pixel and those around it, all of the tile, are alike.
    fn is_even(&self, pixel: [u32; 2]) -> bool {
        let Some(own) = self.tile.probe(pixel) else { return false };
        let is_alike = |beside| match self.tile.probe(beside) {
            Some(other) => self.is_alike(own, other),
            None => matches!(self.tile.find(beside).1, Cell::Holds { .. }),
        };
        let area = self.tile.area();
        // What reaches a pixel and was not seen in it is thin: samples that miss cost little, so that background is never even.
        around(area, pixel, 1).count() == 9
            && around(area, pixel, 1).all(is_alike)
            && own.probe.smooth.is_some_and(|own| self.shows_no_edge_of_pattern(pixel, own.mesh))
    }

    /// Whether the mesh that a pixel and those around it show has no pattern, or all their centres, between which the pixel's
    /// samples lie, are on one square of it.
    fn shows_no_edge_of_pattern(&self, pixel: [u32; 2], mesh: MeshId) -> bool {
        let position = |pixel: [u32; 2]| {
            let smooth = self.tile.probe(pixel)?.probe.smooth?;
            let center = DVec2::from(pixel.map(f64::from)) + 0.5;
            Some(self.job.position(center, smooth.inverse_depth).0)
        };
        let has_one_color = |beside| {
            let ends = position(pixel).zip(position(beside));
            ends.is_some_and(|(from, to)| self.job.appearance.has_one_color(mesh, from, to))
        };
        !self.job.appearance.is_patterned(mesh) || around(self.tile.area(), pixel, 1).all(has_one_color)
    }

    /// Whether samples between two pixels are like those at their centres, as far as one can tell: a pixel reaches half way to
    /// the next, so that twice the tolerance may lie between them. Light that took another way, though in the same colour,
    /// tells of an edge nearby.
    fn is_alike(&self, a: &TracedProbe, b: &TracedProbe) -> bool {
        a.probe.trail() == b.probe.trail() && a.shown.difference(b.shown) <= 2.0 * self.job.settings.tolerance
    }
}
