//! Hierarchical edits: `t vertexedit`, `t edgeedit`, `t faceedit` (RISpec 3.2).
//!
//! The integers are **paths**, each with its length in front: a base face, the children to descend to, and for vertices
//! and edges the corner of the last face, where the element (the edge to the next corner) is.
//! The strings are **operations** in threes: how (`set`, `add`, `subtract`), which variable (`P`), what (`value`, three
//! floats; `sharpness`, one). The floats come path by path, and for each path operation by operation:
//!
//! ```text
//! t vertexedit 4/4/6  3 0 1 2   0 0 1 10   add P value set P sharpness
//!                     face 0, its child 1, corner 2:  add (0, 0, 1), then set sharpness 10
//! ```
//!
//! Edits are kept operation by operation, as the original evaluates them. A face edit has the string `hole`.

use super::elements::{MeshBuilder, number, show};
use super::tags::{TagArguments, sharpness};
use crate::mesh::{Edit, EditKind, EditValue};
use glam::DVec3;

#[derive(Clone, Copy)]
enum Quantity {
    Position,
    Sharpness,
}

#[derive(Clone, Copy)]
struct Operation {
    set: bool,
    /// -1 for `subtract`.
    sign: f64,
    quantity: Quantity,
}

impl Operation {
    fn width(self) -> usize {
        match self.quantity {
            Quantity::Position => 3,
            Quantity::Sharpness => 1,
        }
    }

    fn value(self, floats: &[&[u8]]) -> Result<EditValue, String> {
        Ok(match (self.quantity, self.set) {
            (Quantity::Position, set) => {
                let [x, y, z] = [number(floats[0])?, number(floats[1])?, number(floats[2])?];
                let p = self.sign * DVec3::new(x, y, z);
                if set { EditValue::SetPosition(p) } else { EditValue::AddPosition(p) }
            }
            (Quantity::Sharpness, true) => EditValue::SetSharpness(sharpness(floats[0])?),
            (Quantity::Sharpness, false) => EditValue::AddSharpness(self.sign as f32 * sharpness(floats[0])?),
        })
    }
}

/// `t vertexedit` and `t edgeedit`.
pub fn read_element_edit(mesh: &mut MeshBuilder, kind: EditKind, arguments: &TagArguments) -> Result<(), String> {
    let operations = read_operations(mesh, kind, &arguments.strings)?;
    let paths = read_paths(&arguments.ints, 2)?;
    let stride: usize = operations.iter().map(|operation| operation.width()).sum();
    if paths.len().saturating_mul(stride) > arguments.floats.len() {
        let (n, have) = (paths.len(), arguments.floats.len());
        return Err(format!("{n} paths need {stride} floats each; the tag has {have}"));
    }
    let mut offset = 0;
    for operation in operations {
        for (i, path) in paths.iter().enumerate() {
            let value = operation.value(&arguments.floats[i * stride + offset..])?;
            mesh.edit(Edit { kind, path: path.to_vec(), value });
        }
        offset += operation.width();
    }
    Ok(())
}

/// `t faceedit`.
pub fn read_face_edit(mesh: &mut MeshBuilder, arguments: &TagArguments) -> Result<(), String> {
    let paths = read_paths(&arguments.ints, 1)?;
    for operation in &arguments.strings {
        if *operation != b"hole" {
            return Err(format!("face edit {} is not known: only hole is", show(operation)));
        }
        for path in &paths {
            mesh.edit(Edit { kind: EditKind::Face, path: path.to_vec(), value: EditValue::Hole });
        }
    }
    Ok(())
}

fn read_operations(mesh: &mut MeshBuilder, kind: EditKind, strings: &[&[u8]]) -> Result<Vec<Operation>, String> {
    if strings.is_empty() || !strings.len().is_multiple_of(3) {
        return Err("an edit's operations come in threes, such as: add P value".to_owned());
    }
    let mut operations = Vec::new();
    for words in strings.chunks(3) {
        let operation = read_operation(kind, words[0], words[2])?;
        if words[1] != b"P" {
            // What floats the variable has is not known, so those of later operations cannot be found either.
            mesh.warn_once("edit variable", format!("an edit of {} is passed over: only P is read", show(words[1])));
            return Ok(Vec::new());
        }
        operations.push(operation);
    }
    Ok(operations)
}

fn read_operation(kind: EditKind, how: &[u8], what: &[u8]) -> Result<Operation, String> {
    let (set, sign) = match how {
        b"set" => (true, 1.0),
        b"add" => (false, 1.0),
        b"subtract" => (false, -1.0),
        other => return Err(format!("an edit cannot {}: write set, add or subtract", show(other))),
    };
    let quantity = match what {
        b"value" if kind == EditKind::Vertex => Quantity::Position,
        b"sharpness" => Quantity::Sharpness,
        other => {
            return Err(format!("this edit cannot change {}: write value (vertices only) or sharpness", show(other)));
        }
    };
    Ok(Operation { set, sign, quantity })
}

/// Splits `len path len path ...`; a path has at least `shortest` numbers.
fn read_paths(ints: &[u32], shortest: usize) -> Result<Vec<&[u32]>, String> {
    let mut paths = Vec::new();
    let mut rest = ints;
    while let [length, tail @ ..] = rest {
        let length = *length as usize;
        if length < shortest || length > tail.len() {
            let n = tail.len();
            return Err(match n < shortest {
                true => format!("a path of {shortest} numbers and more should follow its length; {n} are left"),
                false => format!("path length {length} should be in {shortest}..={n}: {n} numbers follow it"),
            });
        }
        let (path, after) = tail.split_at(length);
        paths.push(path);
        rest = after;
    }
    Ok(paths)
}
