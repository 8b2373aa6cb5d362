//! A crowd of puppets, no two alike: many distinct control meshes in one, none an instance of another.

use super::basic::block;
use super::model::Model;
use super::noise::Random;
use crate::mesh::{Assembly, ControlMesh, MeshSink};
use glam::{DAffine3, DVec3, IVec3};
use std::io;

/// A crowd of about so many faces, standing on a square about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crowd {
    n_figures: u32,
    seed: u64,
}

impl Crowd {
    /// Mean number of faces of a figure (measured over a thousand).
    const FACES_PER_FIGURE: u64 = 133;

    /// Distance between neighbours; a figure is about 1.7 high.
    const SPACING: f64 = 1.7;

    /// A crowd of about `n_faces` faces, at least one figure.
    pub fn new(n_faces: u64, seed: u64) -> Self {
        Self { n_figures: (n_faces / Self::FACES_PER_FIGURE).clamp(1, u64::from(u32::MAX)) as u32, seed }
    }

    /// Writes figure after figure.
    pub fn write(&self, sink: &mut dyn MeshSink) -> io::Result<()> {
        let mut assembly = Assembly::new(sink);
        (0..self.n_figures).try_for_each(|i| assembly.add(&figure(self.seed, i), self.place(i)))
    }

    /// Where figure `i` stands: near its place in a square of rows, turned a little.
    fn place(&self, i: u32) -> DAffine3 {
        let side = f64::from(self.n_figures).sqrt().ceil();
        let mut random = Random::new(self.seed ^ 0x91ace, u64::from(i));
        let mut along = |k: f64| Self::SPACING * (k - 0.5 * (side - 1.0) + random.within(-0.25, 0.25));
        let (row, column) = ((f64::from(i) / side).floor(), f64::from(i) % side);
        let position = DVec3::new(along(column), 0.0, along(row));
        DAffine3::from_translation(position) * DAffine3::from_rotation_y(random.within(-0.6, 0.6))
    }
}

/// Puppet number `index` of a seed, standing on y = 0 and looking towards +z.
pub(super) fn figure(seed: u64, index: u32) -> ControlMesh {
    let mut random = Random::new(seed, u64::from(index));
    let mut body = torso(&mut random);
    // Faces keep their numbers while others grow, so all are looked up on the bare torso.
    let sides = [-1.0, 1.0];
    let shoulders = sides.map(|side| body.farthest(&[], DVec3::new(side, 0.3, 0.0)));
    let hips = sides.map(|side| body.farthest(&[], DVec3::new(0.4 * side, -1.0, 0.0)));
    let crown = sides.map(|side| body.farthest(&[], DVec3::new(0.4 * side, 1.0, 0.0)));
    let (arm_angle, arm_length) = (random.within(-0.5, 1.2), random.within(0.45, 0.7));
    let (leg_length, stride) = (random.within(0.35, 0.7), random.within(-0.15, 0.15));
    for (i, side) in sides.into_iter().enumerate() {
        arm(&mut body, shoulders[i], side, arm_angle + random.within(-0.3, 0.3), arm_length);
        leg(&mut body, hips[i], side, leg_length, side * stride);
    }
    head(&mut body, crown, &mut random);
    let lowest = body.positions.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    body.transform(DAffine3::from_translation(DVec3::Y * -lowest));
    body.into_mesh()
}

/// A block of 2 x 2 x 1 cells: a chest above a belly. Arms, legs and neck grow out of its faces.
fn torso(random: &mut Random) -> Model {
    let half_width = random.within(0.24, 0.36);
    let height = random.within(0.5, 0.75);
    let depth = random.within(0.3, 0.5);
    let waist = random.within(0.75, 1.15);
    let place = |p: IVec3| {
        let width = half_width * if p.y == 1 { waist } else { 1.0 };
        let (side, front) = (f64::from(p.x - 1), f64::from(2 * p.z - 1));
        DVec3::new(width * side, 0.5 * height * f64::from(p.y), 0.5 * depth * front)
    };
    Model::from_mesh(&block(IVec3::new(2, 2, 1), place))
}

/// Two segments out of the shoulder; `raised` is the angle above level in radians.
fn arm(body: &mut Model, shoulder: usize, side: f64, raised: f64, length: f64) {
    let shoulder = [shoulder];
    let upper = DVec3::new(side * raised.cos(), raised.sin(), 0.1) * 0.5 * length;
    let lower = DVec3::new(side * (1.7 * raised).cos(), (1.7 * raised).sin(), 0.5) * 0.5 * length;
    body.extrude_scaled(&shoulder, DVec3::new(1.0, 0.6, 0.6), 0.3 * upper);
    body.extrude_scaled(&shoulder, DVec3::ONE, upper);
    body.extrude_scaled(&shoulder, DVec3::splat(0.8), lower);
    body.extrude_scaled(&shoulder, DVec3::splat(1.3), 0.4 * lower);
}

/// Two segments down and a foot to the front; the foot stands `step` before the hip.
fn leg(body: &mut Model, hip: usize, side: f64, length: f64, step: f64) {
    let sole = [hip];
    let half = DVec3::new(0.03 * side, -0.5 * length, 0.5 * step);
    body.extrude_scaled(&sole, DVec3::new(0.75, 1.0, 0.65), 0.2 * half);
    body.extrude_scaled(&sole, DVec3::splat(0.9), half);
    body.extrude_scaled(&sole, DVec3::splat(0.95), half);
    let shoe = body.extrude_scaled(&sole, DVec3::new(1.25, 1.0, 1.25), DVec3::Y * -0.14);
    let toe = body.farthest(&shoe, DVec3::Z);
    body.extrude_scaled(&[toe], DVec3::new(1.1, 0.8, 1.0), DVec3::new(0.0, -0.01, 0.17));
}

/// A neck and a head, with hair, a hat or horns.
fn head(body: &mut Model, crown: [usize; 2], random: &mut Random) {
    let size = random.within(0.8, 1.3);
    body.extrude_scaled(&crown, DVec3::new(0.42, 1.0, 0.45), DVec3::Y * 0.08);
    body.extrude_scaled(&crown, DVec3::splat(0.9), DVec3::Y * 0.08);
    body.extrude_scaled(&crown, DVec3::new(2.0, 1.0, 2.2) * size, DVec3::Y * 0.05);
    let skull = body.extrude_scaled(&crown, DVec3::new(1.05, 1.0, 1.05), DVec3::Y * 0.22 * size);
    nose(body, &skull, random.within(0.02, 0.12));
    match random.below(4) {
        0 => brimmed_hat(body, &crown, random.within(0.15, 0.4)),
        1 => {
            let cone = DVec3::Y * random.within(0.2, 0.5);
            body.extrude_scaled(&crown, DVec3::new(0.25, 1.0, 0.25), cone);
        }
        2 => horns(body, crown, random.within(0.1, 0.25)),
        _ => {
            body.extrude_scaled(&crown, DVec3::new(0.7, 1.0, 0.7), DVec3::Y * 0.12 * size);
        }
    }
}

fn nose(body: &mut Model, skull: &[usize], length: f64) {
    let face = body.farthest(skull, DVec3::new(0.01, 0.0, 1.0));
    body.extrude_scaled(&[face], DVec3::new(0.35, 0.35, 1.0), DVec3::Z * 0.02);
    body.extrude_scaled(&[face], DVec3::splat(0.8), DVec3::Z * length);
}

/// A hat whose brim and lid have semi-sharp edges.
fn brimmed_hat(body: &mut Model, crown: &[usize], height: f64) {
    let mut creased = body.extrude_scaled(crown, DVec3::new(1.6, 1.0, 1.6), DVec3::Y * 0.02);
    creased.extend(body.extrude_scaled(crown, DVec3::ONE, DVec3::Y * 0.04));
    body.extrude_scaled(crown, DVec3::new(0.55, 1.0, 0.55), DVec3::Y * 0.02);
    creased.extend(body.extrude_scaled(crown, DVec3::new(0.9, 1.0, 0.9), DVec3::Y * height));
    for wall in creased {
        let (a, b) = (body.faces[wall][2], body.faces[wall][3]);
        body.crease(a, b, 2.2);
    }
}

fn horns(body: &mut Model, crown: [usize; 2], length: f64) {
    for (horn, side) in crown.into_iter().zip([-1.0, 1.0]) {
        body.extrude_scaled(&[horn], DVec3::new(0.4, 1.0, 0.4), DVec3::new(0.05 * side, 0.05, 0.0));
        body.extrude_scaled(&[horn], DVec3::new(0.3, 1.0, 0.3), DVec3::new(0.08 * side, length, 0.0));
    }
}

#[cfg(test)]
mod tests {
    use super::super::measure::{Edges, signed_volume};
    use super::*;

    #[test]
    fn puppets_are_closed_and_differ() {
        for i in 0..50 {
            let puppet = figure(1, i);
            puppet.validate().unwrap();
            assert!(Edges::of(&puppet).closed(), "figure {i}");
            assert_eq!(Edges::of(&puppet).euler_characteristic(&puppet), 2, "figure {i}");
            assert!(signed_volume(&puppet) > 0.05, "figure {i}");
            assert_eq!(puppet.bounds().min.y, 0.0);
            assert_ne!(puppet.positions, figure(1, i + 1).positions);
        }
    }

    #[test]
    fn crowd_has_about_as_many_faces_as_asked() {
        let mut mesh = ControlMesh::default();
        Crowd::new(50_000, 2).write(&mut mesh).unwrap();
        mesh.validate().unwrap();
        assert!(mesh.n_faces().abs_diff(50_000) < 2500, "{}", mesh.n_faces());
        assert!(mesh.creases.iter().all(|c| c.sharpness == 2.2));
    }
}
