//! Numbers at the extremes: each test says what goes wrong there in other programs.

mod common;

use common::traced::{Traced, camera, placements};
use glam::{DAffine3, DVec3, Vec3};
use lazytess::check::{Incidence, LeakSettings, compare_seams, find_leaks};
use lazytess::ids::{FaceId, VertexId};
use lazytess::io::process::thread_cpu;
use lazytess::math::{Intersect, Ray};
use lazytess::mesh::{ControlMesh, Crease, shapes};
use lazytess::render::RenderSettings;
use lazytess::scene::description::Light;
use lazytess::scene::rate::DicingRate;
use lazytess::subdiv::refine::RefinedMesh;
use lazytess::subdiv::{Dicer, Surface};
use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

/// Equal borders, and no leak in `rays`; returns how many rays could be traced.
fn assert_tight(name: &str, mesh: &ControlMesh, rate: DicingRate, place: DAffine3, rays: u64) -> u64 {
    let traced = Traced::new(mesh, place, rate);
    let (cancel, incidence) = (AtomicBool::new(false), Incidence::new(traced.mesh().surface()));
    if mesh.n_faces() < 10_000 && rate != DicingRate::Fixed(4096) {
        let seams = compare_seams(traced.mesh(), &incidence, 2, &cancel);
        assert_eq!(seams.different, 0, "{name}: {:?}", seams.examples);
    }
    let settings = LeakSettings { rays, seed: 3, threads: 2 };
    let report = find_leaks(traced.mesh(), &incidence, &settings, &cancel, &|_| (), || traced.tracer());
    assert_eq!(report.leaks, 0, "{name} at {rate:?}, {place:?}: {:?}", report.examples);
    report.rays
}

/// f32 world coordinates lose the mesh at large offsets, and absolute epsilons fail at small and large scales.
#[test]
fn pictures_do_not_depend_on_scale_or_offset() {
    let mesh = shapes::torus(8, 6, 2.0, 0.75);
    let picture = |place: DAffine3| {
        let lights = vec![
            Light::Directional {
                direction: DVec3::new(-1.0, -2.0, -0.5).normalize(),
                irradiance: Vec3::splat(PI as f32),
            },
            Light::Sky { radiance: Vec3::splat(0.2) },
        ];
        let view = camera(&place, DVec3::new(3.0, 4.0, 5.0), DVec3::ZERO, 40.0);
        Traced::new(&mesh, place, DicingRate::Fixed(16)).picture(&view, lights, &RenderSettings::of_size([320, 240]))
    };
    let pictures: Vec<_> = placements().into_iter().map(picture).collect();
    assert!(pictures[0].iter().filter(|c| c[0] > 0.3).count() > 10_000, "the torus is lit");
    for (k, other) in pictures.iter().enumerate().skip(1) {
        let differs = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1.0 / 255.0);
        let n = pictures[0].iter().zip(other).filter(|&(a, b)| differs((a, b))).count();
        assert!(n * 10_000 <= other.len(), "placement {k}: {n} of {} pixels differ", other.len());
    }
}

/// Embree drops vertices of more than 64 faces and faces of more than 16 sides without a word.
#[test]
fn a_thousand_faces_at_a_vertex_and_a_thousand_sides_of_a_face() {
    for (name, mesh) in
        [("globe", shapes::globe(1000, 3)), ("prism", shapes::prism(1000)), ("pole", shapes::pole(1000))]
    {
        assert!(assert_tight(name, &mesh, DicingRate::Fixed(4), DAffine3::IDENTITY, 2_000) > 1_000, "{name}");
    }
    let disc = Traced::new(&shapes::n_gon(1000), DAffine3::IDENTITY, DicingRate::Fixed(2));
    let hit = disc.tracer().closest(&Ray::new(DVec3::new(0.1, 5.0, 0.2), DVec3::NEG_Y));
    assert!(hit.is_some_and(|hit| (hit.t - 5.0).abs() < 1e-4));
}

/// A polygon's patches all need the whole polygon: taken apart anew for each of them, n sides cost n times n times n.
#[test]
fn a_patch_of_a_polygon_costs_no_more_than_its_sides() {
    let seconds_a_patch = |n: u32| {
        let surface = Surface::new(&shapes::n_gon(n), 1).unwrap();
        let mut dicer = Dicer::default();
        let mut run = || {
            let start = thread_cpu();
            for sub in 0..n {
                dicer.sample(&surface, surface.patch_of(FaceId(0), sub), 0.3, 0.4);
            }
            (thread_cpu() - start).as_secs_f64() / f64::from(n)
        };
        (0..10).map(|_| run()).fold(f64::INFINITY, f64::min)
    };
    let [few, many] = [125, 1000].map(seconds_a_patch);
    let times = many / few;
    println!("eight times the sides, {times:.1} times the time of a patch");
    assert!(times < 32.0, "{times}: nearer to 64 than to 8");
}

/// Rates that are no powers of two, one cell a patch, a piece less one cell, and the largest.
#[test]
fn rates_from_one_to_4096_hold_water() {
    for rate in [1, 2, 3, 7, 255, 4096] {
        for (name, mesh) in [("cube", shapes::cube()), ("prism", shapes::prism(5))] {
            for place in placements() {
                let rays = if rate == 4096 { 2_000 } else { 10_000 };
                assert!(assert_tight(name, &mesh, DicingRate::Fixed(rate), place, rays) >= rays, "{name} {rate}");
            }
        }
    }
}

/// Fractional sharpness just beside a whole number, the last semi-sharp value, and infinity by its many names.
#[test]
fn sharpness_of_any_value_is_followed() {
    for sharpness in [0.001, 0.999, 1.0, 9.999, 10.0, 1e9] {
        let mesh = shapes::crease_cube(sharpness);
        assert_tight("crease cube", &mesh, DicingRate::Random(9), DAffine3::IDENTITY, 5_000);
        let (surface, slow) = (Surface::new(&mesh, 1).unwrap(), RefinedMesh::from_control(&mesh));
        let mut dicer = Dicer::default();
        for face in [0, 3, 5].map(FaceId) {
            for [u, v] in [[0.0, 0.0], [0.5, 0.01], [0.3, 0.999], [1.0, 0.5], [1e-4, 1e-5]] {
                let fast =
                    surface.lattice().to_object(dicer.sample(&surface, surface.patch_of(face, 0), u, v).position);
                let exact = slow.limit_at(face, 0, u, v).unwrap().position;
                assert!((fast - exact).length() < 1e-6, "sharpness {sharpness}, {face:?}, {u}, {v}: {fast} {exact}");
            }
        }
    }
}

/// Zero lengths and areas: normals of length 0, divisions by 0, boxes without inside.
#[test]
fn degenerate_meshes_are_traced_without_a_nan() {
    let collapsed = |to: fn(DVec3) -> DVec3| {
        let mut mesh = shapes::cube();
        mesh.positions.iter_mut().for_each(|p| *p = to(*p));
        mesh
    };
    let mut short_edge = shapes::cube();
    short_edge.positions[1] = short_edge.positions[0];
    let meshes = [
        ("point", collapsed(|_| DVec3::new(1.0, 2.0, 3.0))),
        ("far point", collapsed(|_| DVec3::splat(1e20))),
        ("line", collapsed(|p| p.x * DVec3::new(1.0, 1.0, 1.0))),
        ("sheet", collapsed(|p| DVec3::new(p.x, 0.0, p.z))),
        ("edge without length", short_edge),
        ("repeated vertex", shapes::repeated_vertex()),
    ];
    for (name, mesh) in meshes {
        let traced = Traced::new(&mesh, DAffine3::IDENTITY, DicingRate::Random(4));
        let at = mesh.positions[0];
        let lights = vec![Light::Directional { direction: DVec3::NEG_Y, irradiance: Vec3::ONE }];
        let view =
            camera(&DAffine3::IDENTITY, at + DVec3::new(0.0, 3.0, 1.0) * at.abs().max_element().max(1.0), at, 60.0);
        let picture = traced.picture(&view, lights, &RenderSettings::of_size([48, 32]));
        assert!(picture.iter().flatten().all(|c| c.is_finite() && *c >= 0.0), "{name}");
        for direction in [DVec3::X, DVec3::NEG_Y, DVec3::ONE] {
            let hit = traced.tracer().closest(&Ray::new(at - 2.0 * direction, direction));
            assert!(hit.is_none_or(|hit| hit.t.is_finite() && hit.normal_in_object.is_finite()), "{name}");
        }
    }
}

/// A flat sheet in y = 0, two units wide or more.
fn sheet() -> Traced {
    Traced::new(&shapes::plane(4, 4), DAffine3::IDENTITY, DicingRate::Fixed(8))
}

/// Single precision has a step of the lattice left at the origin of a ray: a ray that sinks by 1e-7 in one unit then
/// hits anywhere, or nothing.
#[test]
fn grazing_rays_hit_where_they_meet_the_surface() {
    let sheet = sheet();
    let mut tracer = sheet.tracer();
    for angle in [1e-3, 1e-5, 1e-7] {
        for height in [0.1, 0.4] {
            let ray = Ray::new(DVec3::new(-0.2, height * angle, 0.123), DVec3::new(1.0, -angle, 0.01));
            let hit = tracer.closest(&ray).unwrap_or_else(|| panic!("angle {angle}, height {height}"));
            // The sheet as it is tessellated lies a third of a step off its place, which counts at such angles.
            let corner = hit.on_triangle.corners[0].as_dvec3();
            let expected = height - sheet.mesh().surface().object_from_lattice(corner).y / angle;
            assert!((f64::from(hit.t) - expected).abs() < 1e-4, "angle {angle}: {} for {expected}", hit.t);
        }
    }
}

/// A ray along an axis divides by zero in the other two, with either sign; and rays along grid lines touch many
/// triangles.
#[test]
fn axis_parallel_rays_with_zeros_of_both_signs_agree() {
    let sheet = sheet();
    let mut tracer = sheet.tracer();
    for x in [0.0, 0.125, 0.3, -0.25] {
        let shoot = |zeros: [f64; 2]| Ray::new(DVec3::new(x, 2.0, 0.0), DVec3::new(zeros[0], -1.0, zeros[1]));
        let hits = [[0.0, 0.0], [-0.0, 0.0], [0.0, -0.0], [-0.0, -0.0]].map(|zeros| tracer.closest(&shoot(zeros)));
        let [first, ..] = hits.map(|hit| hit.map(|hit| (hit.t, hit.primitive)));
        assert!(hits.iter().all(|hit| hit.map(|hit| (hit.t, hit.primitive)) == first), "{x}: {hits:?}");
        assert!(first.is_some_and(|(t, _)| (t - 2.0).abs() < 1e-6), "{x}: {first:?}");
    }
    // In the plane of the sheet there is nothing to cross; the answer is free, but it has to come.
    tracer.closest(&Ray::new(DVec3::new(-5.0, 0.0, 0.0), DVec3::X));
    assert!(tracer.closest(&Ray::new(DVec3::new(-5.0, 1e-6, 0.0), DVec3::X)).is_none());
}

/// A ray along an edge lies in the planes of both faces beside it: whether it touches them is free, but it must not
/// pass the face that it meets head-on, nor lose its way among determinants that are all zero.
#[test]
fn rays_along_edges_and_grid_lines_find_what_lies_across() {
    let half = shapes::cube().bounds().max.x;
    let mut mesh = shapes::crease_cube(f32::INFINITY);
    mesh.creases = all_edges(&mesh).map(|edge| Crease { edge, sharpness: f32::INFINITY }).collect();
    for place in placements() {
        let cube = Traced::new(&mesh, place, DicingRate::Fixed(8));
        let mut tracer = cube.tracer();
        for [x, y] in [[1.0, 1.0], [1.0, 0.25], [0.5, -1.0], [0.25, 0.5], [0.0, 0.0]] {
            let origin = half * DVec3::new(x, y, 3.0);
            let ray = Ray::new(place.transform_point3(origin), place.transform_vector3(half * DVec3::NEG_Z));
            let hit = tracer.closest(&ray);
            assert_eq!(hit.is_some(), tracer.occluded(&ray), "{x}, {y}, {place:?}");
            let is_inside = f64::max(x.abs(), y.abs()) < 1.0;
            assert!(hit.is_some() || !is_inside, "{x}, {y}, {place:?}");
            // Two half widths to the front; a ray along a border may touch anything up to the back.
            let last = if is_inside { 2.0 } else { 4.0 };
            let is_there = |t: f32| (2.0 - 1e-5..=last + 1e-5).contains(&f64::from(t));
            assert!(hit.is_none_or(|hit| is_there(hit.t)), "{x}, {y}, {place:?}: {hit:?}");
        }
    }
}

fn all_edges(mesh: &ControlMesh) -> impl Iterator<Item = [VertexId; 2]> {
    mesh.faces().flat_map(|face| (0..face.len()).map(|k| [face[k], face[(k + 1) % face.len()]]))
}

/// Lengths whose squares overflow or vanish in single precision.
#[test]
fn directions_of_any_length_hit_the_same_place() {
    let sheet = sheet();
    let mut tracer = sheet.tracer();
    for exponent in -30..=30 {
        let length = 10f64.powi(exponent);
        let hit = tracer.closest(&Ray::new(DVec3::new(0.1, 2.0, 0.2), length * DVec3::new(0.05, -1.0, 0.1))).unwrap();
        let t = f64::from(hit.t) * length;
        assert!((t - 2.0).abs() < 1e-5, "length {length}: t {}", hit.t);
    }
}

/// Rays from a point of the surface: the surface itself must not hide what lies behind it.
#[test]
fn rays_that_start_on_the_surface_see_the_other_side() {
    let cube = Traced::new(&shapes::crease_cube(f32::INFINITY), DAffine3::IDENTITY, DicingRate::Fixed(9));
    let mut tracer = cube.tracer();
    let ray = Ray::new(DVec3::new(0.11, 5.0, 0.07), DVec3::NEG_Y);
    let hit = tracer.closest(&ray).unwrap();
    let start = ray.origin + f64::from(hit.t) * ray.direction;
    let through = Ray { from: Some(hit.primitive), ..Ray::new(start, DVec3::NEG_Y) };
    let depth = shapes::crease_cube(0.0).bounds().max.y * 2.0;
    let far = tracer.closest(&through).unwrap();
    assert!((f64::from(far.t) - depth).abs() < 1e-5, "{} instead of {depth}", far.t);
}

/// Where a cell is a few lattice steps wide, single precision can hardly tell vertices apart.
#[test]
fn cells_as_small_as_the_lattice_hold_water() {
    let mesh = shapes::torus(600, 300, 2.0, 0.75);
    assert!(assert_tight("torus", &mesh, DicingRate::Fixed(4096), DAffine3::IDENTITY, 3_000) > 2_000);
    assert!(assert_tight("torus", &mesh, DicingRate::Random(1), DAffine3::IDENTITY, 20_000) > 10_000);
}
