//! `lazytess sample`: limit positions and tangents at given places.

use super::input::EditArgs;
use super::stdout;
use crate::error::{Error, Result};
use crate::io::samples::{SamplePlace, read_sample_places};
use crate::mesh::ControlMesh;
use crate::subdiv::{Dicer, SampleKind, Surface};
use clap::Args;
use glam::DVec3;
use std::io::Write;
use std::path::PathBuf;

/// Print positions and tangents of the limit surface as CSV
///
/// Places are rows of face,sub,u,v: the face in file order from 0, the quad within it (0 for a quad, the corner's
/// number for another polygon) and the parameters there. Tangents are derivatives with respect to u and v, unit vectors
/// at smooth extraordinary vertices, and zero where there are none. Evaluated with the code that dices grids.
#[derive(Args, Clone, Debug)]
pub struct SampleArgs {
    /// mesh.obj
    pub mesh: PathBuf,
    /// CSV with face,sub,u,v in its first columns
    #[arg(long, value_name = "SAMPLES.csv")]
    pub at: PathBuf,
    /// Hierarchical edits
    #[command(flatten)]
    pub edits: EditArgs,
}

impl SampleArgs {
    /// Prints a row for each place.
    pub fn run(self) -> Result<()> {
        let places = read_sample_places(&self.at)?;
        let mesh = self.edits.load_mesh(&self.mesh)?;
        let surface = Surface::new(&mesh, 1)?;
        for place in &places {
            check_place(place, &mesh, &surface)
                .map_err(|message| Error::input(message).at(&self.at, Some(place.line)))?;
        }
        let mut dicer = Dicer::default();
        stdout::print(|out| {
            writeln!(out, "face,sub,u,v,px,py,pz,dux,duy,duz,dvx,dvy,dvz")?;
            places.iter().try_for_each(|place| {
                let SamplePlace { face, sub, u, v, .. } = *place;
                write!(out, "{face},{sub},{u},{v}")?;
                let values = evaluate(&surface, &mut dicer, place);
                values.into_iter().flat_map(|p| p.to_array()).try_for_each(|value| write!(out, ",{value:.16e}"))?;
                writeln!(out)
            })
        })
    }
}

fn check_place(place: &SamplePlace, mesh: &ControlMesh, surface: &Surface) -> Result<(), String> {
    let SamplePlace { face, sub, u, v, .. } = *place;
    let Some(&n) = mesh.face_sizes.get(face.idx()) else {
        return Err(format!("face {face} does not exist: the mesh has {}, counted from 0", mesh.n_faces()));
    };
    let n_quads = if n == 4 { 1 } else { n };
    if sub >= n_quads {
        return Err(format!("face {face} has {n_quads} quads, counted from 0; {sub} does not exist"));
    }
    let patch = surface.patch_of(face, sub);
    if !surface.is_visible(patch) {
        return Err(format!("face {face} has no surface: it is a hole, or at a boundary of rule 0"));
    }
    if surface.edited().hide_point(patch, u, v) {
        return Err(format!("face {face} has no surface at u = {u}, v = {v}: `t faceedit` makes a hole there"));
    }
    Ok(())
}

/// Position, du and dv in object space.
fn evaluate(surface: &Surface, dicer: &mut Dicer, place: &SamplePlace) -> [DVec3; 3] {
    let sample = dicer.sample(surface, surface.patch_of(place.face, place.sub), place.u, place.v);
    let lattice = surface.lattice();
    let scale = match sample.kind {
        SampleKind::Regular => lattice.step,
        SampleKind::Extraordinary => 1.0,
        SampleKind::PositionOnly => 0.0,
    };
    [lattice.to_object(sample.position), scale * sample.du, scale * sample.dv]
}
