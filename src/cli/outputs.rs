//! Files to be written, looked at before the work: better told before an hour of rendering than after.

use crate::error::{Error, Result};
use std::path::Path;

/// Refuses a file whose folder does not exist, and one that would take the place of an input or of another output.
pub fn check_outputs(outputs: &[Option<&Path>], inputs: &[&Path]) -> Result<()> {
    let outputs: Vec<&Path> = outputs.iter().copied().flatten().collect();
    for (i, file) in outputs.iter().enumerate() {
        check_folder(file)?;
        if inputs.contains(file) {
            return Err(Error::input("would take the place of what is read: give it another name").at(file, None));
        }
        if outputs[..i].contains(file) && !is_special(file) {
            return Err(Error::input("is to be written twice: give one of the two another name").at(file, None));
        }
    }
    Ok(())
}

fn check_folder(file: &Path) -> Result<()> {
    match file.parent() {
        Some(folder) if folder != Path::new("") && !folder.is_dir() => {
            Err(Error::input(format!("there is no folder {} to write to", folder.display())).at(file, None))
        }
        _ => Ok(()),
    }
}

/// A device or a pipe.
fn is_special(file: &Path) -> bool {
    file.metadata().is_ok_and(|there| !there.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_takes_the_place_of_something_else() {
        let [a, b, scene] = ["a.png", "b.json", "scene.toml"].map(Path::new);
        let refusal = |outputs: &[Option<&Path>]| check_outputs(outputs, &[scene]).map_err(|e| e.to_string());
        assert_eq!(refusal(&[Some(a), Some(b), None]), Ok(()));
        assert!(refusal(&[Some(a), Some(a)]).unwrap_err().starts_with("a.png: is to be written twice"));
        assert!(refusal(&[Some(a), Some(scene)]).unwrap_err().starts_with("scene.toml: would take the place"));
        assert!(refusal(&[Some(Path::new("no/such/a.png"))]).unwrap_err().contains("there is no folder no/such"));
    }
}
