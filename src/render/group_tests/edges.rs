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

#[test]
fn squares_of_patterns_stay_where_they_are_on_curved_surfaces() {
    for (k, (name, mesh)) in shapes::all().into_iter().enumerate() {
        let size = 0.17 + 0.01 * (k % 7) as f64;
        let diffuse = Albedo::Checker { even: Vec3::new(0.8, 0.2, 0.2), odd: Vec3::new(0.2, 0.2, 0.8), size };
        let stage = stage(mesh, Material { diffuse, ..Material::default() }, DVec3::new(1.0, 0.6, 1.2));
        for spp in [1, 4] {
            let (missed, share) = lost(&stage, spp);
            assert!(missed == 0 && share <= 0.01, "{name} at {spp} samples: {missed} lost, {share} wrong");
        }
    }
}

#[test]
fn slivers_are_not_lost_between_two_samples() {
    for (k, (name, mesh)) in shapes::all().into_iter().enumerate() {
        // Each of these turns lost something of some shape once. Of a hundred turns of each, 18 did.
        for turn in [12, 20, 21, 23, 34, 56, 68] {
            let angle = f64::from(turn) + 0.1 * k as f64;
            let from = DVec3::new(angle.cos(), 0.4 * (2.0 * angle).sin(), angle.sin());
            let stage = stage(mesh.clone(), Material { specular: Vec3::ZERO, ..Material::default() }, from);
            assert_eq!(lost(&stage, 4).0, 0, "{name} from {from}");
        }
    }
}
