//! Ctrl-C: the first asks the render to stop and write what is done, the second ends the program.

use crate::error::{Error, ErrorKind, Result};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that Ctrl-C (or a request to terminate) sets.
///
/// Call it once in a process: the system has one handler.
pub fn cancel_on_interrupt() -> Result<Arc<AtomicBool>> {
    let cancel = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&cancel);
    let on_signal = move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        eprintln!("\nlazytess: stopping; once more to stop at once");
    };
    let failed = |e| Error::new(ErrorKind::Io, format!("cannot listen for Ctrl-C: {e}"));
    ctrlc::set_handler(on_signal).map_err(failed)?;
    Ok(cancel)
}

/// What became of writing a file whole; that it was interrupted, if that is why it failed.
pub fn unless_interrupted(written: Result<()>, cancel: &AtomicBool, file: &Path) -> Result<()> {
    match written {
        Err(_) if cancel.load(Ordering::Relaxed) => {
            let message = format!("interrupted: {} was not written", file.display());
            Err(Error::new(ErrorKind::Interrupted, message))
        }
        other => other,
    }
}
