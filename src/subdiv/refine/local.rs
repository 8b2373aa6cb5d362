//! Refinement of a neighbourhood only: deep levels at a few points of a patch.
//!
//! The mesh after a step depends, within one ring of a cell's child, only on two rings of faces about the cell. So the
//! rest is dropped before each step. Vertices at the rim of what is left are wrong; none of them is ever looked at.

use super::{Corner, Face, RefinedMesh, Sample};
use crate::ids::FaceId;
use std::collections::HashMap;

/// Deepest cells that are looked at: parameters are rounded to multiples of 2^-40.
const MAX_LEVEL: u32 = 40;

/// A point that is looked for: index in the caller's list, and (u, v) in the cell at hand.
type Wanted = (usize, [f64; 2]);

impl RefinedMesh<'_> {
    /// The limit surface of patch (`face`, `sub`) at (u, v) in [0, 1]².
    ///
    /// None where there is no surface, as in holes. The time grows with the number of halvings it takes to reach (u,
    /// v): a multiple of 1/8 takes three, any other number up to 40. Where edits make a crease or the border of a hole
    /// inside the patch, the point belongs to the cell with the larger u and v.
    ///
    /// # Panics
    /// If a step has been made already, or the mesh has no such patch.
    pub fn limit_at(&self, face: FaceId, sub: u32, u: f64, v: f64) -> Option<Sample> {
        self.limits_at(face, sub, &[[u, v]])[0]
    }

    /// [`Self::limit_at`] for many points of a patch, which share the refinement.
    pub fn limits_at(&self, face: FaceId, sub: u32, points: &[[f64; 2]]) -> Vec<Option<Sample>> {
        assert_eq!(self.n_steps, 0, "points are evaluated from the control mesh");
        let mut found = vec![None; points.len()];
        let wanted: Vec<Wanted> = points.iter().copied().enumerate().collect();
        let around = self.two_rings(face.idx());
        if self.corners(face.idx()).len() == 4 {
            around.descend(wanted, &mut found);
        } else {
            around.refine().two_rings(sub as usize).descend(wanted, &mut found);
        }
        found
    }

    /// Finds the wanted points in cell 0 of this mesh, as far as its corners are at rest, or in its children.
    fn descend(&self, wanted: Vec<Wanted>, found: &mut [Option<Sample>]) {
        if self.is_hole(0) {
            return;
        }
        let mut by_child: [Vec<Wanted>; 4] = Default::default();
        for (index, point) in wanted {
            match self.limit_in_cell(point) {
                Some(sample) => found[index] = Some(sample),
                None => {
                    let (k, point) = child_point(point);
                    by_child[k].push((index, point));
                }
            }
        }
        if by_child.iter().any(|points| !points.is_empty()) {
            let refined = self.refine();
            for (k, points) in by_child.into_iter().enumerate().filter(|(_, points)| !points.is_empty()) {
                refined.two_rings(k).descend(points, found);
            }
        }
    }

    /// The sample, if (u, v) is a corner of cell 0 and at rest there.
    fn limit_in_cell(&self, [u, v]: [f64; 2]) -> Option<Sample> {
        let at_last_level = self.place(0).level >= MAX_LEVEL;
        let is_corner = u.fract() == 0.0 && v.fract() == 0.0;
        if !is_corner && !at_last_level {
            return None;
        }
        let k = match (u.round() > 0.0, v.round() > 0.0) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3,
        };
        self.limit(0, k)
    }

    /// The faces within two rings of `face`, which comes first.
    fn two_rings(&self, face: usize) -> Self {
        let ring = self.faces_touching(&[face]);
        self.restricted(face, &self.faces_touching(&ring))
    }

    /// The faces at corner `k` of `face`, which comes first.
    pub(super) fn at_corner(&self, face: usize, k: usize) -> Self {
        let vertex = self.corners(face)[k].vertex;
        let touches = |f: &usize| self.corners(*f).iter().any(|c| c.vertex == vertex);
        let faces: Vec<usize> = (0..self.n_faces()).filter(touches).collect();
        self.restricted(face, &faces)
    }

    /// The faces that share a vertex with some of `faces`, those included.
    fn faces_touching(&self, faces: &[usize]) -> Vec<usize> {
        let mut touched = vec![false; self.n_vertices()];
        faces.iter().flat_map(|&f| self.corners(f)).for_each(|c| touched[c.vertex as usize] = true);
        let touches = |f: &usize| self.corners(*f).iter().any(|c| touched[c.vertex as usize]);
        (0..self.n_faces()).filter(touches).collect()
    }

    /// The mesh of these faces alone, `first` before the others.
    fn restricted(&self, first: usize, faces: &[usize]) -> Self {
        let mut part = RefinedMesh {
            control: self.control,
            edits: self.edits.clone(),
            n_steps: self.n_steps,
            vertices: Vec::new(),
            edges: Vec::new(),
            faces: Vec::with_capacity(faces.len()),
            corners: Vec::with_capacity(4 * faces.len()),
        };
        let (mut vertices, mut edges) = (HashMap::new(), HashMap::new());
        let others = faces.iter().copied().filter(|&f| f != first);
        for f in std::iter::once(first).chain(others) {
            part.faces.push(Face { first_corner: part.corners.len() as u32, ..self.faces[f] });
            for corner in self.corners(f) {
                let vertex = number(&mut vertices, corner.vertex, &self.vertices, &mut part.vertices);
                let edge = number(&mut edges, corner.edge, &self.edges, &mut part.edges);
                part.corners.push(Corner { vertex, edge });
            }
        }
        for end in part.edges.iter_mut().flat_map(|e| &mut e.ends) {
            *end = vertices[end];
        }
        part
    }
}

/// The new number of an element that moves from `old` to `new` when first asked for.
fn number<T: Copy>(numbers: &mut HashMap<u32, u32>, id: u32, old: &[T], new: &mut Vec<T>) -> u32 {
    *numbers.entry(id).or_insert_with(|| {
        new.push(old[id as usize]);
        new.len() as u32 - 1
    })
}

/// The quarter of the cell that holds (u, v), and (u, v) in it.
fn child_point([u, v]: [f64; 2]) -> (usize, [f64; 2]) {
    let (right, top) = (u >= 0.5, v >= 0.5);
    let k = match (right, top) {
        (false, false) => 0,
        (true, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    };
    (k, [2.0 * u - f64::from(right), 2.0 * v - f64::from(top)])
}
