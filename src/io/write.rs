//! Whole files or none.
//!
//! [`write_whole`] writes to a temporary name in the same folder and renames: a reader never sees half a file, and an
//! interrupted or failed write leaves what was there before. [`check_writable`] tells before hours of work whether that
//! will be possible.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Creates or replaces `path` with what `fill` writes.
///
/// A device or pipe (`/dev/stdout`) cannot be renamed over and is written to directly.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut Output) -> io::Result<()>) -> Result<()> {
    let failed = |e| Error::io("write", path, e);
    let target = target_of(path);
    match fs::metadata(&target) {
        Ok(there) if there.is_dir() => Err(a_folder(path)),
        Ok(there) if !there.is_file() => write_direct(&target, fill).map_err(failed),
        _ => write_and_rename(&target, fill).map_err(failed),
    }
}

/// Refuses what [`write_whole`] would refuse now: a folder, a name in a folder that does not exist or that nobody may
/// write to. Nothing is left behind.
pub fn check_writable(path: &Path) -> Result<()> {
    let target = target_of(path);
    match fs::metadata(&target) {
        Ok(there) if there.is_dir() => return Err(a_folder(path)),
        Ok(there) if !there.is_file() => return Ok(()),
        _ => (),
    }
    let folder = folder_of(&target);
    if !folder.is_dir() {
        return Err(Error::input(format!("there is no folder {} to write to", folder.display())).at(path, None));
    }
    temporary_beside(&target).map(drop).map_err(|e| Error::io("write", path, e))
}

fn a_folder(path: &Path) -> Error {
    Error::input("is a folder: name a file to write to").at(path, None)
}

/// Links that are followed to a file that does not exist yet, at most.
const MOST_LINKS: usize = 40;

/// The file that a path means, by one spelling for all: a symbolic link stays one, what it points to is meant, even if
/// that does not exist yet.
pub fn target_of(path: &Path) -> PathBuf {
    let mut target = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(link) = fs::read_link(&target) else { break };
        target = folder_of(&target).join(link);
    }
    match (fs::canonicalize(&target), fs::canonicalize(folder_of(&target)), target.file_name()) {
        (Ok(there), ..) => there,
        (_, Ok(folder), Some(name)) => folder.join(name),
        _ => target,
    }
}

fn write_direct(path: &Path, fill: impl FnOnce(&mut Output) -> io::Result<()>) -> io::Result<()> {
    fill_file(File::options().write(true).open(path)?, fill)
}

fn write_and_rename(path: &Path, fill: impl FnOnce(&mut Output) -> io::Result<()>) -> io::Result<()> {
    let temporary = temporary_beside(path)?;
    let (file, temporary) = temporary.into_parts();
    fill_file(file, fill)?;
    temporary.persist(path).map_err(|e| e.error)
}

fn fill_file(file: File, fill: impl FnOnce(&mut Output) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::new(Watched { file, error: None });
    fill(&mut out)?;
    out.flush()?;
    out.get_mut().error.take().map_or(Ok(()), Err)
}

/// What is written to.
pub type Output = BufWriter<Watched>;

/// A file that remembers the first error of writing to it: encoders may drop one, of what they write when they end.
pub struct Watched {
    file: File,
    error: Option<io::Error>,
}

impl Watched {
    fn watch<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        if let Err(error) = &result
            && error.kind() != io::ErrorKind::Interrupted
        {
            let copy = || error.raw_os_error().map_or_else(|| error.kind().into(), io::Error::from_raw_os_error);
            self.error.get_or_insert_with(copy);
        }
        result
    }
}

impl Write for Watched {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let result = self.file.write(bytes);
        self.watch(result)
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.file.flush();
        self.watch(result)
    }
}

impl Seek for Watched {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let result = self.file.seek(to);
        self.watch(result)
    }
}

fn temporary_beside(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lazytess-");
    // Temporary files are private by default; the finished picture has the rights the user's mask gives.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    // Without the name of a file that is nothing to the user.
    builder.tempfile_in(folder_of(path)).map_err(|e| e.kind().into())
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_write_leaves_the_old_file_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.txt");
        write_whole(&path, |out| out.write_all(b"first")).unwrap();
        let error = write_whole(&path, |out| {
            out.write_all(b"second")?;
            Err(io::Error::other("disk on fire"))
        });
        assert!(error.unwrap_err().to_string().contains("disk on fire"));
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_error_that_an_encoder_drops_is_told() {
        let full = write_whole(Path::new("/dev/full"), |out| {
            // More than is held back, so that nothing is left for the end.
            let _ = out.write_all(&[0; 1 << 16]);
            Ok(())
        });
        assert!(full.unwrap_err().to_string().starts_with("cannot write /dev/full: "));
    }

    #[test]
    fn missing_folder_and_folder_are_sentences() {
        let folder = tempfile::tempdir().unwrap();
        let missing = write_whole(&folder.path().join("no/out.txt"), |_| Ok(())).unwrap_err();
        assert!(missing.to_string().starts_with("cannot write "), "{missing}");
        let taken = write_whole(folder.path(), |_| Ok(())).unwrap_err();
        assert!(taken.to_string().contains("is a folder"), "{taken}");
    }

    #[test]
    fn what_can_be_written_is_told_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let refusal = |name: &str| check_writable(&folder.path().join(name)).map_err(|e| e.to_string());
        assert_eq!(refusal("out.txt"), Ok(()));
        assert!(refusal("no/out.txt").unwrap_err().contains("there is no folder "));
        assert!(refusal("").unwrap_err().ends_with("is a folder: name a file to write to"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        if cfg!(target_os = "linux") {
            let message = check_writable(Path::new("/proc/out.txt")).unwrap_err().to_string();
            assert!(message.starts_with("cannot write /proc/out.txt"), "{message}");
            assert!(check_writable(Path::new("/dev/null")).is_ok());
        }
    }

    #[cfg(unix)]
    #[test]
    fn link_and_device_stay_what_they_are() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, "old").unwrap();
        symlink(&real, &link).unwrap();
        write_whole(&link, |out| out.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"new");
        fs::remove_file(&real).unwrap();
        assert_eq!(target_of(&link), target_of(&real));
        write_whole(&link, |out| out.write_all(b"anew")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"anew");
        write_whole(Path::new("/dev/null"), |out| out.write_all(b"gone")).unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }
}
