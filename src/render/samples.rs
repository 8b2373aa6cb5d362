//! Several samples a pixel, and few where they would be alike.
//!
//! Of every pixel that is not interpolated the first sample is traced, before any other. Where it is **even** with those
//! around it, in colour and in the way that its light took, a second one decides: if that agrees, the pixel is **settled**
//! with two. All others take every sample. What is thinner than a pixel may lie between the first two samples of some pixels
//! along it, but not of all: where all samples of a pixel contradict its first two, the settled pixels beside it take every
//! sample as well, and so on along the line, as edges are followed into groups.
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
use glam::Vec3;

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

    /// Traces two samples of a pixel that has more; whether they are alike and show the colour that was expected.
    pub(super) fn bears_out(&mut self, pixel: [u32; 2], expected: Vec3, exposure: &mut Exposure) -> bool {
        self.job.settings.spp > SETTLED
            && self.is_confirmed(pixel, exposure)
            && display_difference(expected, exposure.mean()) <= 0.5 * self.job.edge()
    }

    /// The first sample of a pixel of the tile, if it was traced.
    pub(super) fn first_sample(&self, pixel: [u32; 2]) -> Exposure {
        self.tile.probe(pixel).map_or(Exposure::default(), |p| Exposure::new(&p.probe.sample, p.misses))
    }

    /// Traces the rest of a pixel's samples; whether all of them contradict the first two.
    fn complete(&mut self, pixel: [u32; 2], exposure: &mut Exposure) -> bool {
        let (pixels, spp) = (self.job.pixels(), self.job.settings.spp);
        pixels.expose(&mut self.shader, pixel, exposure, SETTLED);
        let first = exposure.mean();
        pixels.expose(&mut self.shader, pixel, exposure, spp);
        display_difference(first, exposure.mean()) > 0.5 * self.job.edge()
    }

    /// Traces a second sample of a pixel; whether it agrees with the first: what is smaller than a pixel, neighbours do not show.
    fn is_confirmed(&mut self, pixel: [u32; 2], exposure: &mut Exposure) -> bool {
        let first = exposure.mean();
        self.job.pixels().expose(&mut self.shader, pixel, exposure, SETTLED);
        display_difference(first, exposure.mean()) <= 0.5 * self.job.settings.tolerance
    }

    /// Whether a traced pixel and those around it, all of the tile, are alike.
    fn is_even(&self, [x, y]: [u32; 2]) -> bool {
        let Some(own) = self.tile.probe([x, y]) else { return false };
        let around = (0..9).map(|k| [(x + k % 3).checked_sub(1), (y + k / 3).checked_sub(1)]);
        around.into_iter().all(|place| match place {
            [Some(x), Some(y)] if self.tile.has([x, y]) => match (self.tile.probe([x, y]), self.tile.find([x, y]).1) {
                (Some(other), _) => self.is_alike(own, other),
                (None, cell) => matches!(cell, Cell::Holds { .. }),
            },
            _ => false,
        })
    }

    /// Whether samples between two pixels are like those at their centres, as far as one can tell: a pixel reaches half way to
    /// the next, so that twice the tolerance may lie between them. Light that took another way, though in the same colour,
    /// tells of an edge nearby.
    fn is_alike(&self, a: &TracedProbe, b: &TracedProbe) -> bool {
        a.probe.trail() == b.probe.trail() && a.shown.difference(b.shown) <= 2.0 * self.job.settings.tolerance
    }
}
