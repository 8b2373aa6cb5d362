//! Scenes whose pictures are known in closed form.

use super::*;
use crate::render::analytic::{AnalyticTracer, Shape};
use crate::scene::description::{Albedo, Glass, Light, Material};
use glam::DVec3;
use std::f32::consts::PI;

fn lambert(albedo: f32) -> Material {
    Material { diffuse: Albedo::Constant(Vec3::splat(albedo)), specular: Vec3::ZERO, ..Material::default() }
}

fn clear(ior: f32) -> Material {
    Material { glass: Some(Glass { ior, transmit: Vec3::ONE }), ..lambert(0.0) }
}

fn settings(integrator: IntegratorKind) -> RenderSettings {
    RenderSettings { integrator, ..RenderSettings::of_size([1, 1]) }
}

fn sky(radiance: f32) -> Light {
    Light::Sky { radiance: Vec3::splat(radiance) }
}

const UNIT_SPHERE: Shape = Shape::Sphere(DVec3::ZERO, 1.0);

/// Mean radiance over `n` samples of the ray from `origin` along `direction`, and the rays it took.
fn gather(
    shapes: &[Shape],
    appearance: &Appearance,
    settings: &RenderSettings,
    (origin, direction): (DVec3, DVec3),
    n: u32,
) -> (Vec3, RayCounts) {
    let camera = crate::scene::description::CameraDescription { eye: origin, at: DVec3::ZERO, up: DVec3::X, fov: 40.0 };
    let mut tracer = AnalyticTracer { shapes: shapes.to_vec() };
    let mut shader = Shader::new(&mut tracer, appearance, settings);
    let ray = Ray::new(origin, direction);
    let mut sample = |i| shader.sample(&Camera::new(&camera), ray, Sampler::new(0, [0, 0], i)).radiance;
    let sum: Vec3 = (0..n).map(&mut sample).sum();
    (sum / n as f32, shader.rays())
}

fn radiance(shapes: &[Shape], appearance: &Appearance, kind: IntegratorKind, ray: (DVec3, DVec3), n: u32) -> f32 {
    gather(shapes, appearance, &settings(kind), ray, n).0.x
}

const DOWN: (DVec3, DVec3) = (DVec3::new(0.0, 5.0, 0.0), DVec3::NEG_Y);

#[test]
fn in_a_white_furnace_a_white_sphere_cannot_be_seen() {
    let appearance = Appearance::new(vec![lambert(1.0)], vec![sky(1.0)], Vec3::ONE);
    for kind in [IntegratorKind::Path, IntegratorKind::Whitted] {
        for x in [0.0, 0.5, 0.9, 2.0] {
            let ray = (DVec3::new(x, 5.0, 0.0), DVec3::NEG_Y);
            assert!((radiance(&[UNIT_SPHERE], &appearance, kind, ray, 4) - 1.0).abs() < 1e-6, "{kind:?} {x}");
        }
    }
}

#[test]
fn in_a_white_furnace_clear_glass_and_mirrors_cannot_be_seen() {
    let mirror = Material { mirror: Vec3::ONE, ..lambert(0.0) };
    for material in [clear(1.5), mirror] {
        let appearance = Appearance::new(vec![material], vec![], Vec3::ONE);
        for kind in [IntegratorKind::Path, IntegratorKind::Whitted] {
            let mut long = settings(kind);
            long.max_depth = 60;
            let (seen, _) = gather(&[UNIT_SPHERE], &appearance, &long, (DVec3::new(0.7, 5.0, 0.0), DVec3::NEG_Y), 4);
            assert!((seen.x - 1.0).abs() < 2e-3, "{kind:?} {}: {seen}", appearance.materials[0].name);
        }
    }
}

#[test]
fn between_grey_parallel_walls_paths_sum_the_geometric_series() {
    // Inside a sphere of albedo 1/2 around a point light every bounce adds half of the one before: direct light
    // E/π · 1/2, in all twice that. Roulette has to keep the mean.
    let intensity = Light::Point { position: DVec3::ZERO, intensity: Vec3::splat(PI) };
    let appearance = Appearance::new(vec![lambert(0.5)], vec![intensity], Vec3::ZERO);
    let mut long = settings(IntegratorKind::Path);
    long.max_depth = 1000;
    let inside = [Shape::Sphere(DVec3::ZERO, -1.0)];
    let (seen, _) = gather(&inside, &appearance, &long, (DVec3::new(0.0, 0.2, 0.0), DVec3::NEG_Y), 4000);
    assert!((seen.x - 1.0).abs() < 0.02, "{seen}");
}

#[test]
fn a_point_light_over_a_floor_obeys_lambert_and_the_inverse_square() {
    let light = Light::Point { position: DVec3::new(3.0, 4.0, 0.0), intensity: Vec3::splat(10.0) };
    let appearance = Appearance::new(vec![lambert(0.5)], vec![light], Vec3::ZERO);
    let expected = 0.5 / PI * 10.0 / 25.0 * 0.8;
    for kind in [IntegratorKind::Whitted, IntegratorKind::Path] {
        assert!((radiance(&[Shape::Floor(0.0)], &appearance, kind, DOWN, 1) - expected).abs() < 1e-6);
    }
}

#[test]
fn highlights_peak_where_the_half_vector_meets_the_normal() {
    let light = Light::Directional { direction: DVec3::NEG_Y, irradiance: Vec3::splat(8.0 * PI) };
    let glossy = Material { specular: Vec3::splat(0.1), shininess: 12.0, ..lambert(0.0) };
    let appearance = Appearance::new(vec![glossy], vec![light], Vec3::ZERO);
    let seen = radiance(&[Shape::Floor(0.0)], &appearance, IntegratorKind::Whitted, DOWN, 1);
    assert!((seen - 0.1 * (12.0 + 8.0)).abs() < 1e-5, "{seen}");
}

#[test]
fn shadows_are_hard_and_end_at_the_light() {
    let ball = Shape::Sphere(DVec3::new(0.0, 2.0, 0.0), 0.5);
    let light = |height| Light::Point { position: DVec3::new(0.0, height, 0.0), intensity: Vec3::splat(PI) };
    let seen = |height| {
        let appearance = Appearance::new(vec![lambert(1.0), lambert(1.0)], vec![light(height)], Vec3::ZERO);
        let ray = (DVec3::new(2.0, 1.0, 0.0), DVec3::new(-2.0, -1.0, 0.0));
        radiance(&[Shape::Floor(0.0), ball], &appearance, IntegratorKind::Whitted, ray, 1)
    };
    assert_eq!(seen(4.0), 0.0, "the ball stands before the light");
    assert!((seen(1.0) - 1.0).abs() < 1e-6, "the ball stands behind the light");
}

#[test]
fn shadows_of_clear_glass_let_most_light_pass() {
    let ball = Shape::Sphere(DVec3::new(0.0, 2.0, 0.0), 0.5);
    let light = Light::Directional { direction: DVec3::NEG_Y, irradiance: Vec3::splat(PI) };
    let appearance = Appearance::new(vec![lambert(1.0), clear(1.5)], vec![light], Vec3::ZERO);
    let ray = (DVec3::new(2.0, 1.0, 0.0), DVec3::new(-2.0, -1.0, 0.0));
    let seen = radiance(&[Shape::Floor(0.0), ball], &appearance, IntegratorKind::Whitted, ray, 1);
    assert!((seen - 0.96 * 0.96).abs() < 1e-5, "{seen}");
}

#[test]
fn a_mirror_sphere_shows_what_lies_in_the_mirrored_direction() {
    // Hit at 45 degrees from above, the sphere mirrors a ray from above into the horizontal, where a second ball glows
    // by its ambient light alone.
    let mirror = Material { mirror: Vec3::splat(0.5), ..lambert(0.0) };
    let appearance = Appearance::new(vec![mirror, lambert(1.0)], vec![sky(0.6)], Vec3::ZERO);
    let s = 0.5_f64.sqrt();
    let shapes = [UNIT_SPHERE, Shape::Sphere(DVec3::new(10.0, s, 0.0), 1.0)];
    let (seen, rays) =
        gather(&shapes, &appearance, &settings(IntegratorKind::Whitted), (DVec3::new(s, 5.0, 0.0), DVec3::NEG_Y), 1);
    assert!((seen.x - 0.3).abs() < 1e-6, "{seen}");
    assert_eq!(rays.reflection, 1);
}

#[test]
fn seen_from_within_glass_beyond_the_critical_angle_there_is_only_the_mirror() {
    let appearance = Appearance::new(vec![clear(1.5)], vec![], Vec3::ONE);
    let mut one_level = settings(IntegratorKind::Whitted);
    one_level.max_depth = 1;
    // From (0, 0.9, 0) level with the centre plane the ray meets the sphere at an angle with sine 0.9 > 1/1.5.
    let ray = (DVec3::new(0.0, 0.9, 0.0), DVec3::Z);
    let (_, rays) = gather(&[UNIT_SPHERE], &appearance, &one_level, ray, 1);
    assert_eq!((rays.reflection, rays.refraction), (1, 0));
    let (_, rays) = gather(&[UNIT_SPHERE], &appearance, &one_level, (DVec3::new(0.0, 0.5, 0.0), DVec3::Z), 1);
    assert_eq!((rays.reflection, rays.refraction), (1, 1));
}

#[test]
fn facing_mirrors_end_at_the_depth_limit() {
    let mirror = Material { mirror: Vec3::ONE, ..lambert(0.0) };
    let appearance = Appearance::new(vec![mirror], vec![], Vec3::ONE);
    let inside = [Shape::Sphere(DVec3::ZERO, -1.0)];
    for kind in [IntegratorKind::Whitted, IntegratorKind::Path] {
        let (_, rays) = gather(&inside, &appearance, &settings(kind), (DVec3::ZERO, DVec3::Y), 1);
        assert_eq!(rays, RayCounts { primary: 1, reflection: 8, ..RayCounts::default() });
    }
}

#[test]
fn an_open_floor_is_not_occluded_and_one_under_a_ball_by_its_solid_angle() {
    let appearance = Appearance::new(vec![lambert(0.3), lambert(0.3)], vec![], Vec3::ZERO);
    let ao = IntegratorKind::Ao;
    assert_eq!(radiance(&[Shape::Floor(0.0)], &appearance, ao, DOWN, 1), 1.0);
    // A ball whose centre is overhead hides the cosine-weighted share sin² of its angular radius: (1/2)².
    let ball = Shape::Sphere(DVec3::new(0.0, 4.0, 0.0), 2.0);
    let ray = (DVec3::new(2.0, 1.0, 0.0), DVec3::new(-2.0, -1.0, 0.0));
    let seen = radiance(&[Shape::Floor(0.0), ball], &appearance, ao, ray, 256);
    assert!((seen - 0.75).abs() < 2e-3, "{seen}");
}

#[test]
fn rays_that_meet_nothing_see_the_background() {
    let appearance = Appearance::new(vec![], vec![sky(1.0)], Vec3::new(0.1, 0.2, 0.3));
    for (_, kind) in IntegratorKind::ALL {
        let (seen, rays) = gather(&[], &appearance, &settings(kind), DOWN, 1);
        assert_eq!((seen, rays.total()), (Vec3::new(0.1, 0.2, 0.3), 1));
    }
}

#[test]
fn debug_pictures_show_what_they_are_named_for() {
    let appearance = Appearance::new(vec![lambert(1.0)], vec![], Vec3::ZERO);
    let see = |name: &str| gather(&[Shape::Floor(0.0)], &appearance, &settings(name.parse().unwrap()), DOWN, 1).0;
    assert_eq!(see("debug:normal"), Vec3::new(0.5, 1.0, 0.5));
    assert_eq!(see("debug:uv"), Vec3::new(0.5, 0.5, 0.0));
    assert_eq!(see("debug:depth"), Vec3::splat(0.5));
    assert_eq!(see("debug:rate"), crate::image::color_map::viridis(0.5));
    assert_eq!(see("debug:miss"), crate::image::color_map::viridis(0.0));
    assert!(see("debug:patch").min_element() >= 0.25);
}

#[test]
fn a_faint_mirror_reflects_little_unless_something_shines() {
    let sun = Light::Directional { direction: DVec3::NEG_Y, irradiance: Vec3::splat(2.5) };
    let lamp = Light::Point { position: DVec3::Y, intensity: Vec3::ONE };
    let faint = Material { mirror: Vec3::splat(0.07), ..Material::default() };
    let steel = Material { specular: Vec3::splat(0.7), shininess: 200.0, ..Material::default() };
    for (materials, light, expected) in [
        (vec![faint.clone()], &sun, true),
        (vec![faint.clone(), steel], &sun, false),
        (vec![faint], &lamp, false),
        (vec![lambert(0.5)], &lamp, true),
        (vec![clear(1.5)], &sun, false),
    ] {
        let appearance = Appearance::new(materials, vec![*light], Vec3::ZERO);
        assert_eq!(appearance.reflects_little(crate::ids::MeshId(0)), expected, "{:?}", appearance.materials);
    }
}
