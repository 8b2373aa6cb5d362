//! Whole files or none.
//!
//! [`write_whole`] writes to a temporary name in the same folder and renames: a reader never sees half a file, and an
//! interrupted or failed write leaves what was there before.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Creates or replaces `path` with what `fill` writes.
///
/// A device or pipe (`/dev/stdout`) cannot be renamed over and is written to directly.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<()> {
    let failed = |e| Error::io("write", path, e);
    // A symbolic link stays one: what it points to is replaced.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    match fs::metadata(&target) {
        Ok(there) if there.is_dir() => Err(Error::input("is a folder: name a file to write to").at(path, None)),
        Ok(there) if !there.is_file() => write_direct(&target, fill).map_err(failed),
        _ => write_and_rename(&target, fill).map_err(failed),
    }
}

fn write_direct(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::new(File::options().write(true).open(path)?);
    fill(&mut out)?;
    out.flush()
}

fn write_and_rename(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let temporary = temporary_beside(path)?;
    let (file, temporary) = temporary.into_parts();
    let mut out = BufWriter::new(file);
    fill(&mut out)?;
    out.flush()?;
    temporary.persist(path).map_err(|e| e.error)
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

    #[test]
    fn missing_folder_and_folder_are_sentences() {
        let folder = tempfile::tempdir().unwrap();
        let missing = write_whole(&folder.path().join("no/out.txt"), |_| Ok(())).unwrap_err();
        assert!(missing.to_string().starts_with("cannot write "), "{missing}");
        let taken = write_whole(folder.path(), |_| Ok(())).unwrap_err();
        assert!(taken.to_string().contains("is a folder"), "{taken}");
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
        write_whole(Path::new("/dev/null"), |out| out.write_all(b"gone")).unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }
}
