//! Edges that fall between the samples that groups look at: those of patterns, and tips of silhouettes.

use super::fuzz::unit_cube;
use super::*;
use crate::mesh::shapes;

const SIZE: [u32; 2] = [176, 132];

/// One shape, two units large, alone under the sky and a sun, seen from a direction.
fn stage(mesh: ControlMesh, material: Material, from: DVec3) -> Stage {
    let to_unit = unit_cube(mesh.positions.iter().copied().collect());
    let mesh = WorldMesh::new(mesh, to_unit, DicingRate::Fixed(8), 1).unwrap();
    let sun = Light::Directional { direction: -from - DVec3::Y, irradiance: Vec3::splat(2.0) };
    let camera = CameraDescription { eye: 4.5 * from.normalize(), at: DVec3::ZERO, up: DVec3::Y, fov: 35.0 };
    Stage {
        world: World::new(vec![mesh]),
        appearance: Appearance::new(vec![material], vec![sun, Light::Sky { radiance: Vec3::splat(0.3) }], Vec3::ZERO),
        camera: Camera::new(&camera),
    }
}

/// Objects that are lost, and the share of pixels that are wrong by more than 5/255.
fn lost(stage: &Stage, spp: u32) -> (usize, f64) {
    let [full, grouped] = [Groups::Off, Groups::Adaptive].map(|groups| {
        let tolerance = 5.0 / 255.0;
        stage.render(&RenderSettings { groups, spp, tolerance, ..RenderSettings::of_size(SIZE) }, 2).film
    });
    let display = |film: &Film| film.colors().iter().map(|c| c.map(display_value)).collect::<Vec<_>>();
    let missed = missed_objects(SIZE[0] as usize, &display(&full), &display(&grouped));
    (missed, share_above(&full, &grouped, 5.0 / 255.0))
}

/// A view of shape number `shape`.
fn direction(shape: usize, turn: u32) -> DVec3 {
    let angle = f64::from(turn) + 0.1 * shape as f64;
    DVec3::new(angle.cos(), 0.4 * (2.0 * angle).sin(), angle.sin())
}

/// `LAZYTESS_VIEWS=14 cargo test --release edges` looks at each shape from 14 directions instead of one.
fn n_views() -> u32 {
    std::env::var("LAZYTESS_VIEWS").map_or(1, |n| n.parse().expect("LAZYTESS_VIEWS is a number"))
}

#[test]
fn nothing_is_lost_of_dull_mirroring_and_checkered_shapes() {
    let [even, odd] = [Vec3::new(0.8, 0.2, 0.2), Vec3::new(0.2, 0.2, 0.8)];
    let dull = Material { specular: Vec3::ZERO, ..Material::default() };
    let mirror = Material { mirror: Vec3::splat(0.4), ..Material::default() };
    let checker = |size| Material { diffuse: Albedo::Checker { even, odd, size }, ..Material::default() };
    let mut failures = Vec::new();
    for (k, (name, mesh)) in shapes::all().into_iter().enumerate() {
        for turn in 0..n_views() {
            let from = direction(k, turn);
            for material in [&dull, &mirror, &checker(0.17), &checker(0.3)] {
                let stage = stage(mesh.clone(), material.clone(), from);
                for spp in [1, 2, 4, 8] {
                    let (missed, share) = lost(&stage, spp);
                    if missed > 0 || share > 0.01 {
                        let what = format!("{name} from {from}, {spp} samples, {:?}", material.diffuse);
                        failures.push(format!("{missed} lost, {share} wrong: {what}, mirror {}", material.mirror));
                    }
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn slivers_are_not_lost_between_two_samples() {
    for (k, (name, mesh)) in shapes::all().into_iter().enumerate() {
        // Each of these turns lost something of some shape once. Of a hundred turns of each, 16 did.
        for turn in [12, 20, 21, 23, 34, 56, 68] {
            let from = direction(k, turn);
            let stage = stage(mesh.clone(), Material { specular: Vec3::ZERO, ..Material::default() }, from);
            assert_eq!(lost(&stage, 4).0, 0, "{name} from {from}");
        }
    }
}
