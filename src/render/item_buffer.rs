//! The item buffer: which patch is seen at each pixel's centre, without tessellating anything.
//!
//! Every patch stands in as a **proxy**, the bilinear quad of its four limit corners, cut into two triangles like a
//! cell of a grid. With `facets` above 1 a proxy is finer: the quads of the uniformly subdivided patch, each an item of
//! its own, as in the thesis. Threads take patches and write pixels with an atomic minimum over (depth, item), so the
//! buffer is the same for any number of threads and any order.
//!
//! Weghorst, Hooper and Greenberg, "Improved computational methods for ray tracing", 1984 (the item buffer); Ke 2017.

use super::patches::PatchNumbers;
use super::settings::RenderSettings;
use crate::error::{Error, Result};
use crate::ids::PatchId;
use crate::scene::camera::Camera;
use crate::scene::world::{World, WorldMesh};
use crate::subdiv::Dicer;
use glam::{DVec2, DVec3};
use std::sync::atomic::{AtomicU64, Ordering};

/// Depth of the plane that proxies are clipped at, in distances between the eye and what it looks at.
const NEAR: f64 = 1e-6;

/// Nothing is nearer.
const EMPTY: u64 = u64::MAX;

/// Items at all pixels of a whole picture, row by row.
pub struct ItemBuffer {
    width: usize,
    /// Depth's bits above the item's number: the order of these integers is that of (depth, item).
    pixels: Vec<AtomicU64>,
}

/// What one thread needs.
struct Rasteriser<'a> {
    buffer: &'a ItemBuffer,
    camera: &'a Camera,
    size: [u32; 2],
    facets: u32,
    dicer: Dicer,
    /// View-space vertices of the proxy at work.
    vertices: Vec<DVec3>,
}

impl ItemBuffer {
    /// Rasterises the proxies of all patches, cut into `facets` by `facets` items each.
    pub fn new(world: &World, camera: &Camera, settings: &RenderSettings, facets: u32, threads: usize) -> Result<Self> {
        let numbers = PatchNumbers::new(world);
        let numbers = numbers.filter(|n| n.len().checked_mul(facets * facets).is_some());
        let numbers =
            numbers.ok_or_else(|| Error::input("groups need ids for more than 2^32 patches: use --groups off"))?;
        let [width, height] = settings.size.map(|n| n as usize);
        let buffer = Self { width, pixels: (0..width * height).map(|_| AtomicU64::new(EMPTY)).collect() };
        let new = || Rasteriser {
            buffer: &buffer,
            camera,
            size: settings.size,
            facets,
            dicer: Dicer::default(),
            vertices: Vec::new(),
        };
        numbers.for_each(world, threads, new, |rasteriser, mesh, patch| {
            let first_item = numbers.number(mesh, patch) * facets * facets;
            rasteriser.patch(world.mesh(mesh), patch, first_item);
        });
        Ok(buffer)
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of pixels.
    pub fn n_pixels(&self) -> usize {
        self.pixels.len()
    }

    /// The item at a pixel, counted row by row; `None` where no proxy is seen.
    pub fn item(&self, pixel: usize) -> Option<u32> {
        let bits = self.pixels[pixel].load(Ordering::Relaxed);
        (bits != EMPTY).then_some(bits as u32)
    }

    fn put(&self, pixel: usize, depth: f64, item: u32) {
        let bits = u64::from((depth as f32).to_bits()) << 32 | u64::from(item);
        self.pixels[pixel].fetch_min(bits, Ordering::Relaxed);
    }
}

impl Rasteriser<'_> {
    fn patch(&mut self, mesh: &WorldMesh, patch: PatchId, first_item: u32) {
        self.evaluate(mesh, patch);
        let n = self.facets as usize;
        for j in 0..n {
            for i in 0..n {
                let at = |di: usize, dj: usize| self.vertices[(j + dj) * (n + 1) + i + di];
                let item = first_item + (j * n + i) as u32;
                self.triangle([at(0, 0), at(1, 0), at(0, 1)], item);
                self.triangle([at(1, 1), at(0, 1), at(1, 0)], item);
            }
        }
    }

    fn evaluate(&mut self, mesh: &WorldMesh, patch: PatchId) {
        self.vertices.clear();
        let (surface, n) = (mesh.surface(), self.facets);
        for j in 0..=n {
            for i in 0..=n {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                let object = surface.lattice().to_object(self.dicer.sample(surface, patch, u, v).position);
                let world = mesh.world_from_object().transform_point3(object);
                self.vertices.push(self.camera.view_from_world(world));
            }
        }
    }

    /// Clips at the near plane and fills what is left, a triangle or a quad.
    fn triangle(&self, corners: [DVec3; 3], item: u32) {
        let near = NEAR * self.camera.focus_distance();
        let mut clipped = [DVec3::ZERO; 4];
        let mut n = 0;
        let mut push = |p| {
            clipped[n] = p;
            n += 1;
        };
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a.z >= near {
                push(a);
            }
            if (a.z >= near) != (b.z >= near) {
                push(a.lerp(b, (near - a.z) / (b.z - a.z)));
            }
        }
        if n >= 3 {
            self.fill([clipped[0], clipped[1], clipped[2]], item);
        }
        if n == 4 {
            self.fill([clipped[0], clipped[2], clipped[3]], item);
        }
    }

    /// All pixels whose centres lie in the triangle, borders included.
    fn fill(&self, corners: [DVec3; 3], item: u32) {
        let [a, b, c] = corners.map(|p| self.camera.raster_from_view(p, self.size));
        let area = (b - a).perp_dot(c - a);
        // Inverse depth is linear over the picture.
        let inverse_depth = corners.map(|p| 1.0 / p.z);
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        let [x, y] =
            [(min.x, max.x, self.size[0]), (min.y, max.y, self.size[1])].map(|(min, max, n)| centres(min, max, n));
        if area == 0.0 || !area.is_finite() {
            return;
        }
        for row in y.clone() {
            for column in x.clone() {
                let p = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                let w = [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)].map(|w| w / area);
                if w.iter().all(|&w| w >= 0.0) {
                    let inverse = w[0] * inverse_depth[0] + w[1] * inverse_depth[1] + w[2] * inverse_depth[2];
                    self.buffer.put(row * self.buffer.width + column, 1.0 / inverse, item);
                }
            }
        }
    }
}

/// Pixels out of `n` whose centres lie in `min..=max`.
fn centres(min: f64, max: f64, n: u32) -> std::ops::Range<usize> {
    // Casts take what is below 0 to 0.
    (min - 0.5).ceil() as usize..((max - 0.5).floor() + 1.0).clamp(0.0, f64::from(n)) as usize
}
