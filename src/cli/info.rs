//! `lazytess info`: what a scene would need, before it is rendered.

use super::input::{load_scene, settle_rates};
use super::picture::PictureArgs;
use super::run_options::RunArgs;
use super::stdout;
use crate::error::Result;
use crate::io::process::available_bytes;
use crate::report::{CacheAdvice, Inventory};
use crate::scene::world::GridCache;
use clap::Args;
use std::io::Write;
use std::path::PathBuf;

/// Tell what a scene or mesh consists of and what it needs
///
/// Faces, patches, plans and valences; bytes that stay resident; bytes and triangles that the full tessellation would
/// have at the given rate; a cache size to begin with.
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

impl InfoArgs {
    /// Reads, prepares and tells.
    pub fn run(self) -> Result<()> {
        let inventory = self.inventory()?;
        stdout::print(|out| {
            if self.json {
                let json = serde_json::to_string_pretty(&inventory).expect("plain numbers have a JSON form");
                return writeln!(out, "{json}");
            }
            write!(out, "{inventory}")
        })
    }

    fn inventory(&self) -> Result<Inventory> {
        let mut scene = load_scene(&self.input)?;
        settle_rates(&mut scene, self.picture.rate);
        let settings = self.picture.settings(&scene, Vec::new())?;
        let render = self.picture.of_scene(&scene, &settings);
        let mut inventory = Inventory { input: self.input.display().to_string(), ..Default::default() };
        let threads = RunArgs::available_threads();
        let meshes = render.read_meshes(threads, false)?;
        meshes.iter().for_each(|mesh| inventory.add_control_mesh(mesh));
        let (world, _) = render.compile(meshes, threads, false)?;
        let slots = GridCache::table_bytes_for(&world);
        inventory.add_world(&world, slots, threads);
        let pixels = settings.window.n_pixels() as u64;
        inventory.cache = CacheAdvice::new(&inventory.full, pixels, available_bytes());
        Ok(inventory)
    }
}
