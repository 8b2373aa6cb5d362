//! `lazytess bench`: rays a second, beside those of other ray tracers.

use super::camera::CameraArgs;
use super::run_options::RunArgs;
use super::values::{count, picture_size};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Measure building and tracing one mesh at a fixed rate
///
/// Camera, rays and figures are those of the Embree programs that this project compares itself with: a cold and then warm
/// passes of primary rays, occlusion rays, and one diffuse bounce in tile order and shuffled, on one thread and on all.
#[derive(Args, Clone, Debug)]
pub struct BenchArgs {
    /// mesh.obj
    pub mesh: PathBuf,
    /// Pieces for each edge
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub rate: u32,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", value_parser = picture_size, default_value = "800x600")]
    pub size: [u32; 2],
    /// Kinds of rays to measure
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "primary,ao,diffuse")]
    pub rays: Vec<RaySet>,
    /// Occlusion rays for each primary hit
    #[arg(long, value_name = "N", value_parser = count, default_value = "8")]
    pub ao: u32,
    /// Passes over each kind; the median and the best are reported
    #[arg(long, value_name = "K", value_parser = count, default_value = "5")]
    pub repeat: u32,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Write the hits of the primary rays: 7 little-endian f32 for each pixel (t, face, u, v, normal)
    #[arg(long, value_name = "FILE")]
    pub hits: Option<PathBuf>,
    /// The camera
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Speed
    #[command(flatten)]
    pub run: RunArgs,
}

/// Rays that are measured together.
#[derive(ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum RaySet {
    /// One through the centre of each pixel.
    Primary,
    /// Any-hit rays over the hemisphere of each primary hit.
    Ao,
    /// One closest-hit ray from each primary hit, in tile order and shuffled.
    Diffuse,
}
