//! `lazytess tessellate`: the tessellation itself, for other programs.

use clap::Args;
use std::path::PathBuf;

/// Write the limit surface as an OBJ of triangles or quads
#[derive(Args, Clone, Debug)]
pub struct TessellateArgs {
    /// mesh.obj
    pub mesh: PathBuf,
    /// Pieces for each edge
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub rate: u32,
    /// File to write
    #[arg(short, long, value_name = "OUT.obj")]
    pub output: PathBuf,
    /// No progress bar
    #[arg(long, short)]
    pub quiet: bool,
}
