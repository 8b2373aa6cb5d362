//! The promises of `--groups adaptive` on scenes that nobody chose: thin and small bodies at random places, with random
//! materials, lights and views.

use super::*;
use crate::math::DBounds;
use crate::mesh::shapes;
use crate::render::sampler::pcg;
use crate::scene::description::Glass;

const SIZE: [u32; 2] = [144, 96];

/// Numbers in 0..1, one after another.
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = pcg(self.0);
        f64::from(self.0) / 2f64.powi(32)
    }

    fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.next()
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }

    fn color(&mut self) -> Vec3 {
        Vec3::new(self.next() as f32, self.next() as f32, self.next() as f32)
    }

    fn material(&mut self, may_be_glass: bool) -> Material {
        let checker = Albedo::Checker { even: self.color(), odd: self.color(), size: self.between(0.3, 2.0) };
        let diffuse = if self.next() < 0.3 { checker } else { Albedo::Constant(self.color()) };
        let mirror = if self.next() < 0.4 { 0.5 * self.color() } else { Vec3::ZERO };
        let glass = (may_be_glass && self.next() < 0.3).then_some(Glass { ior: 1.5, transmit: Vec3::splat(0.9) });
        let specular = Vec3::splat(self.between(0.0, 0.5) as f32);
        Material { diffuse, mirror, glass, specular, shininess: self.between(5.0, 300.0) as f32, ..Material::default() }
    }

    /// A place for a body: somewhere, turned somehow, often flat or thin.
    fn place(&mut self) -> DAffine3 {
        let scale = DVec3::new(self.next(), self.next(), self.next()).powf(2.0).max(DVec3::splat(0.01));
        let turn = DQuat::from_axis_angle(self.vector().normalize_or(DVec3::X), self.between(0.0, 6.3));
        DAffine3::from_scale_rotation_translation(scale, turn, 2.5 * self.vector())
    }

    fn stage(&mut self) -> Stage {
        let corpus = shapes::all();
        let may_be_glass = self.next() < 0.25;
        let mut meshes = vec![WorldMesh::new(floor(), DAffine3::IDENTITY, DicingRate::Fixed(8), 1).unwrap()];
        for _ in 0..8 {
            let mesh = corpus[(self.next() * corpus.len() as f64) as usize].1.clone();
            let to_unit = unit_cube(mesh.positions.iter().copied().collect());
            meshes.push(WorldMesh::new(mesh, self.place() * to_unit, DicingRate::Fixed(8), 1).unwrap());
        }
        let materials = meshes.iter().map(|_| self.material(may_be_glass)).collect();
        let sun = Light::Directional {
            direction: DVec3::new(0.3, -1.0, 0.2) + 0.7 * self.vector(),
            irradiance: 2.0 * Vec3::ONE,
        };
        let lamp = Light::Point { position: 6.0 * DVec3::Y + 3.0 * self.vector(), intensity: Vec3::splat(60.0) };
        let lights = vec![sun, lamp, Light::Sky { radiance: Vec3::splat(0.2) }];
        let eye = DVec3::new(0.0, 1.5, 0.0) + 7.0 * DVec3::new(self.between(-1.0, 1.0), self.between(0.0, 0.6), 1.0);
        let camera = CameraDescription { eye, at: self.vector(), up: DVec3::Y, fov: self.between(20.0, 70.0) };
        Stage {
            world: World::new(meshes),
            appearance: Appearance::new(materials, lights, Vec3::splat(0.3)),
            camera: Camera::new(&camera),
        }
    }
}

pub(super) fn unit_cube(bounds: DBounds) -> DAffine3 {
    let size = (bounds.max - bounds.min).max_element().max(1e-9);
    DAffine3::from_scale(DVec3::splat(2.0 / size)) * DAffine3::from_translation(-bounds.center())
}

#[test]
fn random_scenes_keep_their_objects_and_the_tolerance() {
    let mut saved = 0.0;
    for seed in 0..50 {
        let stage = Numbers(pcg(seed)).stage();
        let tolerance = [1.0, 5.0, 10.0][seed as usize % 3] / 255.0;
        let [full, grouped] = [Groups::Off, Groups::Adaptive].map(|groups| {
            let (spp, aovs) = ([1, 4][seed as usize % 2], vec![Aov::Mesh]);
            stage.render(&RenderSettings { groups, aovs, tolerance, spp, ..RenderSettings::of_size(SIZE) }, 2)
        });
        let share = share_above(&full.film, &grouped.film, tolerance);
        assert!(share <= 0.01, "seed {seed}: {share} of the pixels are above {tolerance}");
        let [a, b] = [&full, &grouped].map(|rendered| ids(&rendered.film, Aov::Mesh));
        assert_eq!(missed_ids(SIZE[0] as usize, a, b, FirstHit::NO_ID), 0, "seed {seed}");
        saved += 1.0 - grouped.rays.total() as f64 / full.rays.total() as f64;
    }
    assert!(saved > 5.0, "a tenth of the rays is saved at least, {saved} of 50");
}
