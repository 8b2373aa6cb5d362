//! Rays that leave a surface neither hit it again (acne) nor slip through a neighbour (light leaks), at any scale.

mod common;

use common::traced::{Traced, camera, placements};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use lazytess::ids::VertexId;
use lazytess::math::{Intersect, Ray};
use lazytess::mesh::{ControlMesh, Crease, shapes};
use lazytess::render::{RenderSettings, Tracer};
use lazytess::scene::description::{IntegratorKind, Light};
use lazytess::scene::rate::DicingRate;

/// Every edge infinitely sharp: the limit surface is the polyhedron itself.
fn sharp(mut mesh: ControlMesh) -> ControlMesh {
    let faces: Vec<Vec<VertexId>> = mesh.faces().map(<[VertexId]>::to_vec).collect();
    let edges = faces.iter().flat_map(|f| (0..f.len()).map(|k| [f[k], f[(k + 1) % f.len()]]));
    mesh.creases = edges.map(|edge| Crease { edge, sharpness: f32::INFINITY }).collect();
    mesh
}

fn of_kind(name: &str, size: [u32; 2]) -> RenderSettings {
    let integrator: IntegratorKind = name.parse().unwrap();
    RenderSettings { integrator, spp: 4, ao_samples: 16, ..RenderSettings::of_size(size) }
}

/// Rooms without windows whose concave creases are square, 70 degrees and, sheared, some 10 degrees sharp; turned out
/// of the axes, so that no wall lies on lattice points.
fn rooms() -> Vec<(&'static str, ControlMesh, DAffine3)> {
    let turned = DAffine3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 0.2));
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.15, 1.0));
    vec![
        ("cube", sharp(shapes::cube()), DAffine3::IDENTITY),
        ("turned cube", sharp(shapes::cube()), turned),
        ("tetrahedron", sharp(shapes::tetrahedron()), turned),
        ("flat octahedron", sharp(shapes::octahedron()), turned * flat),
        ("torus", shapes::torus(8, 6, 2.0, 0.75), turned),
    ]
}

/// The mesh with its points moved, so that the lattice sees the walls where the room has them.
fn moved(mut mesh: ControlMesh, by: &DAffine3) -> ControlMesh {
    mesh.positions.iter_mut().for_each(|p| *p = by.transform_point3(*p));
    mesh
}

#[test]
fn closed_rooms_are_black_inside() {
    for (name, mesh, shape) in rooms() {
        let mesh = moved(mesh, &shape);
        let inside =
            if name == "torus" { shape.transform_point3(DVec3::new(2.0, 0.0, 0.0)) } else { mesh.bounds().center() };
        for place in placements() {
            let room = Traced::new(&mesh, place, DicingRate::Random(5));
            let size = mesh.bounds().diagonal();
            let light = |d: DVec3| Light::Point {
                position: place.transform_point3(mesh.bounds().center() + 2.0 * size * d),
                intensity: Vec3::splat(1e30),
            };
            let lights: Vec<_> = [DVec3::X, DVec3::Y, DVec3::new(-1.0, -1.0, 0.3)].into_iter().map(light).collect();
            for at in [DVec3::X, DVec3::new(-0.9, -1.0, -0.8)] {
                let view = camera(&place, inside, inside + at, 120.0);
                for kind in ["ao", "whitted"] {
                    let picture = room.picture(&view, lights.clone(), &of_kind(kind, [96, 64]));
                    let lit = picture.iter().filter(|c| c[0] > 0.0).count();
                    assert_eq!(lit, 0, "{name}, {kind}, {place:?}: pixels that see the outside");
                }
            }
        }
    }
}

/// Every point of a convex polyhedron sees the whole sky above its face, but for what rounding tilts a triangle: half a
/// step over a cell, some 1e-5. (Curved bodies are no test: of the two diagonals of a cell one is concave.)
#[test]
fn convex_bodies_do_not_shadow_themselves() {
    for place in placements() {
        for rate in [DicingRate::Fixed(16), DicingRate::Fixed(100), DicingRate::Fixed(1)] {
            let ball = Traced::new(&moved(sharp(shapes::octahedron()), &rooms()[1].2), place, rate);
            let mut tracer = ball.tracer();
            let (mut n_left, mut n_blocked, mut state) = (0, 0, 1u32);
            let mut random = || {
                state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
                f64::from(state >> 8) / f64::from(1 << 23) - 1.0
            };
            while n_left < 40_000 {
                let mut vector = || DVec3::new(random(), random(), random());
                let (eye, at) = (4.0 * vector(), 0.2 * vector());
                let [eye, at] = [eye, at].map(|p| place.transform_point3(p));
                let ray = Ray::new(eye, at - eye);
                let Some(hit) = tracer.closest(&ray) else { continue };
                let point = tracer.surface_point(&ray, &hit);
                if point.geometric_normal.dot(ray.direction) >= 0.0 {
                    continue; // The eye was inside.
                }
                for _ in 0..8 {
                    let n = point.geometric_normal;
                    let along = n.cross(DVec3::new(random(), random(), random())).normalize();
                    // Elevations from overhead down to a thousandth.
                    let d = along + n * f64::powf(10.0, 2.0 - 2.5 * (random() + 1.0));
                    let origin = point.position + point.clearance * n;
                    let leaving = Ray { from: Some(hit.primitive), ..Ray::new(origin, d) };
                    n_left += 1;
                    n_blocked += usize::from(tracer.occluded(&leaving));
                }
            }
            assert_eq!(n_blocked, 0, "of {n_left} at {rate:?}, {place:?}");
        }
    }
}

/// What the camera's distance must not change: where the hit is.
#[test]
fn far_cameras_see_the_surface_where_near_ones_do() {
    let cube = Traced::new(&sharp(shapes::cube()), DAffine3::IDENTITY, DicingRate::Fixed(8));
    let mut tracer = cube.tracer();
    let half = shapes::cube().bounds().max.x;
    let mut xs = Vec::new();
    for distance in [1.0, 1e3, 1e6, 1e9] {
        let target = half * DVec3::new(1.0, 0.3, -0.2);
        let ray = Ray::new(target + distance * DVec3::new(1.0, 0.2, 0.1), -DVec3::new(1.0, 0.2, 0.1));
        let hit = tracer.closest(&ray).unwrap();
        let point = tracer.surface_point(&ray, &hit);
        xs.push(point.position.x);
        assert!((point.position - target).length() < 1e-5 * half, "{distance}: {point:?}");
        assert!(point.clearance < 1e-5 * half);
    }
    assert!(xs.iter().all(|x| (x - xs[0]).abs() < 1e-12 && (x - half).abs() < 1e-6), "{xs:?}");
}
