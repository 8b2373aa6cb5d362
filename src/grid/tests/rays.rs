//! Rays of every length and from everywhere.

use super::support::{Piece, Random, whole};
use crate::grid::{LatticeHit, LatticeRay, TriangleId};
use crate::ids::PatchId;
use crate::math::simd::Portable;
use glam::DVec3;

/// A flat cell at z = 1000, a million steps wide, around the z axis.
fn square() -> Piece {
    Piece::new(
        &[[-500_000, -500_000, 1000], [500_000, -500_000, 1000], [-500_000, 500_000, 1000], [500_000, 500_000, 1000]],
        whole(1, 1),
    )
}

/// t of the hit in the caller's units.
fn t_of_hit(origin: DVec3, direction: DVec3, t_max: f32) -> Option<f32> {
    let ray = LatticeRay::new(origin, direction, t_max, TriangleId::NONE);
    let mut hit = LatticeHit::none(ray.t_max());
    let is_hit = square().view().closest(Portable, &ray, PatchId(0), &mut hit);
    assert_eq!(is_hit, square().view().occluded(Portable, &ray, PatchId(0)));
    is_hit.then(|| ray.caller_t(hit.t))
}

#[test]
fn t_is_in_the_caller_s_units_for_directions_of_any_length() {
    for exponent in [-1000, -300, -126, -60, -1, 0, 1, 60, 127] {
        let length = f64::powi(2.0, exponent);
        let t = t_of_hit(DVec3::new(10.0, 20.0, 0.0), DVec3::Z * length, f32::INFINITY).expect("a hit");
        let expected = (1000.0 / length).min(f64::from(f32::MAX));
        assert!((f64::from(t) - expected).abs() <= 1.2e-7 * expected, "length 2^{exponent}: {t}");
    }
    assert_eq!(t_of_hit(DVec3::ZERO, DVec3::Z * 1e300, f32::INFINITY), Some(0.0));
}

#[test]
fn zeros_of_both_signs_hit_alike() {
    for (x, y) in [(0.0, 0.0), (-0.0, 0.0), (0.0, -0.0), (-0.0, -0.0), (1e-300, -1e-300)] {
        for origin in [DVec3::ZERO, DVec3::new(-500_000.0, 0.0, 0.0), DVec3::new(500_000.0, 500_000.0, 0.0)] {
            assert_eq!(t_of_hit(origin, DVec3::new(x, y, 1.0), f32::INFINITY), Some(1000.0), "{x} {y} {origin}");
            assert_eq!(t_of_hit(origin, DVec3::new(x, y, -1.0), f32::INFINITY), None);
        }
        assert_eq!(t_of_hit(DVec3::new(500_001.0, 0.0, 0.0), DVec3::new(x, y, 1.0), f32::INFINITY), None);
    }
}

#[test]
fn both_ends_of_a_ray_belong_to_it() {
    let up = DVec3::Z;
    assert_eq!(t_of_hit(DVec3::ZERO, up, 1000.0), Some(1000.0));
    assert_eq!(t_of_hit(DVec3::ZERO, up, 1000.0f32.next_down()), None);
    assert_eq!(t_of_hit(1000.0 * up, up, 0.0), Some(0.0));
    assert_eq!(t_of_hit(1001.0 * up, up, f32::INFINITY), None);
}

#[test]
fn a_ray_from_very_far_hits_where_it_should() {
    for distance in [1e8, 1e12, 1e30, 1e38] {
        let t = t_of_hit(DVec3::new(3.0, 4.0, -distance), DVec3::Z, f32::INFINITY).expect("a hit");
        assert!((f64::from(t) - distance - 1000.0).abs() <= 1e-7 * distance, "{distance}: {t}");
        assert_eq!(t_of_hit(DVec3::new(3.0, 4.0, -distance), DVec3::Z, 0.9 * distance as f32), None);
        assert_eq!(t_of_hit(DVec3::new(3.0, 4.0, -distance), -DVec3::Z, f32::INFINITY), None);
        assert_eq!(t_of_hit(DVec3::new(distance, 4.0, 0.0), DVec3::Z, f32::INFINITY), None);
    }
}

#[test]
fn a_ray_that_is_none_hits_nothing() {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for x in bad {
        assert_eq!(t_of_hit(DVec3::new(x, 0.0, 0.0), DVec3::Z, f32::INFINITY), None);
        assert_eq!(t_of_hit(DVec3::ZERO, DVec3::new(x, 0.0, 1.0), f32::INFINITY), None);
    }
    assert_eq!(t_of_hit(DVec3::ZERO, DVec3::ZERO, f32::INFINITY), None);
    assert_eq!(t_of_hit(DVec3::ZERO, DVec3::Z, -1.0), None);
    assert_eq!(t_of_hit(DVec3::ZERO, DVec3::Z, f32::NAN), None);
}

#[test]
fn one_in_so_many_rays_is_picked_of_those_from_one_point_and_of_those_along_one_direction() {
    let mut random = Random(0x01_1e32);
    let share = |rays: &[LatticeRay]| rays.iter().filter(|ray| ray.is_one_in(32)).count();
    let ray = |origin, direction| LatticeRay::new(origin, direction, f32::INFINITY, TriangleId::NONE);
    for _ in 0..20 {
        let (origin, direction) = (random.point(1e6), random.point(1.0));
        let from_one: Vec<LatticeRay> = (0..3200).map(|_| ray(origin, random.point(1.0))).collect();
        let along_one: Vec<LatticeRay> = (0..3200).map(|_| ray(random.point(1e6), direction)).collect();
        assert!([&from_one, &along_one].into_iter().all(|rays| (50..200).contains(&share(rays))));
    }
}
