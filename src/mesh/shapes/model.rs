//! A small modelling kit: closed polygon models that grow by extrusion and are creased by angle.

use crate::ids::VertexId;
use crate::mesh::sink::round;
use crate::mesh::{ControlMesh, Crease};
use glam::{DAffine3, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// A polygon mesh under construction. Face indices stay valid: operations change faces in place and append new ones.
#[derive(Clone, Debug, Default)]
pub(super) struct Model {
    pub positions: Vec<DVec3>,
    pub faces: Vec<Vec<u32>>,
    /// Sharpness by edge, the smaller vertex first.
    creases: BTreeMap<[u32; 2], f32>,
}

impl Model {
    /// Polygons without sharp edges.
    pub fn new(positions: Vec<DVec3>, faces: Vec<Vec<u32>>) -> Self {
        Self { positions, faces, creases: BTreeMap::new() }
    }

    /// The polygons of a mesh, without its tags.
    pub fn from_mesh(mesh: &ControlMesh) -> Self {
        Self::new(mesh.positions.clone(), mesh.faces().map(|face| face.iter().map(|v| v.0).collect()).collect())
    }

    /// The finished mesh, its coordinates rounded.
    pub fn into_mesh(self) -> ControlMesh {
        let positions = self.positions.into_iter().map(round).collect();
        let creases =
            self.creases.into_iter().map(|([a, b], sharpness)| Crease { edge: [VertexId(a), VertexId(b)], sharpness });
        ControlMesh { creases: creases.collect(), ..super::polygons(positions, &self.faces) }
    }

    /// Moves every vertex.
    pub fn transform(&mut self, new_from_old: DAffine3) {
        self.positions.iter_mut().for_each(|p| *p = new_from_old.transform_point3(*p));
    }

    /// Appends another model as a part of its own; returns the index of its first face.
    pub fn append(&mut self, other: &Model) -> usize {
        let (first_vertex, first_face) = (self.positions.len() as u32, self.faces.len());
        self.positions.extend(&other.positions);
        self.faces.extend(other.faces.iter().map(|f| f.iter().map(|v| v + first_vertex).collect()));
        self.creases.extend(other.creases.iter().map(|(e, &s)| (e.map(|v| v + first_vertex), s)));
        first_face
    }

    /// Mean of the vertices of some faces.
    pub fn center(&self, region: &[usize]) -> DVec3 {
        let vertices = self.vertices(region);
        vertices.iter().map(|&v| self.positions[v as usize]).sum::<DVec3>() / vertices.len() as f64
    }

    /// The face of `candidates` (any, if empty) whose centre lies farthest in a direction.
    pub fn farthest(&self, candidates: &[usize], direction: DVec3) -> usize {
        let all: Vec<_> = (0..self.faces.len()).collect();
        let candidates = if candidates.is_empty() { &all } else { candidates };
        let along = |&&f: &&usize| self.center(&[f]).dot(direction);
        *candidates.iter().max_by(|a, b| along(a).total_cmp(&along(b))).expect("a model has faces")
    }

    /// Pulls a region of faces out of the surface: it moves by `new_from_old`, quads close the gap.
    /// Returns the faces of the new wall.
    pub fn extrude(&mut self, region: &[usize], new_from_old: impl Fn(DVec3) -> DVec3) -> Vec<usize> {
        let rim = self.rim(region);
        let mut moved = BTreeMap::new();
        for v in self.vertices(region) {
            let target = new_from_old(self.positions[v as usize]);
            if rim.iter().any(|edge| edge.contains(&v)) {
                moved.insert(v, self.positions.len() as u32);
                self.positions.push(target);
            } else {
                self.positions[v as usize] = target;
            }
        }
        for &face in region {
            self.faces[face].iter_mut().for_each(|v| *v = *moved.get(v).unwrap_or(v));
        }
        let wall = self.faces.len()..self.faces.len() + rim.len();
        self.faces.extend(rim.iter().map(|&[a, b]| vec![a, b, moved[&b], moved[&a]]));
        wall.collect()
    }

    /// [`Model::extrude`] by `offset`, shrinking the region about its centre by the factor `scale`.
    pub fn extrude_scaled(&mut self, region: &[usize], scale: DVec3, offset: DVec3) -> Vec<usize> {
        let center = self.center(region);
        self.extrude(region, |p| center + (p - center) * scale + offset)
    }

    /// Gives sharpness to the edge between two vertices.
    pub fn crease(&mut self, a: u32, b: u32, sharpness: f32) {
        self.creases.insert([a.min(b), a.max(b)], sharpness);
    }

    /// Gives sharpness to each edge that is bent by more than `degrees`.
    pub fn crease_by_angle(&mut self, degrees: f64, sharpness: f32) {
        let normals: Vec<_> = self.faces.iter().map(|f| newell_normal(&self.positions, f)).collect();
        let mut first_face = BTreeMap::new();
        for (face, corners) in self.faces.iter().enumerate() {
            for [a, b] in edges(corners) {
                let edge = [a.min(b), a.max(b)];
                let Some(other) = first_face.insert(edge, face) else { continue };
                if normals[face].angle_between(normals[other]).to_degrees() > degrees {
                    self.creases.insert(edge, sharpness);
                }
            }
        }
    }

    /// Vertices of some faces, each once.
    fn vertices(&self, region: &[usize]) -> BTreeSet<u32> {
        region.iter().flat_map(|&face| self.faces[face].iter().copied()).collect()
    }

    /// Edges with a face of the region on their left and none on their right.
    fn rim(&self, region: &[usize]) -> Vec<[u32; 2]> {
        let all: Vec<_> = region.iter().flat_map(|&face| edges(&self.faces[face])).collect();
        let directed: BTreeSet<_> = all.iter().copied().collect();
        all.into_iter().filter(|&[a, b]| !directed.contains(&[b, a])).collect()
    }
}

/// The edges of a polygon, from each corner to the next.
fn edges(corners: &[u32]) -> impl Iterator<Item = [u32; 2]> {
    (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]])
}

/// The unit normal of a polygon that need not be flat.
fn newell_normal(positions: &[DVec3], corners: &[u32]) -> DVec3 {
    let sum: DVec3 = edges(corners).map(|[a, b]| positions[a as usize].cross(positions[b as usize])).sum();
    sum.normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::super::measure::{Edges, signed_volume};
    use super::super::{cube, cube_sphere};
    use super::*;

    #[test]
    fn extruded_cube_stays_closed_and_gains_the_volume() {
        let mut model = Model::from_mesh(&cube());
        let wall = model.extrude(&[3], |p| p + DVec3::Y);
        assert_eq!(wall.len(), 4);
        let mesh = model.into_mesh();
        assert!(Edges::of(&mesh).closed());
        assert_eq!(Edges::of(&mesh).euler_characteristic(&mesh), 2);
        assert!((signed_volume(&mesh) - 12.0).abs() < 1e-9);
    }

    #[test]
    fn inner_vertices_of_an_extruded_region_move_along() {
        let sphere = cube_sphere(2);
        let mut model = Model::from_mesh(&sphere);
        let region: Vec<_> = (0..model.faces.len()).filter(|&f| model.center(&[f]).y > 0.5).collect();
        assert_eq!(model.extrude(&region, |p| p + DVec3::Y).len(), 8);
        let mesh = model.into_mesh();
        assert_eq!(mesh.positions.len(), sphere.positions.len() + 8);
        assert!(Edges::of(&mesh).closed());
        assert_eq!(Edges::of(&mesh).euler_characteristic(&mesh), 2);
    }

    #[test]
    fn angle_decides_which_edges_are_sharp() {
        let mut model = Model::from_mesh(&cube());
        model.crease_by_angle(91.0, 2.0);
        assert!(model.creases.is_empty());
        model.crease_by_angle(89.0, 2.0);
        assert_eq!(model.creases.len(), 12);
    }
}
