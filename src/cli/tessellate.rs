//! `lazytess tessellate`: the triangles themselves.

use super::input::EditArgs;
use super::interrupt::{cancel_on_interrupt, unless_interrupted};
use super::outputs::{check_extension, check_outputs};
use super::run_options::RunArgs;
use super::values::fixed_rate;
use crate::error::{Error, Result};
use crate::io::write::write_whole;
use crate::scene::rate::DicingRate;
use crate::scene::tessellate::tessellate;
use crate::scene::world::WorldMesh;
use clap::Args;
use glam::DAffine3;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Write the tessellation as an OBJ of triangles
///
/// All vertices lie on the limit surface and neighbouring patches share them: the result is as closed as the control
/// mesh. The triangles of each control face are a group `face_N`, N in file order from 0. All triangles and a number
/// for each vertex are in memory until the file is written, some 60 bytes a triangle: the other commands need no such
/// thing.
#[derive(Args, Clone, Debug)]
pub struct TessellateArgs {
    /// mesh.obj
    pub mesh: PathBuf,
    /// Pieces for each edge
    #[arg(long, value_name = "N", value_parser = fixed_rate)]
    pub rate: u32,
    /// File to write
    #[arg(short, long, value_name = "OUT.obj")]
    pub output: PathBuf,
    /// Hierarchical edits
    #[command(flatten)]
    pub edits: EditArgs,
}

impl TessellateArgs {
    /// Writes the file.
    pub fn run(&self) -> Result<()> {
        check_extension(&self.output, "obj", "a mesh")?;
        check_outputs([self.output.as_path()], [self.mesh.as_path()])?;
        let cancel = cancel_on_interrupt()?;
        let go_on = || match cancel.load(Ordering::Relaxed) {
            true => Err(io::Error::from(io::ErrorKind::Interrupted)),
            false => Ok(()),
        };
        let mesh = self.edits.load_mesh(&self.mesh)?;
        let rate = DicingRate::Fixed(self.rate);
        let mesh = WorldMesh::new(mesh, DAffine3::IDENTITY, rate, RunArgs::available_threads())?;
        let n_triangles: u64 = mesh.surface().visible_patches().map(|p| mesh.patch_rates(p).n_triangles()).sum();
        if n_triangles > u64::from(u32::MAX) {
            return Err(Error::input(format!(
                "{n_triangles} triangles are too many for a file: choose a lower --rate"
            )));
        }
        let written = write_whole(&self.output, |out| {
            let mut faces = Vec::new();
            let mut face = None;
            tessellate(
                &mesh,
                |p| {
                    go_on()?;
                    writeln!(out, "v {} {} {}", p.x, p.y, p.z)
                },
                |patch, [a, b, c]| {
                    let of = mesh.surface().face_of(patch).0;
                    if face.replace(of) != Some(of) {
                        writeln!(faces, "g face_{of}")?;
                    }
                    writeln!(faces, "f {} {} {}", a + 1, b + 1, c + 1)
                },
            )?;
            out.write_all(&faces)
        });
        unless_interrupted(written, &cancel, &self.output)
    }
}
