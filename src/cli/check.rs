//! `lazytess check`: is the mesh what it seems, and does its tessellation hold water?

use clap::Args;
use std::path::PathBuf;
use std::str::FromStr;

/// Report a mesh's topology and aim rays at its edges and vertices
///
/// Rays go from both sides through random points of shared edges, vertices and cell borders of closed meshes. One that
/// passes is a leak; exit code 1 says that there are some.
#[derive(Args, Clone, Debug)]
pub struct CheckArgs {
    /// mesh.obj
    pub mesh: PathBuf,
    /// How many rays to aim
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    pub rays: u64,
    /// Pieces for each edge: the same for all, or random ones that differ from edge to edge
    #[arg(long, value_name = "N|random:SEED", default_value = "8")]
    pub rate: CheckRate,
    /// Worker threads [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = super::values::count)]
    pub threads: Option<u32>,
}

/// Rates of the edges under test.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CheckRate {
    /// Every edge has this one, in 1..=4096.
    Fixed(u32),
    /// Every edge has its own, drawn with this seed.
    Random(u64),
}

impl FromStr for CheckRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let rate = match text.strip_prefix("random:") {
            Some(seed) => seed.parse().ok().map(Self::Random),
            None => text.parse().ok().filter(|n| (1..=4096).contains(n)).map(Self::Fixed),
        };
        rate.ok_or_else(|| format!("'{text}' is no rate: write N in 1..4096, or random:SEED"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_fixed_or_random() {
        assert_eq!("16".parse(), Ok(CheckRate::Fixed(16)));
        assert_eq!("random:7".parse(), Ok(CheckRate::Random(7)));
        for bad in ["", "0", "4097", "random", "random:", "random:-1", "fixed:3"] {
            assert!(bad.parse::<CheckRate>().unwrap_err().contains("is no rate"), "{bad}");
        }
    }
}
