//! Files to be written, looked at before the work: better told before an hour of rendering than after.

use crate::error::{Error, Result};
use crate::io::write::{check_writable, target_of};
use std::path::{Path, PathBuf};

/// Refuses a file that cannot be written, and one that would take the place of an input or of another output, however
/// their names are spelled.
pub fn check_outputs<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<()> {
    let inputs: Vec<PathBuf> = inputs.into_iter().map(target_of).collect();
    let mut targets: Vec<PathBuf> = Vec::new();
    for file in outputs {
        check_writable(file)?;
        let target = target_of(file);
        if inputs.contains(&target) {
            return Err(Error::input("would take the place of what is read: give it another name").at(file, None));
        }
        if targets.contains(&target) && !is_special(&target) {
            return Err(Error::input("is to be written twice: give one of the two another name").at(file, None));
        }
        targets.push(target);
    }
    Ok(())
}

/// Refuses a file whose name does not end as what it will hold: no program would read it. Devices and pipes have any
/// name.
pub fn check_extension(file: &Path, extension: &str, what: &str) -> Result<()> {
    let is_right = file.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    if is_right || is_special(file) {
        return Ok(());
    }
    Err(Error::input(format!("{what}'s name should end in .{extension}")).at(file, None))
}

/// A device or a pipe.
fn is_special(file: &Path) -> bool {
    file.metadata().is_ok_and(|there| !there.is_file() && !there.is_dir())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn nothing_takes_the_place_of_something_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("scene.toml"), "").unwrap();
        let refusal = |outputs: &[&str]| {
            let outputs: Vec<PathBuf> = outputs.iter().map(|name| at(name)).collect();
            let message = check_outputs(outputs.iter().map(PathBuf::as_path), [at("scene.toml").as_path()]);
            message.map_err(|e| e.to_string().replace(&format!("{}/", folder.path().display()), ""))
        };
        assert_eq!(refusal(&["a.png", "b.json"]), Ok(()));
        assert!(refusal(&["a.png", "a.png"]).unwrap_err().starts_with("a.png: is to be written twice"));
        assert!(refusal(&["a.png", "./a.png"]).unwrap_err().starts_with("./a.png: is to be written twice"));
        assert!(refusal(&["scene.toml"]).unwrap_err().starts_with("scene.toml: would take the place"));
        assert!(refusal(&["./scene.toml"]).unwrap_err().starts_with("./scene.toml: would take the place"));
        assert!(refusal(&["no/such/a.png"]).unwrap_err().contains("there is no folder "));
        assert!(refusal(&[""]).unwrap_err().contains("is a folder"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("mesh.obj"), "").unwrap();
        std::os::unix::fs::symlink(at("mesh.obj"), at("link.obj")).unwrap();
        for (output, input) in [("mesh.obj", "link.obj"), ("link.obj", "mesh.obj"), ("link.obj", "link.obj")] {
            let message = check_outputs([at(output).as_path()], [at(input).as_path()]).unwrap_err().to_string();
            assert!(message.contains("would take the place of what is read"), "{message}");
        }
        assert!(check_outputs([Path::new("/dev/null"), Path::new("/dev/null")], []).is_ok());
    }

    #[test]
    fn a_file_is_named_after_what_it_holds() {
        assert!(check_extension(Path::new("a.PNG"), "png", "a picture").is_ok());
        let message = check_extension(Path::new("a.jpg"), "png", "a picture").unwrap_err().to_string();
        assert_eq!(message, "a.jpg: a picture's name should end in .png");
    }
}
