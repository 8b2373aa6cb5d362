//! `t` lines: `t NAME ints/floats/strings ARGUMENTS...`.

use super::edits::{read_element_edit, read_face_edit};
use super::elements::{MeshBuilder, integer, show};
use crate::ids::{FaceId, VertexId};
use crate::mesh::{BoundaryRule, CreaseMethod, EditKind, TriangleRule};

/// The arguments of one tag, split by the counts in front of them.
pub struct TagArguments<'a> {
    /// Element numbers, from 0.
    pub ints: Vec<u32>,
    /// Words that stand for numbers; who uses one parses it.
    pub floats: Vec<&'a [u8]>,
    /// Names.
    pub strings: Vec<&'a [u8]>,
}

/// Reads the rest of a line whose first word is `t`.
pub fn read_tag<'a>(mesh: &mut MeshBuilder, mut words: impl Iterator<Item = &'a [u8]>) -> Result<(), String> {
    let name = words.next().ok_or("a tag needs a name")?;
    let counts = words.next().ok_or_else(|| format!("tag {} needs its ints/floats/strings counts", show(name)))?;
    let arguments = TagArguments::split(mesh, counts, words.collect())?;
    match name {
        b"crease" => creases(mesh, &arguments),
        b"corner" => corners(mesh, &arguments),
        b"hole" => {
            arguments.ints.iter().for_each(|&face| mesh.hole(FaceId(face)));
            Ok(())
        }
        b"interpolateboundary" => boundary_rule(&arguments).map(|rule| mesh.mesh.boundary = rule),
        b"creasemethod" => crease_method(&arguments).map(|method| mesh.mesh.crease_method = method),
        b"smoothtriangles" => triangle_rule(&arguments).map(|rule| mesh.mesh.triangles = rule),
        // How texture coordinates are smoothed does not move the surface.
        b"facevaryinginterpolateboundary" | b"facevaryingpropagatecorners" => Ok(()),
        b"vertexedit" => read_element_edit(mesh, EditKind::Vertex, &arguments),
        b"edgeedit" => read_element_edit(mesh, EditKind::Edge, &arguments),
        b"faceedit" => read_face_edit(mesh, &arguments),
        unknown => {
            mesh.warn_once(&show(unknown), format!("tag {} is unknown and passed over", show(unknown)));
            Ok(())
        }
    }
}

impl<'a> TagArguments<'a> {
    fn split(mesh: &mut MeshBuilder, counts: &[u8], words: Vec<&'a [u8]>) -> Result<Self, String> {
        let [n_ints, n_floats, n_strings] = read_counts(counts)?;
        let n = n_ints.saturating_add(n_floats).saturating_add(n_strings);
        if n > words.len() {
            return Err(format!("the counts {} announce {n} arguments and {} follow", show(counts), words.len()));
        }
        if n < words.len() {
            let message = format!("the counts {} announce {n} arguments; the rest is passed over", show(counts));
            mesh.warn_once("tag counts", message);
        }
        let (ints, rest) = words.split_at(n_ints);
        let (floats, rest) = rest.split_at(n_floats);
        let ints = ints.iter().map(|word| element(word)).collect::<Result<_, _>>()?;
        Ok(Self { ints, floats: floats.to_vec(), strings: rest[..n_strings].to_vec() })
    }

    /// The only integer or name of a tag that has just one.
    fn single<T: Copy>(list: &[T], what: &str) -> Result<T, String> {
        match list {
            [one] => Ok(*one),
            _ => Err(format!("this tag takes one {what} and has {}", list.len())),
        }
    }

    /// Sharpness of the i-th crease or corner: its own, or the last that is given, or infinite if none is.
    fn sharpness(&self, i: usize) -> Result<f32, String> {
        match self.floats.get(i).or(self.floats.last()) {
            Some(word) => sharpness(word),
            None => Ok(f32::INFINITY),
        }
    }
}

fn read_counts(word: &[u8]) -> Result<[usize; 3], String> {
    let wrong = || format!("{} should be three counts: ints/floats/strings, such as 2/1/0", show(word));
    let mut parts = word.split(|&b| b == b'/').map(|part| integer(part).ok().and_then(|n| usize::try_from(n).ok()));
    let mut count = || parts.next().flatten().ok_or_else(wrong);
    let counts = [count()?, count()?, count()?];
    if parts.next().is_some() { Err(wrong()) } else { Ok(counts) }
}

fn element(word: &[u8]) -> Result<u32, String> {
    let index = integer(word)?;
    let wrong = |_| format!("{} does not exist: tags count vertices and faces from 0", show(word));
    u32::try_from(index).map_err(wrong)
}

/// A sharpness in single precision; infinity is one, NaN is not.
pub fn sharpness(word: &[u8]) -> Result<f32, String> {
    let value = std::str::from_utf8(word).ok().and_then(|text| text.parse::<f32>().ok());
    value.filter(|s| !s.is_nan()).ok_or_else(|| format!("{} is no sharpness: write a number from 0 up", show(word)))
}

fn creases(mesh: &mut MeshBuilder, arguments: &TagArguments) -> Result<(), String> {
    if arguments.ints.len() == 1 {
        return Err("a crease needs two vertices or more".to_owned());
    }
    for (i, edge) in arguments.ints.windows(2).enumerate() {
        mesh.crease([VertexId(edge[0]), VertexId(edge[1])], arguments.sharpness(i)?);
    }
    Ok(())
}

fn corners(mesh: &mut MeshBuilder, arguments: &TagArguments) -> Result<(), String> {
    for (i, &vertex) in arguments.ints.iter().enumerate() {
        mesh.corner(VertexId(vertex), arguments.sharpness(i)?);
    }
    Ok(())
}

fn boundary_rule(arguments: &TagArguments) -> Result<BoundaryRule, String> {
    match TagArguments::single(&arguments.ints, "integer")? {
        0 => Ok(BoundaryRule::None),
        1 => Ok(BoundaryRule::EdgeAndCorner),
        2 => Ok(BoundaryRule::EdgeOnly),
        k => Err(format!("boundary rule {k} does not exist: write 0 (none), 1 (edge and corner) or 2 (edge only)")),
    }
}

fn crease_method(arguments: &TagArguments) -> Result<CreaseMethod, String> {
    match TagArguments::single(&arguments.strings, "name")? {
        b"normal" => Ok(CreaseMethod::Uniform),
        b"chaikin" => Ok(CreaseMethod::Chaikin),
        other => Err(format!("crease method {} does not exist: write normal or chaikin", show(other))),
    }
}

fn triangle_rule(arguments: &TagArguments) -> Result<TriangleRule, String> {
    match TagArguments::single(&arguments.strings, "name")? {
        b"catmark" => Ok(TriangleRule::Catmark),
        b"smooth" => Ok(TriangleRule::Smooth),
        other => Err(format!("triangle rule {} does not exist: write catmark or smooth", show(other))),
    }
}
