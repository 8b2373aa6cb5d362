//! What groups promise, checked against renders without them.

use super::*;
use crate::cache::CacheConfig;
use crate::image::display::display_value;
use crate::image::missed::{missed_ids, missed_objects};
use crate::math::{Hit, Intersect, PrimitiveRef, Ray};
use crate::mesh::ControlMesh;
use crate::render::adaptive::render_adaptive;
use crate::render::item_buffer::ItemBuffer;
use crate::render::thesis::{Interpolation, render_thesis};
use crate::scene::camera::Camera;
use crate::scene::description::{Albedo, CameraDescription, Light, Material};
use crate::scene::intersect::Intersector;
use crate::scene::rate::DicingRate;
use crate::scene::world::{GridCache, World, WorldMesh};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use parking_lot::Mutex;
use std::sync::atomic::AtomicBool;

mod edges;
mod fuzz;

/// Meshes with materials, lights, and a camera.
struct Stage {
    world: World,
    appearance: Appearance,
    camera: Camera,
}

fn cube() -> ControlMesh {
    let corner = |k: usize| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64) * 2.0 - 1.0;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    ControlMesh::from_polygons((0..8).map(corner).collect(), &faces.map(Vec::from)).unwrap()
}

fn floor() -> ControlMesh {
    let corner = |x: f64, z: f64| DVec3::new(x, -1.0, z);
    let corners = vec![corner(-9.0, -9.0), corner(-9.0, 9.0), corner(9.0, 9.0), corner(9.0, -9.0)];
    ControlMesh::from_polygons(corners, &[vec![0, 1, 2, 3]]).unwrap()
}

impl Stage {
    /// A ball that mirrors a little, on a floor, and specks above it.
    fn new(eye: DVec3, specks: &[DAffine3], floor_material: Material) -> Self {
        let mesh = |mesh: ControlMesh, place| WorldMesh::new(mesh, place, DicingRate::Fixed(16), 1).unwrap();
        let mut meshes = vec![mesh(cube(), DAffine3::IDENTITY), mesh(floor(), DAffine3::from_scale(DVec3::splat(1.2)))];
        meshes.extend(specks.iter().map(|&place| mesh(cube(), place)));
        let mut materials = vec![Material::default(); meshes.len()];
        materials[0].mirror = Vec3::splat(0.2);
        materials[1] = floor_material;
        let key = Light::Point { position: DVec3::new(4.0, 7.0, 3.0), intensity: Vec3::splat(120.0) };
        let lights = vec![key, Light::Sky { radiance: Vec3::splat(0.2) }];
        let camera = CameraDescription { eye, at: DVec3::ZERO, up: DVec3::Y, fov: 40.0 };
        let background = Vec3::new(0.1, 0.2, 0.3);
        Self {
            world: World::new(meshes),
            appearance: Appearance::new(materials, lights, background),
            camera: Camera::new(&camera),
        }
    }

    fn plain() -> Self {
        Self::new(DVec3::new(1.0, 2.5, 6.0), &[], Material::default())
    }

    fn render(&self, settings: &RenderSettings, threads: usize) -> Rendered {
        let cache = GridCache::new(&self.world, CacheConfig::with_bytes(16 << 20)).unwrap();
        self.render_with(settings, threads, || Intersector::new(&self.world, &cache))
    }

    fn render_with<T: Tracer>(
        &self,
        settings: &RenderSettings,
        threads: usize,
        make_tracer: impl Fn() -> T + Sync,
    ) -> Rendered {
        let cancel = AtomicBool::new(false);
        let run = RunSettings::quiet(threads, &cancel);
        let Self { world, appearance, camera } = self;
        match settings.groups {
            Groups::Off => render(camera, appearance, settings, &run, make_tracer),
            Groups::Adaptive => render_adaptive(world, camera, appearance, settings, &run, make_tracer),
            Groups::Thesis => {
                let items = ItemBuffer::new(world, camera, settings, 1, threads).unwrap();
                render_thesis(camera, appearance, settings, &run, &items, Interpolation::Bilinear, make_tracer)
            }
        }
    }
}

fn settings(groups: Groups) -> RenderSettings {
    let aovs = vec![Aov::Mesh, Aov::Patch, Aov::Reason];
    RenderSettings { groups, aovs, tolerance: 4.0 / 255.0, ..RenderSettings::of_size([200, 140]) }
}

fn ids(film: &Film, aov: Aov) -> &[u32] {
    let Some(PlaneData::Id(ids)) = film.plane(aov) else { panic!("the plane was asked for") };
    ids
}

fn is_traced(reason: u32) -> bool {
    Reason::ALL[reason as usize].1.is_traced()
}

fn share_above(a: &Film, b: &Film, tolerance: f32) -> f64 {
    let display = |c: &[f32; 3]| c.map(display_value);
    let differs = |(a, b): &(&[f32; 3], &[f32; 3])| {
        let (a, b) = (display(a), display(b));
        (0..3).any(|c| (a[c] - b[c]).abs() > tolerance)
    };
    a.colors().iter().zip(b.colors()).filter(differs).count() as f64 / a.colors().len() as f64
}

/// Remembers the camera rays that a tracer was asked about.
struct Witness<'a, T> {
    tracer: T,
    camera: &'a Camera,
    size: [u32; 2],
    seen: &'a Mutex<Vec<[u32; 2]>>,
}

impl<T: Tracer> Intersect for Witness<'_, T> {
    fn closest(&mut self, ray: &Ray) -> Option<Hit> {
        if ray.from.is_none() {
            let view = self.camera.view_from_world_vector(ray.direction);
            self.seen.lock().push(self.camera.raster_from_view(view, self.size).to_array().map(|x| x as u32));
        }
        self.tracer.closest(ray)
    }

    fn occluded(&mut self, ray: &Ray) -> bool {
        self.tracer.occluded(ray)
    }
}

impl<T: Tracer> Tracer for Witness<'_, T> {
    fn surface_point(&mut self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        self.tracer.surface_point(ray, hit)
    }

    fn patch_rate(&self, primitive: &PrimitiveRef) -> u32 {
        self.tracer.patch_rate(primitive)
    }

    fn misses(&self) -> Built {
        self.tracer.misses()
    }
}

/// All rays start at camera rays, and all grids are touched by rays: so what no camera ray was asked for touched no
/// grid.
#[test]
fn an_interpolated_pixel_touches_no_grid() {
    let stage = Stage::plain();
    let cache = GridCache::new(&stage.world, CacheConfig::with_bytes(16 << 20)).unwrap();
    // One tile: what lies right beside it is traced as a corner, but not shown.
    let settings = RenderSettings { size: [64, 64], window: PixelRect::whole([64, 64]), ..settings(Groups::Adaptive) };
    let seen = Mutex::new(Vec::new());
    let rendered = stage.render_with(&settings, 1, || Witness {
        tracer: Intersector::new(&stage.world, &cache),
        camera: &stage.camera,
        size: settings.size,
        seen: &seen,
    });
    let seen = seen.into_inner();
    assert!(!seen.is_empty());
    let reasons = ids(&rendered.film, Aov::Reason);
    for (pixel, &reason) in rendered.film.window().pixels().zip(reasons) {
        assert!(is_traced(reason) || !seen.contains(&pixel), "{pixel:?}");
    }
    assert!(rendered.pixels.of(Reason::Interpolated) > 100);
}

#[test]
fn threads_and_crops_do_not_change_a_bit() {
    let stage = Stage::plain();
    for groups in [Groups::Thesis, Groups::Adaptive] {
        let settings = settings(groups);
        let reference = stage.render(&settings, 1);
        let other = stage.render(&settings, 3);
        assert!(reference.complete && reference.film == other.film && reference.rays == other.rays, "{groups}");
        let window = PixelRect { x0: 30, y0: 41, x1: 131, y1: 99 };
        let crop = stage.render(&RenderSettings { window, ..settings }, 2).film;
        for (idx, pixel) in window.pixels().enumerate() {
            let whole = reference.film.colors()[reference.film.window().idx(pixel).unwrap()];
            assert_eq!(crop.colors()[idx], whole, "{groups} {pixel:?}");
        }
    }
}

#[test]
fn tolerance_zero_is_the_full_render() {
    let stage = Stage::plain();
    let [full, grouped] = [Groups::Off, Groups::Adaptive].map(|groups| {
        let settings = RenderSettings { tolerance: 0.0, spp: 2, ..settings(groups) };
        stage.render(&settings, 2).film
    });
    assert_eq!(full, grouped);
}

#[test]
fn what_is_traced_has_the_bits_of_the_full_render_and_the_rest_is_within_tolerance() {
    let checker = Albedo::Checker { even: Vec3::splat(0.8), odd: Vec3::splat(0.1), size: 1.0 };
    for (floor, spp) in [(Albedo::Constant(Vec3::splat(0.6)), 1), (checker, 1), (checker, 4)] {
        let stage = Stage::new(DVec3::new(1.0, 2.5, 6.0), &[], Material { diffuse: floor, ..Material::default() });
        let at = |groups| RenderSettings { spp, ..settings(groups) };
        let full = stage.render(&at(Groups::Off), 2);
        let grouped = stage.render(&at(Groups::Adaptive), 2);
        for (k, &reason) in ids(&grouped.film, Aov::Reason).iter().enumerate().filter(|_| spp == 1) {
            assert!(!is_traced(reason) || grouped.film.colors()[k] == full.film.colors()[k]);
        }
        let share = share_above(&full.film, &grouped.film, grouped_tolerance());
        assert!(share <= 0.01, "{share} at {spp} samples");
        assert!(grouped.rays.total() < full.rays.total());
    }
}

fn grouped_tolerance() -> f32 {
    settings(Groups::Adaptive).tolerance
}

#[test]
fn a_pixel_that_no_patch_reaches_is_background_from_wherever_one_looks() {
    // From afar, from just above the floor, from below it, and from inside of the ball.
    for eye in [[3.0, 4.0, 9.0], [5.0, -1.15, 0.5], [1.0, -6.0, 2.0], [0.2, 0.1, 0.3]] {
        let stage = Stage::new(DVec3::from(eye), &[], Material::default());
        let full = stage.render(&settings(Groups::Off), 2).film;
        let grouped = stage.render(&settings(Groups::Adaptive), 2).film;
        let meshes = ids(&full, Aov::Mesh);
        for (k, &reason) in ids(&grouped, Aov::Reason).iter().enumerate() {
            let is_background = Reason::ALL[reason as usize].1 == Reason::Background;
            assert!(!is_background || meshes[k] == FirstHit::NO_ID, "{eye:?}");
        }
        assert!(share_above(&full, &grouped, grouped_tolerance()) <= 0.01, "{eye:?}");
    }
}

#[test]
fn specks_of_a_pixel_are_not_lost() {
    let at = |k: u32| {
        let (x, z) = (f64::from(k % 12) * 0.73 - 4.0, f64::from(k / 12) * 0.91 - 4.0);
        let place = DVec3::new(x, -0.9 + 0.3 * f64::from(k % 5), z);
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.03), Default::default(), place)
    };
    let specks: Vec<_> = (0..96).map(at).collect();
    let stage = Stage::new(DVec3::new(1.0, 3.5, 9.0), &specks, Material::default());
    let full = stage.render(&settings(Groups::Off), 2).film;
    let grouped = stage.render(&settings(Groups::Adaptive), 2).film;
    let (reference, test) = (ids(&full, Aov::Mesh), ids(&grouped, Aov::Mesh));
    assert!((2..98).filter(|mesh| reference.contains(mesh)).count() > 20, "specks are seen at all");
    assert_eq!(missed_ids(200, reference, test, FirstHit::NO_ID), 0);
}

#[test]
fn proxies_show_the_patches_that_rays_hit_but_near_borders() {
    for eye in [[1.0, 2.5, 6.0], [5.0, 0.1, 0.5]] {
        let stage = Stage::new(DVec3::from(eye), &[], Material::default());
        let settings = settings(Groups::Off);
        let film = stage.render(&settings, 2).film;
        let [one, many] = [1, 3].map(|threads| {
            let items = ItemBuffer::new(&stage.world, &stage.camera, &settings, 8, threads).unwrap();
            (0..items.n_pixels()).map(|pixel| items.item(pixel)).collect::<Vec<_>>()
        });
        assert_eq!(one, many);
        let (meshes, patches) = (ids(&film, Aov::Mesh), ids(&film, Aov::Patch));
        let agree = |k: usize| {
            let expected = (meshes[k] != FirstHit::NO_ID).then(|| if meshes[k] == 0 { patches[k] } else { 6 });
            one[k].map(|item| item / 64) == expected
        };
        let n = (0..one.len()).filter(|&k| agree(k)).count();
        assert!(n * 100 > one.len() * 97, "{n} of {}", one.len());
    }
}

#[test]
fn the_published_algorithm_traces_corners_alone() {
    let stage = Stage::plain();
    let rendered = stage.render(&settings(Groups::Thesis), 2);
    let items = ItemBuffer::new(&stage.world, &stage.camera, &settings(Groups::Thesis), 1, 1).unwrap();
    let n_groups = groups::PixelGroups::new(&items).len() as u64;
    assert!(rendered.rays.primary <= 4 * n_groups && rendered.rays.primary == rendered.pixels.of(Reason::Corner));
}

#[test]
fn crowds_of_patches_are_traced_and_show_what_they_show_without_groups() {
    let at = |k: u32| {
        let place = DVec3::new(f64::from(k % 17) * 0.2 - 1.6, f64::from(k / 17) * 0.25 - 1.2, 2.0);
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.05), Default::default(), place)
    };
    let crowd: Vec<_> = (0..170).map(at).collect();
    let stage = Stage::new(DVec3::new(0.0, 0.5, 9.0), &crowd, Material::default());
    let size = [64, 64];
    let at = |groups| RenderSettings { size, window: PixelRect::whole(size), ..settings(groups) };
    let full = stage.render(&at(Groups::Off), 2);
    let grouped = stage.render(&at(Groups::Adaptive), 2);
    assert_eq!(full.film.colors(), grouped.film.colors());
    assert!(grouped.pixels.of(Reason::Every) > 1000 && grouped.pixels.of(Reason::Interpolated) == 0);
}

#[test]
fn edge_pixels_alone_get_more_samples_and_the_mean_stays_within_tolerance() {
    let stage = Stage::plain();
    let at = |groups| RenderSettings { spp: 16, ..settings(groups) };
    let full = stage.render(&at(Groups::Off), 2);
    let aovs = vec![Aov::Samples, Aov::Reason];
    let grouped = stage.render(&RenderSettings { aovs, ..at(Groups::Adaptive) }, 2);
    let share = share_above(&full.film, &grouped.film, grouped_tolerance());
    assert!(share <= 0.01, "{share}");
    let samples = ids(&grouped.film, Aov::Samples).iter().zip(ids(&grouped.film, Aov::Reason));
    for (&n, &reason) in samples {
        let expected: &[u32] = match Reason::ALL[reason as usize].1 {
            Reason::Interpolated | Reason::Background => &[0],
            Reason::Corner | Reason::Probe => &[1],
            _ => &[2, 16],
        };
        assert!(expected.contains(&n), "{n}");
    }
    assert!(grouped.rays.total() * 3 < full.rays.total(), "{} of {}", grouped.rays.total(), full.rays.total());
}

/// Thin rods on a floor that mirrors: footprints know the rods, but not where their shadows and images end. Once, every
/// second of them lost some of its length, some between the probes of a group, some beyond the side of a tile.
#[test]
fn what_is_thin_and_ends_between_probes_is_found_along_its_length() {
    let size = [320, 224];
    let display = |film: &Film| film.colors().iter().map(|c| c.map(display_value)).collect::<Vec<_>>();
    let (left, right) = (DVec3::new(-3.0, 7.0, 4.0), DVec3::new(1.0, 5.5, 6.0));
    for (thickness, eye) in [(0.06, left), (0.06, right), (0.04, left)] {
        let rods: Vec<_> = (0..28).map(|k| rod(k, thickness)).collect();
        let stage = Stage::new(eye, &rods, Material { mirror: Vec3::splat(0.5), ..Material::default() });
        for (tolerance, spp) in [(1.0, 1), (1.0, 4), (5.0, 1), (5.0, 4), (10.0, 1)].map(|(n, spp)| (n / 255.0, spp)) {
            let window = PixelRect::whole(size);
            let at = |groups| RenderSettings { size, window, tolerance, spp, ..settings(groups) };
            let [full, grouped] = [Groups::Off, Groups::Adaptive].map(|groups| stage.render(&at(groups), 2).film);
            let [a, b] = [&full, &grouped].map(display);
            let missed = [(&a, &b), (&b, &a)].map(|(a, b)| missed_objects(size[0] as usize, a, b));
            assert_eq!(missed, [0, 0], "{thickness} at {tolerance}, {spp} samples");
            assert!(
                share_above(&full, &grouped, tolerance) < if spp == 1 { 3e-4 } else { 5e-4 },
                "{thickness} at {tolerance}, {spp} samples"
            );
        }
    }
}

fn rod(k: u32, thickness: f64) -> DAffine3 {
    let place = DVec3::new(f64::from(k % 7) * 0.93 - 2.8, -0.3, f64::from(k / 7) * 1.17 - 1.0);
    let tilt = DQuat::from_rotation_x(0.3 * f64::from(k % 3) - 0.3) * DQuat::from_rotation_z(0.13 * f64::from(k % 5));
    DAffine3::from_scale_rotation_translation(DVec3::new(thickness, 1.0, thickness), tilt, place)
}
