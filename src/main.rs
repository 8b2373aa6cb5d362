//! The lazytess command.

use lazytess::cli::{Cli, describe};
use std::process::ExitCode;

fn main() -> ExitCode {
    // Clap prints help to stdout with code 0, and bad usage to stderr with code 2.
    match Cli::typed().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}", describe(&error));
            ExitCode::from(error.exit_code())
        }
    }
}
