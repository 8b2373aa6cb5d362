//! The command line: arguments become a validated job, the job runs. No algorithm lives here.
//!
//! One file per subcommand with its **arguments** (what was typed; clap's derive makes the help from it), its **job**
//! (resolved and checked: files named exist, sizes are numbers) and `run`. Results go to stdout for machines,
//! everything else to stderr. Exit codes: 0 success, 1 a check failed, 2 bad usage or input, 130 interrupted.
//!
//! Help lists the flags that change the picture apart from those that only change speed: [`PICTURE`] and [`SPEED`].

pub mod bench;
pub mod camera;
pub mod check;
pub mod compare;
mod generate;
pub mod info;
pub mod input;
pub mod interrupt;
mod job;
mod output;
mod outputs;
pub mod picture;
pub mod progress;
pub mod render;
pub mod run_options;
pub mod sample;
pub mod stdout;
pub mod tessellate;
mod thesis_tables;
pub mod tradeoff;
pub mod tune;
pub mod values;

use crate::error::{Error, Result};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

/// Help heading of flags that change what is computed.
pub const PICTURE: &str = "What the picture shows (these change it)";
/// Help heading of flags that must not change a byte of the result.
pub const SPEED: &str = "How it is computed (these never change it)";

/// Ray traces Catmull-Clark subdivision surfaces, tessellating only what rays touch.
///
/// A mesh is an OBJ file of polygons, with subdivision tags (creases, corners, holes) in `t` lines if wanted. A scene
/// is a TOML file that names meshes, materials, lights and a camera. Sizes read like 64M or 2G (binary).
#[derive(Parser, Debug)]
#[command(name = "lazytess", version, max_term_width = 110, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    Render(render::RenderArgs),
    Sample(sample::SampleArgs),
    Tessellate(tessellate::TessellateArgs),
    Bench(bench::BenchArgs),
    Tune(tune::TuneArgs),
    Info(info::InfoArgs),
    Check(check::CheckArgs),
    Tradeoff(tradeoff::TradeoffArgs),
    Compare(compare::CompareArgs),
    Generate(generate::GenerateArgs),
}

impl Cli {
    /// What was typed; ends the program after help, and if it makes no sense.
    pub fn typed() -> Self {
        let matches = Self::definition().get_matches();
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }

    /// The arguments. A negative number after an option is its value, so that the message is about numbers.
    fn definition() -> clap::Command {
        let takes_numbers =
            |argument: clap::Arg| match argument.get_action().takes_values() && !argument.is_positional() {
                true => argument.allow_negative_numbers(true),
                false => argument,
            };
        Self::command().mut_subcommands(|command| command.mut_args(takes_numbers))
    }

    /// Does what was asked for.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Render(args) => args.run(),
            Command::Sample(args) => args.run(),
            Command::Tessellate(args) => args.run(),
            Command::Bench(args) => args.run(),
            Command::Tune(args) => args.run(),
            Command::Info(args) => args.run(),
            Command::Check(args) => args.run(),
            Command::Tradeoff(args) => args.run(),
            Command::Compare(args) => args.run(),
            Command::Generate(args) => args.run(),
        }
    }
}

/// The error and its causes for stderr, a line each; causes that the error already quotes are left out.
pub fn describe(error: &Error) -> String {
    let mut text = format!("lazytess: {error}");
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        let message = inner.to_string();
        if !text.contains(&message) {
            text.push_str(&format!("\n  because {message}"));
        }
        cause = inner.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Cli::definition().debug_assert();
    }

    #[test]
    fn negative_numbers_are_refused_as_numbers() {
        for (line, message) in [
            ("lazytess render a.obj -o a.png --spp -1", "'-1' is no number of samples"),
            ("lazytess bench a.obj --rate -3", "'-3' is no rate"),
        ] {
            let refusal = Cli::definition().try_get_matches_from(line.split(' ')).unwrap_err().to_string();
            assert!(refusal.contains(message), "{refusal}");
        }
    }

    #[test]
    fn cause_is_told_once() {
        let cause = std::io::Error::other("no space left");
        let error = Error::io("write", std::path::Path::new("a.exr"), cause);
        assert_eq!(describe(&error), "lazytess: cannot write a.exr: no space left");
    }
}
