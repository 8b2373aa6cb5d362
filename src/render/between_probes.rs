//! Pixels between probes.
//!
//! What of four probes varies smoothly (depth, normal, light from reflections) is interpolated for a pixel between
//! them; direct light is computed again for it. An [`Interpolation`] has what that needs, a picture's camera,
//! appearance and settings, and nothing that could trace a ray.

use super::cells::{CELL_SIDES, Cell, CellPlace, Tile, TracedProbe};
use super::film::{FirstHit, PixelRecord};
use super::follow::Shown;
use super::integrators::{LightMasks, Probe, Smooth, SmoothPoint};
use super::reason::Reason;
use super::sampler::subpixel;
use super::settings::{Appearance, RenderSettings, RunSettings};
use super::tracer::Built;
use super::workers::PixelTracer;
use crate::ids::MeshId;
use crate::scene::camera::Camera;
use crate::scene::description::IntegratorKind;
use glam::{DVec2, DVec3, Vec2, Vec3};

/// Steps from one pixel to the next, in display units, that are followed whatever the tolerance: an edge may begin
/// faintly. With
/// 0.04, trex at 10/255 lost a shadow; 0.01 takes 8 % more rays there, and 3 % at 5/255.
const MAX_EDGE: f32 = 0.01;

/// How much further from the interpolation a surface may be than it was where that was checked, as far as patterns are
/// concerned: facets have kinks. With 1, a globe of the tests had a sample on the wrong square.
const DOUBTS: f32 = 2.0;

/// What rounding makes of an interpolated depth, relative to it: probes have it in single precision.
const DEPTH_ROUNDING: f32 = 4.0 * f32::EPSILON;

/// The corners among a cell's nine probes, in the order (0,0), (1,0), (1,1), (0,1), and the others with their places.
const CORNERS: [usize; 4] = [0, 2, 8, 6];
const MIDDLES: [(usize, Vec2); 5] = [
    (1, Vec2::new(0.5, 0.0)),
    (3, Vec2::new(0.0, 0.5)),
    (4, Vec2::new(0.5, 0.5)),
    (5, Vec2::new(1.0, 0.5)),
    (7, Vec2::new(0.5, 1.0)),
];

/// Turns probes into pixels; knows no tracer.
pub(super) struct Interpolation<'a> {
    pub run: &'a RunSettings<'a>,
    pub camera: &'a Camera,
    pub appearance: &'a Appearance,
    pub settings: &'a RenderSettings,
}

impl<'a> Interpolation<'a> {
    /// Whether tiles that were begun are not finished any more.
    pub fn is_given_up(&self) -> bool {
        self.run.gives_up_tiles(self.settings.spp)
    }

    pub fn is_possible(&self) -> bool {
        self.settings.integrator == IntegratorKind::Whitted && self.appearance.lights.len() <= LightMasks::CAPACITY
    }

    /// The smallest step that is followed, in display units.
    pub fn edge(&self) -> f32 {
        self.settings.tolerance.min(MAX_EDGE)
    }

    pub fn background(&self) -> PixelRecord {
        PixelRecord::background(self.appearance.background.to_array())
    }

    pub fn pixels(&self) -> PixelTracer<'a> {
        PixelTracer { camera: self.camera, settings: self.settings }
    }

    /// The largest differences between a cell's probes and what its corners predict of them.
    pub fn prediction_errors(&self, place: &CellPlace, probes: &[&TracedProbe; 9], smooths: &[&Smooth; 9]) -> Errors {
        let corners = Corners::new(CORNERS.map(|k| &probes[k].probe), CORNERS.map(|k| smooths[k]));
        let side = f64::from(place.side);
        let mut errors = Errors { color: 0.0, depth: 0.0 };
        for (k, uv) in MIDDLES {
            let raster = DVec2::new(f64::from(place.x), f64::from(place.y)) + side * uv.as_dvec2() + 0.5;
            let expected = Shown::new(self.radiance(&corners, uv, raster));
            errors.color = errors.color.max(probes[k].shown.difference(expected));
            let depth = 1.0 / corners.inverse_depth(bilinear_weights(uv));
            errors.depth = errors.depth.max((depth - 1.0 / smooths[k].inverse_depth).abs());
        }
        errors
    }

    /// A pixel of a cell that holds, if a probe was traced for it.
    pub fn probed(&self, tile: &Tile, place: &CellPlace, pixel: [u32; 2]) -> Option<PixelRecord> {
        let TracedProbe { probe, misses, .. } = tile.probe(pixel)?;
        let mesh = probe.smooth?.mesh;
        if self.settings.spp > 1 && self.appearance.is_patterned(mesh) {
            return None;
        }
        let is_corner = pixel[0] == place.x && pixel[1] == place.y;
        Some(PixelRecord {
            color: probe.sample.radiance.to_array(),
            samples: 1,
            first: probe.sample.first,
            misses: *misses,
            group: self.group(place),
            reason: if is_corner { Reason::Corner } else { Reason::Probe },
            error: 0.0,
        })
    }

    /// A number for a cell: where it begins, in units of the smallest.
    fn group(&self, place: &CellPlace) -> u32 {
        let unit = CELL_SIDES[CELL_SIDES.len() - 1];
        place.y / unit * self.settings.size[0].div_ceil(unit) + place.x / unit
    }

    /// A pixel of a cell that holds, from the four nearest probes.
    pub fn pixel(&self, tile: &Tile, pixel: [u32; 2]) -> PixelRecord {
        let (place, cell) = tile.find(pixel);
        let nearest = Nearest::new(tile, &place, pixel);
        let rasters = self.rasters(&nearest.corners, pixel);
        let n = rasters.len() as f32;
        let sum: Vec3 = rasters.map(|raster| self.radiance(&nearest.corners, nearest.place(raster), raster)).sum();
        let error = if let Cell::Holds { error, .. } = cell { error } else { 0.0 };
        PixelRecord {
            color: (sum / n).to_array(),
            samples: 0,
            first: nearest.corners.first_hit(nearest.place(DVec2::from(pixel.map(f64::from)) + 0.5)),
            misses: Built::default(),
            group: self.group(&place),
            reason: Reason::Interpolated,
            error,
        }
    }

    /// Where a pixel of a cell that holds is interpolated: several times where a pattern may be finer than it.
    fn rasters(&self, corners: &Corners<'_>, pixel: [u32; 2]) -> impl ExactSizeIterator<Item = DVec2> + use<> {
        let n = if self.appearance.is_patterned(corners.mesh()) { self.settings.spp } else { 1 };
        (0..n).map(move |i| DVec2::from(pixel.map(f64::from)) + subpixel(i))
    }

    /// Whether some sample of a pixel of a cell that holds lies so near the edge of a pattern that it may be beyond:
    /// the ray is known, and how far along it the surface is only as well as the probes' tangent planes agree with the
    /// interpolation, and not better than `DOUBTS` times `doubt`, a depth. Where colours themselves are interpolated,
    /// those of the probes have to be of the same square.
    pub fn may_show_edge_of_pattern(&self, tile: &Tile, place: &CellPlace, pixel: [u32; 2], doubt: f32) -> bool {
        let nearest = Nearest::new(tile, place, pixel);
        let corners = &nearest.corners;
        if !self.appearance.is_patterned(corners.mesh()) {
            return false;
        }
        let has_one_color = |from, to| self.appearance.has_one_color(corners.mesh(), from, to);
        let rasters = nearest.rasters();
        let probes: [(DVec3, DVec3); 4] = std::array::from_fn(|k| {
            let smooth = corners.smooths[k];
            (self.position(rasters[k], smooth.inverse_depth).0, smooth.normal.as_dvec3())
        });
        let is_mixed =
            |position| !self.appearance.can_reshade() && probes.iter().any(|probe| !has_one_color(position, probe.0));
        self.rasters(corners, pixel).any(|raster| {
            let inverse_depth = corners.inverse_depth(bilinear_weights(nearest.place(raster)));
            let (position, along) = self.position(raster, inverse_depth);
            let to_plane = |(probe, normal): &(DVec3, DVec3)| (*probe - position).dot(*normal) / along.dot(*normal);
            let least = f64::from(DOUBTS * doubt + DEPTH_ROUNDING / inverse_depth);
            let reach = probes.iter().map(|probe| to_plane(probe).abs()).fold(least, f64::max) * along;
            !has_one_color(position - reach, position + reach) || is_mixed(position)
        })
    }

    /// Radiance at (u, v) between four probes, seen at `raster`.
    fn radiance(&self, corners: &Corners<'_>, uv: Vec2, raster: DVec2) -> Vec3 {
        let weights = bilinear_weights(uv);
        if !self.appearance.can_reshade() {
            return corners.mix(weights, |probe, _| probe.sample.radiance);
        }
        let (position, along) = self.position(raster, corners.inverse_depth(weights));
        let point = SmoothPoint {
            mesh: corners.mesh(),
            position,
            normal: corners.normal(weights),
            to_eye: -along.normalize().as_vec3(),
            blocked: corners.blocked,
        };
        self.appearance.local_radiance(&point) + corners.mix(weights, |_, smooth| smooth.secondary)
    }

    /// The point of world space that is seen at `raster` so deep, and the way that the ray goes in a unit of depth.
    pub fn position(&self, raster: DVec2, inverse_depth: f32) -> (DVec3, DVec3) {
        let direction = self.camera.ray(raster, self.settings.size).direction;
        let along = direction / direction.dot(self.camera.forward());
        (self.camera.eye() + along / f64::from(inverse_depth), along)
    }
}

fn bilinear_weights(uv: Vec2) -> [f32; 4] {
    let (u, v) = (uv.x, uv.y);
    [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v]
}

/// How far probes are from what others predict: in display units, and in depth along the camera's forward direction.
pub(super) struct Errors {
    pub color: f32,
    pub depth: f32,
}

/// The four probes nearest to a pixel of a cell that holds.
struct Nearest<'p> {
    corners: Corners<'p>,
    /// The pixel of the first, and how far apart they are.
    origin: DVec2,
    side: f64,
}

impl<'p> Nearest<'p> {
    fn new(tile: &'p Tile, place: &CellPlace, pixel: [u32; 2]) -> Self {
        let half = place.side / 2;
        let [x, y] = pixel.map(|n| n - n % half);
        let nearest = [[x, y], [x + half, y], [x + half, y + half], [x, y + half]];
        let probes = nearest.map(|p| &tile.probe(p).expect("a cell that holds has all its probes").probe);
        let smooths = probes.map(|p| p.smooth.as_ref().expect("a cell that holds shows surface everywhere"));
        Self {
            corners: Corners::new(probes, smooths),
            origin: DVec2::new(f64::from(x), f64::from(y)),
            side: f64::from(half),
        }
    }

    /// Where they are in the picture.
    fn rasters(&self) -> [DVec2; 4] {
        [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|uv| self.origin + self.side * uv + 0.5)
    }

    /// Where a place of the picture lies between them.
    fn place(&self, raster: DVec2) -> Vec2 {
        ((raster - 0.5 - self.origin) / self.side).as_vec2()
    }
}

/// Four probes that span a square, in the order (0,0), (1,0), (1,1), (0,1).
struct Corners<'p> {
    probes: [&'p Probe; 4],
    smooths: [&'p Smooth; 4],
    blocked: u64,
}

impl<'p> Corners<'p> {
    fn new(probes: [&'p Probe; 4], smooths: [&'p Smooth; 4]) -> Self {
        let blocked = smooths.iter().fold(0, |all, s| all | s.lights.blocked);
        Self { probes, smooths, blocked }
    }

    fn mesh(&self) -> MeshId {
        self.smooths[0].mesh
    }

    fn mix(&self, weights: [f32; 4], value: impl Fn(&Probe, &Smooth) -> Vec3) -> Vec3 {
        (0..4).map(|k| weights[k] * value(self.probes[k], self.smooths[k])).sum()
    }

    fn inverse_depth(&self, weights: [f32; 4]) -> f32 {
        (0..4).map(|k| weights[k] * self.smooths[k].inverse_depth).sum()
    }

    fn normal(&self, weights: [f32; 4]) -> Vec3 {
        self.mix(weights, |_, smooth| smooth.normal).normalize_or(self.smooths[0].normal)
    }

    /// Depth and normal between the probes; patch and parameters are those of the nearest probe.
    fn first_hit(&self, uv: Vec2) -> FirstHit {
        let weights = bilinear_weights(uv);
        let nearest = (0..4).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).expect("there are four");
        let outwards = if self.smooths[0].outside { 1.0 } else { -1.0 };
        FirstHit {
            depth: 1.0 / self.inverse_depth(weights),
            normal: (outwards * self.normal(weights)).to_array(),
            ..self.probes[nearest].sample.first
        }
    }
}
