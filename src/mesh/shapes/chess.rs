//! A chess set: bodies of revolution with semi-sharp creases, and a knight swept along its neck.
//!
//! Lengths are in squares of the board. Pieces stand on y = 0 about the y axis; the knight looks towards +x.

use super::model::Model;
use super::sweep::{Section, lathe, sweep};
use crate::mesh::ControlMesh;
use glam::{DAffine3, DVec3};

/// Vertices around a piece: enough for a B-spline curve to be round to 1e-4.
const N: u32 = 16;

/// (radius, height, sharpness), as [`lathe`] takes them.
type Profile = Vec<(f64, f64, f32)>;

/// The foot that all pieces share, scaled to a radius.
fn foot(radius: f64) -> Profile {
    let foot =
        [(1.0, 0.0, 3.0), (1.0, 0.10, 2.0), (0.93, 0.14, 1.0), (0.80, 0.17, 2.5), (0.80, 0.22, 2.5), (0.66, 0.25, 1.0)];
    foot.map(|(r, y, s)| (r * radius, y, s)).to_vec()
}

/// A foot, then the rest of the profile.
fn profile(foot_radius: f64, rest: &[(f64, f64, f32)]) -> Profile {
    let mut all = foot(foot_radius);
    all.extend_from_slice(rest);
    all
}

/// Pawn, 0.98 high.
pub fn pawn() -> ControlMesh {
    let rest = [
        (0.150, 0.36, 0.0),
        (0.110, 0.50, 0.0),
        (0.105, 0.58, 0.8),
        (0.205, 0.615, 2.0),
        (0.205, 0.645, 2.0),
        (0.110, 0.67, 1.0),
        (0.215, 0.72, 0.0),
        (0.245, 0.83, 0.0),
        (0.190, 0.945, 0.0),
        (0.075, 0.985, 0.0),
        (0.0, 0.985, 0.0),
    ];
    lathe(&profile(0.31, &rest), N).into_mesh()
}

/// Rook, 1.17 high, with six battlements.
pub fn rook() -> ControlMesh {
    const AROUND: u32 = 24;
    let rest = [
        (0.200, 0.36, 0.0),
        (0.175, 0.60, 0.0),
        (0.170, 0.78, 0.6),
        (0.270, 0.84, 2.0),
        (0.270, 0.89, 1.0),
        (0.280, 1.05, 3.0),
        (0.195, 1.05, 3.0),
        (0.185, 0.97, 2.0),
        (0.0, 0.95, 0.0),
    ];
    let profile = profile(0.34, &rest);
    let wall_top = (profile.len() - 4) * AROUND as usize;
    let mut model = lathe(&profile, AROUND);
    for merlon in 0..6 {
        let region: Vec<_> = (0..2).map(|i| wall_top + 4 * merlon + i).collect();
        model.extrude(&region, |p| p + DVec3::Y * 0.13);
    }
    model.crease_by_angle(60.0, 3.0);
    model.into_mesh()
}

/// Bishop, 1.46 high, its mitre slit.
pub fn bishop() -> ControlMesh {
    let rest = [
        (0.170, 0.36, 0.0),
        (0.120, 0.58, 0.0),
        (0.105, 0.76, 0.8),
        (0.225, 0.80, 2.0),
        (0.225, 0.83, 2.0),
        (0.140, 0.86, 1.0),
        (0.175, 0.89, 1.5),
        (0.120, 0.92, 0.5),
        (0.215, 0.99, 0.0),
        (0.235, 1.08, 0.0),
        (0.215, 1.17, 2.0),
        (0.200, 1.20, 2.0),
        (0.130, 1.31, 0.0),
        (0.050, 1.38, 0.8),
        (0.075, 1.40, 0.0),
        (0.075, 1.46, 0.0),
        (0.030, 1.485, 0.0),
        (0.0, 1.485, 0.0),
    ];
    let profile = profile(0.34, &rest);
    let slit_ring = profile.iter().position(|&(_, y, _)| y == 1.17).unwrap_or_default();
    let mut model = lathe(&profile, N);
    tilt_mitre(&mut model);
    let slit: Vec<_> = [14, 15, 0, 1].map(|i| slit_ring * N as usize + i).to_vec();
    let wall = model.extrude(&slit, |p| DVec3::new(0.03 + 0.25 * p.x, p.y - 0.05, 0.8 * p.z));
    for face in wall {
        let (a, b) = (model.faces[face][0], model.faces[face][1]);
        model.crease(a, b, 2.5);
    }
    model.into_mesh()
}

/// Leans the rings of the mitre upwards to +x, so that the slit between two of them runs aslant.
fn tilt_mitre(model: &mut Model) {
    for p in &mut model.positions {
        let weight = 1.0 - ((p.y - 1.185) / 0.2).abs();
        p.y += weight.max(0.0) * 0.55 * p.x;
    }
}

/// Queen, 1.66 high, with a coronet of eight points.
pub fn queen() -> ControlMesh {
    let rest = [
        (0.190, 0.36, 0.0),
        (0.125, 0.66, 0.0),
        (0.105, 0.98, 0.8),
        (0.235, 1.03, 2.0),
        (0.235, 1.065, 2.0),
        (0.150, 1.10, 1.0),
        (0.185, 1.13, 1.5),
        (0.125, 1.17, 0.5),
        (0.165, 1.30, 0.0),
        (0.275, 1.49, 2.0),
        (0.225, 1.47, 1.0),
        (0.170, 1.50, 0.0),
        (0.060, 1.555, 1.0),
        (0.085, 1.575, 0.0),
        (0.085, 1.645, 0.0),
        (0.035, 1.675, 0.0),
        (0.0, 1.675, 0.0),
    ];
    let profile = profile(0.37, &rest);
    let rim = profile.iter().position(|&(_, y, _)| y == 1.49).unwrap_or_default() * N as usize;
    let mut model = lathe(&profile, N);
    for p in model.positions[rim..rim + N as usize].iter_mut().step_by(2) {
        *p += DVec3::new(0.12 * p.x, 0.07, 0.12 * p.z);
    }
    model.into_mesh()
}

/// King, 1.86 high; the cross is a part of its own that stands on the crown.
pub fn king() -> ControlMesh {
    let rest = [
        (0.195, 0.36, 0.0),
        (0.135, 0.68, 0.0),
        (0.115, 1.04, 0.8),
        (0.245, 1.09, 2.0),
        (0.245, 1.13, 2.0),
        (0.155, 1.17, 1.0),
        (0.195, 1.20, 1.5),
        (0.135, 1.24, 0.5),
        (0.180, 1.38, 0.0),
        (0.265, 1.53, 2.5),
        (0.255, 1.56, 2.0),
        (0.130, 1.62, 0.0),
        (0.065, 1.64, 2.0),
        (0.055, 1.66, 2.0),
    ];
    let mut model = lathe(&profile(0.38, &rest), N);
    model.append(&cross());
    model.into_mesh()
}

/// A cross of five cubes, 0.2 high, from y = 1.661 upwards.
fn cross() -> Model {
    let mut cross = Model::from_mesh(&super::cube());
    let (arm, top, bottom) = (DVec3::new(1.0, 1.25, 1.25), DVec3::new(1.3, 1.0, 1.25), DVec3::new(1.0, 1.0, 1.0));
    cross.extrude_scaled(&[0], arm, DVec3::NEG_X * 2.0);
    cross.extrude_scaled(&[1], arm, DVec3::X * 2.0);
    cross.extrude_scaled(&[3], top, DVec3::Y * 2.0);
    cross.extrude_scaled(&[2], bottom, DVec3::NEG_Y * 2.2);
    cross.crease_by_angle(40.0, 2.5);
    let lowest = cross.positions.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    cross.transform(
        DAffine3::from_translation(DVec3::Y * 1.661)
            * DAffine3::from_scale(DVec3::new(0.034, 0.034, 0.028))
            * DAffine3::from_translation(DVec3::Y * -lowest),
    );
    cross
}

/// Knight, 1.3 high, looking towards +x.
pub fn knight() -> ControlMesh {
    let neck = |x, y, tilt, a, b, sharpness| Section { center: [x, y], tilt, radii: [a, b], sharpness };
    let mut sections: Vec<_> = foot(0.34).iter().map(|&(r, y, s)| Section::level(r, y, s)).collect();
    sections.extend([
        neck(0.00, 0.29, 0.0, 0.235, 0.215, 1.0),
        neck(-0.01, 0.42, -0.10, 0.245, 0.185, 0.0),
        neck(-0.06, 0.62, -0.12, 0.225, 0.150, 0.0),
        neck(-0.08, 0.82, 0.10, 0.190, 0.130, 0.0),
        neck(-0.04, 1.00, 0.55, 0.175, 0.120, 0.0),
        neck(0.05, 1.10, 1.15, 0.175, 0.120, 0.0),
        neck(0.15, 1.08, 1.85, 0.185, 0.130, 0.0),
        neck(0.25, 1.00, 2.10, 0.130, 0.100, 0.0),
        neck(0.335, 0.925, 2.15, 0.110, 0.090, 0.0),
        neck(0.385, 0.87, 2.15, 0.110, 0.090, 1.5),
        neck(0.41, 0.84, 2.15, 0.075, 0.060, 0.0),
    ]);
    let poll = sections.len() - 6;
    let mut model = sweep(&sections, N);
    let back = N as usize / 2;
    crease_mane(&mut model, back as u32, poll as u32);
    for sectors in [[back - 3, back - 2], [back + 1, back + 2]] {
        let ear = sectors.map(|i| poll * N as usize + i);
        let outwards = 0.01 * model.center(&ear).z.signum();
        model.extrude_scaled(&ear, DVec3::new(0.75, 0.75, 0.8), DVec3::new(-0.02, 0.07, outwards));
        model.extrude_scaled(&ear, DVec3::new(0.2, 0.5, 0.3), DVec3::new(0.0, 0.10, outwards));
    }
    model.into_mesh()
}

/// Draws the back of the neck out to a sharp, waved mane from the foot to the poll.
fn crease_mane(model: &mut Model, back: u32, poll: u32) {
    for k in 7..=poll {
        let v = (k * N + back) as usize;
        let inner = model.positions[(k * N) as usize];
        let outwards = (model.positions[v] - inner).normalize();
        model.positions[v] += outwards * if k.is_multiple_of(2) { 0.07 } else { 0.04 };
        if k > 7 {
            model.crease(v as u32, v as u32 - N, 2.0);
        }
    }
}

/// The slab under a board of 8 x 8 squares of edge 1 about the origin; its top is y = 0.
pub fn board() -> ControlMesh {
    let mut slab = Model::from_mesh(&super::cube());
    slab.transform(DAffine3::from_translation(DVec3::Y * -0.2) * DAffine3::from_scale(DVec3::new(4.0, 0.2, 4.0)));
    slab.crease_by_angle(40.0, f32::INFINITY);
    slab.into_mesh()
}

/// The frame around the board, with a bevelled rim.
pub fn frame() -> ControlMesh {
    let ring = |half: f64, y: f64| {
        [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[x, z]| DVec3::new(half * x, y, half * z))
    };
    let profile = [(4.01, -0.42), (4.7, -0.42), (4.7, -0.1), (4.6, 0.03), (4.12, 0.03), (4.01, 0.0)];
    let positions = profile.iter().flat_map(|&(half, y)| ring(half, y)).collect();
    let n = profile.len() as u32;
    let faces = (0..4 * n).map(|k| {
        let (k, i) = (k / 4, k % 4);
        let (next, j) = ((k + 1) % n, (i + 1) % 4);
        vec![4 * k + i, 4 * k + j, 4 * next + j, 4 * next + i]
    });
    let mut frame = Model::new(positions, faces.collect());
    // Flat edges too: the mitres keep the corners of the frame square.
    frame.crease_by_angle(-1.0, 4.0);
    frame.into_mesh()
}

#[cfg(test)]
mod tests {
    use super::super::measure::{Edges, signed_volume};
    use super::*;

    #[test]
    fn pieces_are_closed_and_stand_on_their_square() {
        let pieces = [pawn(), rook(), bishop(), queen(), king(), knight()];
        for (i, piece) in pieces.iter().enumerate() {
            piece.validate().unwrap();
            assert!(Edges::of(piece).closed(), "piece {i}");
            assert!(signed_volume(piece) > 0.1, "piece {i}");
            let bounds = piece.bounds();
            assert_eq!(bounds.min.y, 0.0, "piece {i}");
            assert!(bounds.min.x > -0.5 && bounds.max.x < 0.5 && bounds.max.z < 0.5, "piece {i}: {bounds:?}");
        }
    }

    #[test]
    fn king_is_the_highest_piece_and_pawn_the_lowest() {
        let height = |piece: ControlMesh| piece.bounds().max.y;
        let heights = [pawn(), rook(), knight(), bishop(), queen(), king()].map(height);
        assert!(heights.is_sorted(), "{heights:?}");
    }

    #[test]
    fn every_piece_has_semi_sharp_creases() {
        for piece in [pawn(), rook(), bishop(), queen(), king(), knight()] {
            assert!(piece.creases.iter().any(|c| c.sharpness > 0.0 && c.sharpness < 10.0));
        }
    }

    #[test]
    fn board_and_frame_are_closed() {
        for part in [board(), frame()] {
            assert!(Edges::of(&part).closed());
            assert!(signed_volume(&part) > 1.0);
        }
    }
}
