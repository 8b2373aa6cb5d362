//! Results on stdout.

use crate::error::{Error, Result};
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::Path;

/// Prints a result. A reader that has seen enough (`| head`) is no error.
pub fn print(fill: impl FnOnce(&mut BufWriter<StdoutLock<'static>>) -> io::Result<()>) -> Result<()> {
    let mut out = BufWriter::new(io::stdout().lock());
    match fill(&mut out).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::io("write", Path::new("stdout"), e)),
        _ => Ok(()),
    }
}
