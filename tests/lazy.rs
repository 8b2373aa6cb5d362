//! Lazy tracing answers as if everything had been tessellated beforehand, whatever the cache holds.

mod common;

use common::brute_force::BruteForce;
use common::random::Random;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use lazytess::cache::CacheConfig;
use lazytess::ids::MeshId;
use lazytess::math::{DBounds, Hit, Intersect, PrimitiveRef, Ray};
use lazytess::mesh::{ControlMesh, shapes};
use lazytess::render::Tracer;
use lazytess::scene::intersect::Intersector;
use lazytess::scene::rate::DicingRate;
use lazytess::scene::world::{GridCache, World, WorldMesh};

/// Triangle tests that a comparison may cost.
const BUDGET: usize = 1_000_000;

fn world_of(parts: Vec<(ControlMesh, DAffine3, DicingRate)>) -> World {
    World::new(parts.into_iter().map(|(mesh, place, rate)| WorldMesh::new(mesh, place, rate, 1).unwrap()).collect())
}

fn cache_of(world: &World, config: CacheConfig) -> GridCache {
    GridCache::new(world, config).unwrap()
}

/// Traces random rays and the ones that go on from their hits.
fn compare(name: &str, world: &World) {
    let truth = BruteForce::new(world);
    let caches = [CacheConfig::unbounded(64 << 20), CacheConfig::with_bytes(64 << 10), CacheConfig::with_bytes(0)]
        .map(|config| cache_of(world, config));
    let mut tracers = caches.each_ref().map(|cache| Intersector::new(world, cache));
    let bounds = world.meshes().iter().map(WorldMesh::bounds_in_world).fold(DBounds::EMPTY, DBounds::union);
    let n_rays = (BUDGET / truth.n_triangles().max(1)).clamp(20, 400);
    let (mut random, mut n_hits) = (Random(0x5eed_0001), 0);
    for i in 0..n_rays {
        let ray = random.ray(bounds);
        let hit = answer(name, i, &mut tracers, &truth, &ray);
        if let Some(hit) = hit {
            n_hits += 1;
            let origin = ray.origin + f64::from(hit.t) * ray.direction;
            let onward = Ray { from: Some(hit.primitive), ..Ray::new(origin, random.in_cube()) };
            answer(name, i, &mut tracers, &truth, &onward);
        }
    }
    assert!(n_hits > n_rays / 20, "{name}: only {n_hits} of {n_rays} rays hit anything, so little was compared");
}

/// The first tracer's answer, after checking that all agree and that it is right.
fn answer(name: &str, i: usize, tracers: &mut [Intersector<'_>], truth: &BruteForce<'_>, ray: &Ray) -> Option<Hit> {
    let hits: Vec<Option<Hit>> = tracers.iter_mut().map(|tracer| tracer.closest(ray)).collect();
    // Debug output names every bit of an f32.
    let told: Vec<String> = hits.iter().map(|hit| format!("{hit:?}")).collect();
    assert!(told.iter().all(|t| *t == told[0]), "{name}, ray {i}, {ray:?}: caches disagree: {told:#?}");
    for tracer in tracers {
        assert_eq!(tracer.occluded(ray), hits[0].is_some(), "{name}, ray {i}, {ray:?}: occlusion and {}", told[0]);
    }
    if let Some(wrong) = truth.objection(ray, hits[0].as_ref()) {
        panic!("{name}, ray {i}, {ray:?}: {}: {wrong}", told[0]);
    }
    hits[0]
}

/// Pieces of about the given part of the mesh's size, seen from a corner of its box: every edge has its own rate.
fn uneven(mesh: &ControlMesh, pieces: f64) -> DicingRate {
    let bounds = mesh.bounds();
    let eye = bounds.max + 0.1 * (bounds.max - bounds.min);
    DicingRate::Pixels { eye, pieces_per_unit: pieces }
}

#[test]
fn batches_answer_as_single_rays_do() {
    let mut random = Random(0xba7c_4e55);
    for (name, mesh) in shapes::all() {
        let moved = DAffine3::from_translation(DVec3::new(0.5, 1.5, -0.3));
        let parts =
            vec![(mesh.clone(), DAffine3::IDENTITY, DicingRate::Fixed(11)), (mesh, moved, DicingRate::Fixed(4))];
        let world = world_of(parts.into_iter().take(1 + random.below(2)).collect());
        let ample = cache_of(&world, CacheConfig::with_bytes(16 << 20));
        let mut one_by_one = Intersector::new(&world, &ample);
        let rays = rays_and_onward_rays(&world, &mut one_by_one, &mut random);
        let wanted: Vec<Option<Hit>> = rays.iter().map(|ray| one_by_one.closest(ray)).collect();
        for bytes in [0, 4 << 10, 64 << 10, 16 << 20] {
            let cache = cache_of(&world, CacheConfig::with_bytes(bytes));
            let mut tracer = Intersector::new(&world, &cache);
            for size in [1, 7, rays.len()] {
                for (rays, wanted) in rays.chunks(size).zip(wanted.chunks(size)) {
                    let mut hits = vec![None; rays.len()];
                    tracer.closest_batch(rays, &mut hits);
                    assert_eq!(format!("{hits:?}"), format!("{wanted:?}"), "{name}, {bytes} bytes, {size} at a time");
                    let mut occluded = vec![true; rays.len()];
                    tracer.occluded_batch(rays, &mut occluded);
                    assert!(occluded.iter().zip(wanted).all(|(o, hit)| *o == hit.is_some()), "{name}, {bytes} bytes");
                }
            }
        }
    }
}

#[test]
fn taking_aim_changes_no_answer() {
    let mut random = Random(0xa1_4ed0);
    let mut n_hits = 0;
    for (name, mesh) in shapes::all() {
        let turned = DAffine3::from_rotation_y(0.7) * DAffine3::from_scale(DVec3::new(-1.0, 0.5, 2.0));
        let places = [DAffine3::IDENTITY, DAffine3::from_translation(DVec3::new(0.5, 1.5, -0.3)) * turned];
        let parts = places.map(|place| (mesh.clone(), place, DicingRate::Fixed(9)));
        let world = world_of(parts.into_iter().take(1 + random.below(2)).collect());
        let cache = cache_of(&world, CacheConfig::with_bytes(16 << 20));
        let [mut plain, mut aimed] = [Intersector::new(&world, &cache), Intersector::new(&world, &cache)];
        let bounds = world.meshes().iter().map(WorldMesh::bounds_in_world).fold(DBounds::EMPTY, DBounds::union);
        for _ in 0..20 {
            let eye = bounds.center() + 10f64.powi(random.below(4) as i32 - 1) * bounds.diagonal() * random.in_cube();
            let spread = [0.0, 0.01, 0.1, 1.0][random.below(4)];
            let forward = bounds.center() + 0.5 * bounds.diagonal() * random.in_cube() - eye;
            let rays: Vec<Ray> =
                (0..30).map(|_| Ray::new(eye, forward + spread * forward.length() * random.in_cube())).collect();
            aimed.aim(&rays[..20].iter().copied().collect());
            // The last ten are of the bundle or not; then come rays that start elsewhere.
            let onward: Vec<Ray> = rays.iter().filter_map(|ray| onward(ray, &mut plain, &mut random)).collect();
            for ray in rays.iter().chain(&onward) {
                let (wanted, hit) = (plain.closest(ray), aimed.closest(ray));
                assert_eq!(format!("{hit:?}"), format!("{wanted:?}"), "{name}, {ray:?}");
                n_hits += usize::from(hit.is_some());
            }
        }
    }
    assert!(n_hits > 1000, "only {n_hits} rays hit anything");
}

#[test]
fn rays_from_one_point_answer_as_single_rays_do() {
    let mut random = Random(0x9ac_4e75);
    let mut n_hits = 0;
    for (name, mesh) in shapes::all() {
        let turned = DAffine3::from_rotation_y(0.7) * DAffine3::from_scale(DVec3::new(-1.0, 0.5, 2.0));
        let places = [DAffine3::IDENTITY, DAffine3::from_translation(DVec3::new(0.5, 1.5, -0.3)) * turned];
        let rate = [1, 7, 20, 40][random.below(4)];
        let parts = places.map(|place| (mesh.clone(), place, DicingRate::Fixed(rate)));
        let world = world_of(parts.into_iter().take(1 + random.below(2)).collect());
        let ample = cache_of(&world, CacheConfig::with_bytes(16 << 20));
        let caches = [0, 64 << 10, 16 << 20].map(|bytes| cache_of(&world, CacheConfig::with_bytes(bytes)));
        let mut one_by_one = Intersector::new(&world, &ample);
        let mut tracers = caches.each_ref().map(|cache| Intersector::new(&world, cache));
        let bounds = world.meshes().iter().map(WorldMesh::bounds_in_world).fold(DBounds::EMPTY, DBounds::union);
        for round in 0..40 {
            let eye = bounds.center() + 10f64.powi(random.below(4) as i32 - 1) * bounds.diagonal() * random.in_cube();
            let forward = bounds.center() + 0.4 * bounds.diagonal() * random.in_cube() - eye;
            let spread = [0.0, 1e-3, 0.03, 1.0][random.below(4)] * forward.length();
            let n = [1, 3, 8, 21][random.below(4)];
            let directions: Vec<DVec3> = (0..n).map(|_| forward + spread * random.in_cube()).collect();
            let rays: Vec<Ray> = directions.iter().map(|&direction| Ray::new(eye, direction)).collect();
            let wanted: Vec<Option<Hit>> = rays.iter().map(|ray| one_by_one.closest(ray)).collect();
            n_hits += wanted.iter().flatten().count();
            for tracer in &mut tracers {
                // Aimed along these rays, along some of them, or along those of before.
                if round % 3 < 2 {
                    tracer.aim(&rays[..n - (n - 1) * (round % 3) / 2].iter().copied().collect());
                }
                let mut hits = vec![None; n];
                tracer.closest_from(eye, &directions, &mut hits);
                assert_eq!(format!("{hits:?}"), format!("{wanted:?}"), "{name}, from {eye} along {directions:?}");
            }
        }
    }
    assert!(n_hits > 1000, "only {n_hits} rays hit anything");
}

#[test]
fn rays_said_to_start_above_a_surface_answer_as_if_they_were_not() {
    let mut random = Random(0xabc_0de);
    let (mut n_spared, mut n_asked) = (0, 0);
    for (name, mesh) in shapes::all() {
        let turned = DAffine3::from_rotation_y(0.4);
        let mirrored = turned * DAffine3::from_scale(DVec3::new(-1e3, 1e3, 1e3));
        let stretched = turned * DAffine3::from_scale(DVec3::new(1.0, 0.1, 3.0));
        let barely = turned * DAffine3::from_scale(DVec3::new(1.0, 1.004, 1.0));
        let fixed = [(3, turned), (8, mirrored), (8, barely), (13, DAffine3::IDENTITY), (13, stretched), (32, turned)];
        let fixed = fixed.map(|(rate, place)| (format!("fixed:{rate}"), DicingRate::Fixed(rate), place));
        // Sides with fewer segments than the grid.
        let pieces = [(3.0, DAffine3::IDENTITY), (9.0, mirrored)];
        let uneven = pieces.map(|(pieces, place)| (format!("uneven {pieces}"), self::uneven(&mesh, pieces), place));
        for (rate, dicing, place) in fixed.into_iter().chain(uneven) {
            let world = world_of(vec![(mesh.clone(), place, dicing)]);
            let caches = [0, 16 << 20, 16 << 20].map(|bytes| cache_of(&world, CacheConfig::with_bytes(bytes)));
            {
                let [mut small, mut told, mut plain] = caches.each_ref().map(|cache| Intersector::new(&world, cache));
                let bounds = world.meshes()[0].bounds_in_world();
                let rays: Vec<Ray> = (0..30).map(|_| random.ray(bounds)).collect();
                for ray in rays.iter().chain(&rays) {
                    for ray in leaving(ray, &mut plain, &mut random) {
                        let blind = Ray { above: None, ..ray };
                        let wanted = plain.closest(&blind);
                        for tracer in [&mut told, &mut small] {
                            let hit = tracer.closest(&ray);
                            assert_eq!(format!("{hit:?}"), format!("{wanted:?}"), "{name} at {rate}, {ray:?}");
                            assert_eq!(tracer.occluded(&ray), wanted.is_some(), "{name} at {rate}, {ray:?}");
                        }
                        plain.occluded(&blind);
                    }
                }
            }
            let [small, told, plain] = caches.map(|cache| cache.segments().statistics().lookups);
            assert_eq!(small, told, "{name} at {rate}: what is looked up depends on what is there");
            (n_spared, n_asked) = (n_spared + plain - told, n_asked + plain);
        }
    }
    assert!(6 * n_spared > n_asked, "only {n_spared} of {n_asked} blocks were not looked at");
}

#[test]
fn most_rays_of_many_that_leave_a_patch_need_no_walk() {
    let mut random = Random(0x5c1_11e5);
    let (mut n_left, mut n_all) = (0, 0);
    let meshes = [
        ("sphere", shapes::cube_sphere(10)),
        ("globe", shapes::globe(24, 12)),
        ("torus", shapes::torus(32, 16, 1.0, 0.4)),
        ("plane", shapes::plane(9, 7)),
    ];
    for (name, mesh) in meshes {
        for rate in [DicingRate::Fixed(8), uneven(&mesh, 40.0)] {
            let place = DAffine3::from_rotation_y(0.4) * DAffine3::from_scale(DVec3::new(-30.0, 30.0, 30.0));
            let world = world_of(vec![(mesh.clone(), place, rate)]);
            let bounds = world.meshes()[0].bounds_in_world();
            let caches = [0, 1].map(|_| cache_of(&world, CacheConfig::with_bytes(16 << 20)));
            let rays = leaving_upwards(&mut Intersector::new(&world, &caches[1]), bounds, &mut random);
            let lookups = |cache: usize, is_told: bool| {
                let before = caches[cache].segments().statistics().lookups;
                let mut tracer = Intersector::new(&world, &caches[cache]);
                let above = |ray: &Ray| ray.above.filter(|_| is_told);
                let hits: Vec<bool> =
                    rays.iter().map(|ray| tracer.occluded(&Ray { above: above(ray), ..*ray })).collect();
                let nearest = |ray: &Ray| tracer.closest(&Ray { above: above(ray), ..*ray }).is_some();
                assert!(rays.iter().map(nearest).eq(hits.iter().copied()), "{name} at {rate:?}");
                drop(tracer);
                (hits, caches[cache].segments().statistics().lookups - before)
            };
            // What is above the first of them is not known yet.
            let (told, _) = lookups(0, true);
            let ((again, n_told), (plain, n_plain)) = (lookups(0, true), lookups(1, false));
            assert!(told == plain && again == plain, "{name} at {rate:?}");
            (n_left, n_all) = (n_left + n_told, n_all + n_plain);
        }
    }
    assert!(4 * n_left < n_all, "{n_left} of {n_all} blocks were looked at");
}

#[test]
fn what_is_known_of_one_mesh_is_not_taken_for_the_other() {
    let mut random = Random(0x2_e5);
    let mut n_met = 0;
    // The same patches by number: where one is round, the other has a crater.
    let sphere = shapes::cube_sphere(6);
    let mut crater = sphere.clone();
    for p in crater.positions.iter_mut().filter(|p| p.y > 0.0) {
        p.y -= 2.2 * (0.55 - p.x * p.x - p.z * p.z).max(0.0);
    }
    let place = |x: f64| DAffine3::from_translation(DVec3::X * x);
    let world = world_of([(sphere, 0.0), (crater, 3.0)].map(|(mesh, x)| (mesh, place(x), DicingRate::Fixed(8))).into());
    let caches = [0, 1].map(|_| cache_of(&world, CacheConfig::with_bytes(16 << 20)));
    {
        let [mut told, mut plain] = caches.each_ref().map(|cache| Intersector::new(&world, cache));
        for mesh in [MeshId(0), MeshId(1), MeshId(0)] {
            let bounds = world.meshes()[mesh.idx()].bounds_in_world();
            for ray in leaving_upwards(&mut plain, bounds, &mut random) {
                assert_eq!(ray.from.map(|from| from.mesh), Some(mesh));
                let wanted = plain.closest(&Ray { above: None, ..ray });
                assert_eq!(format!("{:?}", told.closest(&ray)), format!("{wanted:?}"), "{ray:?}");
                let near = Ray { t_max: 0.7, ..ray };
                assert_eq!(told.occluded(&ray), wanted.is_some(), "{ray:?}");
                assert_eq!(told.occluded(&near), wanted.is_some_and(|hit| hit.t <= 0.7), "{near:?}");
                n_met += usize::from(wanted.is_some());
            }
        }
    }
    assert!(n_met > 1000, "only {n_met} rays met anything");
    let counts = caches[0].departure_counts();
    assert!(counts.skylines >= 2 && counts.rays_past_all > 1000, "{counts:?}");
}

/// Many rays that leave one place of the mesh, seen from above.
fn leaving_upwards(tracer: &mut Intersector<'_>, bounds: DBounds, random: &mut Random) -> Vec<Ray> {
    let from = bounds.center() + bounds.diagonal() * DVec3::new(0.11, 2.0, 0.07);
    let mut ray = || {
        let down = Ray::new(from + 0.003 * bounds.diagonal() * random.in_cube(), -DVec3::Y);
        let hit = tracer.closest(&down).expect("it is below");
        let at = tracer.surface_point(&down, &hit);
        let up = at.geometric_normal * at.geometric_normal.y.signum();
        let (origin, direction) = (at.position + at.clearance * up, up + 0.95 * random.in_cube().normalize());
        Ray { from: Some(hit.primitive), above: Some(at.clearance as f32), ..Ray::new(origin, direction) }
    };
    (0..20_000).map(|_| ray()).collect()
}

#[test]
fn rays_from_triangles_that_are_not_there_are_traced() {
    let world = world_of(vec![(shapes::cube(), DAffine3::IDENTITY, DicingRate::Fixed(20))]);
    let cache = cache_of(&world, CacheConfig::with_bytes(1 << 20));
    let mut tracer = Intersector::new(&world, &cache);
    let ray = Ray::new(DVec3::new(0.1, 0.2, 10.0), -DVec3::Z);
    let hit = tracer.closest(&ray).expect("a cube below");
    for cell in [[999, 0], [0, 999], [20, 20], [32767, 32767]] {
        let from = PrimitiveRef { cell, ..hit.primitive };
        for _ in 0..200 {
            let hit = tracer.closest(&Ray { from: Some(from), above: Some(0.0), ..ray });
            assert!(hit.is_none_or(|hit| hit.t > 1.0), "{cell:?}: {hit:?}");
        }
    }
}

/// Rays that leave the surface where one hits, to both sides, as a renderer makes them.
fn leaving(ray: &Ray, tracer: &mut Intersector<'_>, random: &mut Random) -> Vec<Ray> {
    let Some(hit) = tracer.closest(ray) else { return Vec::new() };
    let at = tracer.surface_point(ray, &hit);
    let ray = |direction: DVec3| {
        let side = at.clearance * direction.dot(at.geometric_normal).signum();
        let origin = at.position + side * at.geometric_normal;
        Ray { from: Some(hit.primitive), above: Some(at.clearance as f32), ..Ray::new(origin, direction) }
    };
    (0..20).map(|k| ray(random.in_cube() + f64::from(k % 3) * at.geometric_normal)).collect()
}

/// A ray that goes on from where one hits.
fn onward(ray: &Ray, tracer: &mut Intersector<'_>, random: &mut Random) -> Option<Ray> {
    let hit = tracer.closest(ray)?;
    let origin = ray.origin + f64::from(hit.t) * ray.direction;
    Some(Ray { from: Some(hit.primitive), t_max: 2.0, ..Ray::new(origin, random.in_cube()) })
}

/// Random rays, and those that go on from their hits, shuffled.
fn rays_and_onward_rays(world: &World, tracer: &mut Intersector<'_>, random: &mut Random) -> Vec<Ray> {
    let bounds = world.meshes().iter().map(WorldMesh::bounds_in_world).fold(DBounds::EMPTY, DBounds::union);
    let mut rays: Vec<Ray> = (0..100).map(|_| random.ray(bounds)).collect();
    for i in 0..rays.len() {
        rays.extend(onward(&rays[i], tracer, random));
    }
    for i in (1..rays.len()).rev() {
        rays.swap(i, random.below(i + 1));
    }
    rays
}

#[test]
fn nothing_is_left_to_build_after_everything_was_tessellated() {
    for (name, mesh) in shapes::all() {
        let world = world_of(vec![(mesh, DAffine3::IDENTITY, DicingRate::Fixed(37))]);
        let cache = cache_of(&world, CacheConfig::with_bytes(256 << 20));
        let mut tracer = Intersector::new(&world, &cache);
        tracer.tessellate_everything();
        let n_built = tracer.n_built();
        assert!(n_built > 0, "{name}");
        let (mut random, bounds) = (Random(0x5eed_0002), world.meshes()[0].bounds_in_world());
        for _ in 0..200 {
            let _ = tracer.closest(&random.ray(bounds));
        }
        assert_eq!(tracer.n_built(), n_built, "{name}");
    }
}

#[test]
fn every_shape_at_even_and_odd_rates() {
    for (name, mesh) in shapes::all() {
        for rate in [1, 4, 11] {
            let world = world_of(vec![(mesh.clone(), DAffine3::IDENTITY, DicingRate::Fixed(rate))]);
            compare(&format!("{name} at fixed:{rate}"), &world);
        }
    }
}

#[test]
fn every_shape_where_each_edge_has_its_own_rate() {
    for (name, mesh) in shapes::all() {
        for pieces in [1.3, 4.0] {
            let rate = uneven(&mesh, pieces);
            compare(&format!("{name}, uneven {pieces}"), &world_of(vec![(mesh.clone(), DAffine3::IDENTITY, rate)]));
        }
    }
}

#[test]
fn patches_of_many_pieces_and_levels() {
    for (name, mesh, rate) in [
        ("cube", shapes::cube(), 33),
        ("crease-cube-2.5", shapes::crease_cube(2.5), 65),
        ("heptagon", shapes::n_gon(7), 75),
        ("quad", shapes::n_gon(4), 200),
    ] {
        compare(
            &format!("{name} at fixed:{rate}"),
            &world_of(vec![(mesh, DAffine3::IDENTITY, DicingRate::Fixed(rate))]),
        );
    }
}

#[test]
fn meshes_that_are_turned_stretched_and_mirrored() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
    let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let places = [
        DAffine3::from_scale_rotation_translation(DVec3::new(0.2, 3.0, 1.0), turn, DVec3::new(1.0, 0.5, 0.0)),
        DAffine3::from_mat3_translation(mirror, DVec3::new(-0.3, 0.2, 0.4)),
        DAffine3::from_scale_rotation_translation(DVec3::new(5.0, -0.7, 0.01), turn.inverse(), DVec3::ZERO),
        DAffine3::from_translation(DVec3::new(0.4, -0.5, 0.2)),
    ];
    let meshes =
        [shapes::torus(8, 6, 2.0, 0.75), shapes::crease_cube(1.0), shapes::cube_sphere(3), shapes::globe(5, 4)];
    let parts = |rate: u32| {
        let together = meshes.iter().cloned().zip(places).enumerate();
        together.map(|(i, (mesh, place))| (mesh, place, DicingRate::Fixed(rate + i as u32))).collect()
    };
    for rate in [1, 4, 9] {
        compare(&format!("four meshes at fixed:{rate} and more"), &world_of(parts(rate)));
    }
}

#[test]
fn far_away_and_tiny_or_huge_meshes() {
    for (scale, offset) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e7), (1e-3, 1e5), (1e6, 1e7)] {
        let place = DAffine3::from_scale_rotation_translation(
            DVec3::splat(scale),
            DQuat::from_rotation_y(0.4),
            DVec3::new(offset, -0.3 * offset, 0.7 * offset),
        );
        let world = world_of(vec![(shapes::cube_sphere(3), place, DicingRate::Fixed(5))]);
        compare(&format!("scale {scale}, offset {offset}"), &world);
    }
}

#[test]
fn mesh_that_is_hit_is_the_one_in_front() {
    let sphere = |z: f64| (shapes::cube_sphere(3), DAffine3::from_translation(z * DVec3::Z), DicingRate::Fixed(4));
    let world = world_of(vec![sphere(0.0), sphere(10.0), sphere(-10.0)]);
    let cache = cache_of(&world, CacheConfig::with_bytes(1 << 20));
    let mut tracer = Intersector::new(&world, &cache);
    let mut front = |z: f64, dz: f64| {
        let ray = Ray::new(DVec3::new(0.01, 0.02, z), DVec3::new(0.0, 0.0, dz));
        tracer.closest(&ray).map(|hit| hit.primitive.mesh)
    };
    assert_eq!(front(100.0, -1.0), Some(MeshId(1)));
    assert_eq!(front(-100.0, 1.0), Some(MeshId(2)));
    assert_eq!(front(5.0, -1.0), Some(MeshId(0)));
    assert_eq!(front(100.0, 1.0), None);
}
