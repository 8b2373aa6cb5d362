//! `lazytess info`: what a scene would need, before it is rendered.

use super::picture::PictureArgs;
use clap::Args;
use std::path::PathBuf;

/// Tell what a scene or mesh consists of and what it needs
///
/// Faces, patches, plans and valences; bytes that stay resident; bytes and triangles that the full tessellation would
/// have at the given rate.
#[derive(Args, Clone, Debug)]
pub struct InfoArgs {
    /// scene.toml or mesh.obj
    pub input: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// The picture, which decides the rates
    #[command(flatten)]
    pub picture: PictureArgs,
}
