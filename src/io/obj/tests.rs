use super::*;
use crate::ids::{FaceId, VertexId};
use crate::mesh::{BoundaryRule, CreaseMethod, Edit, EditKind, EditValue, TriangleRule};
use glam::DVec3;

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

fn parse(text: &str) -> Result<ObjMesh> {
    parse_obj(text.as_bytes(), Path::new("m.obj"))
}

fn mesh(text: &str) -> ControlMesh {
    parse(text).unwrap().mesh
}

fn with_tag(tag: &str) -> ControlMesh {
    mesh(&format!("{QUAD}{tag}\n"))
}

fn error(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

#[test]
fn polygons_keep_file_order_across_groups() {
    let text =
        "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nusemtl x\nf 4 3 2 1\ng b\nf 1/ 2// -3\no c\nf 1 2 3 4 5\n";
    let mesh = mesh(text);
    let faces: Vec<Vec<u32>> = mesh.faces().map(|f| f.iter().map(|v| v.0).collect()).collect();
    assert_eq!(faces, [vec![3, 2, 1, 0], vec![0, 1, 2], vec![0, 1, 2, 3, 4]]);
    assert_eq!(mesh.positions.len(), 5);
}

#[test]
fn coordinates_are_the_doubles_nearest_to_the_text() {
    let mesh = mesh("v 0.1 1e-7 -12345678.125 1.0\nv +1. .5 0 1 0 0\nv 0 0 1\nf 1 2 3");
    assert_eq!(mesh.positions[0], DVec3::new(0.1, 1e-7, -12345678.125));
    assert_eq!(mesh.positions[1], DVec3::new(1.0, 0.5, 0.0));
}

#[test]
fn texture_coordinates_are_passed_over_whatever_they_name() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt x\nf 1/9 2/2/7 3/-1\n";
    assert_eq!(mesh(text), mesh("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"));
    assert!(error("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/a 2 3\n").contains("'a'"));
}

#[test]
fn line_ends_tabs_continuations_and_comments_do_not_matter() {
    let text = "\u{feff}# c\r\nv\t0 0 0\r\n v 1 0 0 \r\nv 1 \\\r\n 1 0\r\n#f 1 2\r\nf 1 2 \\\n 3\n\nvn 0 0 1\ns off\n#t crease\n";
    assert_eq!(mesh(text).positions[2], DVec3::new(1.0, 1.0, 0.0));
}

#[test]
fn creases_and_corners_take_their_own_sharpness_or_the_last() {
    let mesh =
        with_tag("t crease 2/1/0 0 1 2.5\nt crease 3/1/0 1 2 3 10\nt crease 2/0/0 3 0\nt corner 2/2/0 0 1 0.1 inf");
    let creases: Vec<_> = mesh.creases.iter().map(|c| (c.edge[0].0, c.edge[1].0, c.sharpness)).collect();
    assert_eq!(creases, [(0, 1, 2.5), (1, 2, 10.0), (2, 3, 10.0), (3, 0, f32::INFINITY)]);
    let corners: Vec<_> = mesh.corners.iter().map(|c| (c.vertex, c.sharpness)).collect();
    assert_eq!(corners, [(VertexId(0), 0.1), (VertexId(1), f32::INFINITY)]);
}

#[test]
fn rules_are_read() {
    let rules = |tag| {
        let mesh = with_tag(tag);
        (mesh.boundary, mesh.crease_method, mesh.triangles)
    };
    let default = (BoundaryRule::EdgeOnly, CreaseMethod::Uniform, TriangleRule::Catmark);
    assert_eq!(rules(""), default);
    assert_eq!(rules("t interpolateboundary 1/0/0 0").0, BoundaryRule::None);
    assert_eq!(rules("t interpolateboundary 1/0/0 1").0, BoundaryRule::EdgeAndCorner);
    assert_eq!(rules("t interpolateboundary 1/0/0 2").0, BoundaryRule::EdgeOnly);
    assert_eq!(rules("t creasemethod 0/0/1 chaikin").1, CreaseMethod::Chaikin);
    assert_eq!(rules("t creasemethod 0/0/1 normal").1, CreaseMethod::Uniform);
    assert_eq!(rules("t smoothtriangles 0/0/1 smooth").2, TriangleRule::Smooth);
    assert_eq!(rules("t smoothtriangles 0/0/1 catmark").2, TriangleRule::Catmark);
    assert_eq!(rules("t facevaryinginterpolateboundary 1/0/0 3"), default);
    assert_eq!(with_tag("t hole 1/0/0 0").holes, [FaceId(0)]);
}

#[test]
fn edits_are_read_operation_by_operation() {
    let mesh = with_tag("t vertexedit 7/8/6 3 0 1 2 2 0 3 0 0 1 10 1 0 0 5 subtract P value set P sharpness");
    let edit = |path: &[u32], value| Edit { kind: EditKind::Vertex, path: path.to_vec(), value };
    let expected = [
        edit(&[0, 1, 2], EditValue::AddPosition(DVec3::NEG_Z)),
        edit(&[0, 3], EditValue::AddPosition(DVec3::NEG_X)),
        edit(&[0, 1, 2], EditValue::SetSharpness(10.0)),
        edit(&[0, 3], EditValue::SetSharpness(5.0)),
    ];
    assert_eq!(mesh.edits, expected);
    let edge = with_tag("t edgeedit 4/1/3 3 0 1 2 2 add P sharpness").edits;
    let value = EditValue::AddSharpness(2.0);
    assert_eq!(edge, [Edit { kind: EditKind::Edge, path: vec![0, 1, 2], value }]);
    let face = with_tag("t faceedit 5/0/1 2 0 1 1 0 hole").edits;
    let paths: Vec<_> = face.iter().map(|e| (e.kind, e.path.clone(), e.value)).collect();
    let expected = [vec![0, 1], vec![0]].map(|path| (EditKind::Face, path, EditValue::Hole));
    assert_eq!(paths, expected);
}

#[test]
fn unknown_tags_and_statements_are_warnings_with_their_line() {
    let obj = parse(&format!("{QUAD}t wobble 0/0/0\nsurf 1 2\nsurf 3 4\nt hole 0/0/0 7\n")).unwrap();
    assert_eq!(obj.warnings.len(), 3);
    assert_eq!(obj.warnings[0], "m.obj:6: tag 'wobble' is unknown and passed over");
    assert!(obj.warnings[1].starts_with("m.obj:7: 'surf'"), "{}", obj.warnings[1]);
    assert!(obj.warnings[2].starts_with("m.obj:9: the counts '0/0/0'"), "{}", obj.warnings[2]);
    let many: String = (0..100).map(|i| format!("junk{i}\n")).collect();
    assert!(parse(&format!("{QUAD}{many}")).unwrap().warnings.len() < 10);
}

#[test]
fn every_mistake_gets_a_sentence_with_its_line() {
    let cases = [
        ("v 1 2\n", "m.obj:1: a vertex needs x, y and z; z is missing"),
        ("v 1 2 x\n", "m.obj:1: 'x' is no number"),
        ("v 1 2 3 red\n", "m.obj:1: 'red' is no number"),
        ("v 1 2 nan\n", "m.obj:1: 'nan' is not a finite number"),
        ("v 1 2 1e999\n", "m.obj:1: '1e999' is not a finite number"),
        ("v 1 2 1e31\n", "m.obj:1: coordinate '1e31' lies beyond 1e30"),
        ("\nf 1 2\n", "m.obj:2: a face needs at least 3 corners and this one has 2"),
        ("f\n", "m.obj:1: a face needs at least 3 corners and this one has 0"),
        ("f 1 2 x\n", "m.obj:1: 'x' is no index"),
        ("f 1 2 3/1/2/3\n", "m.obj:1: corner '3/1/2/3' has more than three parts"),
        ("f 1 2 3//n\n", "m.obj:1: 'n' is no index"),
        ("f 1 2 /3\n", "m.obj:1: '' is no index"),
        ("f 0 1 2\n", "m.obj:1: vertex 0 does not exist: OBJ counts from 1"),
        ("v 0 0 0\nf 1 1 -2\n", "m.obj:2: vertex '-2' does not exist: 1 are defined before this line"),
        ("f 1 2 3000000000\n", "m.obj:1: vertex '3000000000' does not exist: a mesh has at most 2^31"),
        ("f 1 2 99999999999999999999\n", "m.obj:1: '99999999999999999999' does not exist"),
        ("", "m.obj: the mesh has no faces ('f' lines); is this an OBJ file?"),
    ];
    for (text, expected) in cases {
        assert!(error(text).starts_with(expected), "{text:?}: {}", error(text));
    }
}

#[test]
fn every_mistake_after_a_quad_gets_a_sentence_with_its_line() {
    let cases = [
        ("f 1 2 9", "vertex 9 does not exist: the file has 4, counted from 1"),
        ("t", "a tag needs a name"),
        ("t crease", "tag 'crease' needs its ints/floats/strings counts"),
        ("t crease 2/1 0 1 2", "'2/1' should be three counts"),
        ("t crease 2/1/0/0 0 1 2", "'2/1/0/0' should be three counts"),
        ("t crease -2/1/0 0 1 2", "'-2/1/0' should be three counts"),
        ("t crease 2/1/0 0 1", "the counts '2/1/0' announce 3 arguments and 2 follow"),
        (
            "t hole 999999999999999999/999999999999999999/0 0",
            "the counts '999999999999999999/999999999999999999/0' announce",
        ),
        ("t crease 1/1/0 0 1", "a crease needs two vertices or more"),
        ("t crease 2/1/0 0 4 1", "vertex 4 does not exist: the file has 4, counted from 0"),
        ("t crease 2/1/0 0 -1 1", "'-1' does not exist: tags count vertices and faces from 0"),
        ("t crease 2/1/0 0 1 nan", "'nan' is no sharpness"),
        ("t corner 1/1/0 7 1", "vertex 7 does not exist"),
        ("t hole 1/0/0 1", "face 1 does not exist: the file has 1, counted from 0"),
        ("t interpolateboundary 1/0/0 3", "boundary rule 3 does not exist"),
        ("t interpolateboundary 0/0/0", "this tag takes one integer and has 0"),
        ("t creasemethod 0/0/1 soft", "crease method 'soft' does not exist"),
        ("t smoothtriangles 0/0/1 old", "triangle rule 'old' does not exist"),
        ("t vertexedit 3/3/2 2 0 1 0 0 1 add P", "an edit's operations come in threes"),
        ("t vertexedit 3/3/3 2 0 1 0 0 1 mul P value", "an edit cannot 'mul'"),
        ("t edgeedit 3/3/3 2 0 1 0 0 1 add P value", "this edit cannot change 'value'"),
        ("t vertexedit 3/2/3 2 0 1 0 0 add P value", "1 paths need 3 floats each; the tag has 2"),
        ("t vertexedit 3/3/3 2 0 4 0 0 1 add P value", "`t vertexedit` has the number 4 in path [0, 4], of 0 to 3"),
        (
            "t vertexedit 4/3/3 3 0 1 4 0 0 1 add P value",
            "`t vertexedit` has the number 4 in path [0, 1, 4], of 0 to 3",
        ),
        ("t vertexedit 3/3/3 9 0 1 0 0 1 add P value", "path length 9 should be in 2..=2: 2 numbers follow it"),
        ("t vertexedit 3/3/3 2 1 1 0 0 1 add P value", "face 1 does not exist"),
        ("t vertexedit 3/3/3 2 0 1 0 0 x add P value", "'x' is no number"),
        ("t faceedit 2/0/1 1 0 fold", "face edit 'fold' is not known"),
    ];
    for (line, expected) in cases {
        let message = error(&format!("{QUAD}{line}\n"));
        assert!(message.starts_with(&format!("m.obj:6: {expected}")), "{line}: {message}");
    }
}

#[test]
fn bytes_that_are_no_text_matter_only_where_they_are_read() {
    let read = |bytes: &[u8]| parse_obj(bytes, Path::new("m.obj"));
    assert!(read(&[b"# Andr\xe9\ng \xff\n", QUAD.as_bytes()].concat()).is_ok());
    let wrong = read(b"v 1 \xff\x00 2\n").unwrap_err().to_string();
    assert!(wrong.starts_with("m.obj:1: '\u{fffd}\\0' is no number"), "{wrong}");
}

#[test]
fn missing_file_and_folder_are_sentences() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none.obj");
    let expected = format!("cannot read {}: ", path.display());
    assert!(read_obj(&path).unwrap_err().to_string().starts_with(&expected));
    assert!(read_obj(folder.path()).unwrap_err().to_string().starts_with("cannot read "));
}

#[test]
fn agrees_with_another_reader_on_polygons_without_groups() {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    let text = mixed_polygons();
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Ok(Default::default())).unwrap();
    let theirs = &models[0].mesh;
    let ours = mesh(&text);
    assert_eq!(ours.face_sizes, theirs.face_arities);
    for (vertex, &renumbered) in ours.face_vertices.iter().zip(&theirs.indices) {
        let p = &theirs.positions[3 * renumbered as usize..][..3];
        assert_eq!(ours.positions[vertex.idx()], DVec3::from_slice(p));
    }
}

/// Triangles, quads and pentagons that use vertices out of order, some of them by relative indices.
fn mixed_polygons() -> String {
    let vertices: String = (0..60).map(|i| format!("v {} {} {}\n", f64::from(i) / 7.0, i * i, -i)).collect();
    let corner = |f: i32, k: i32| (f * 7 + k * 13) % 60;
    let word = |v: i32| if v % 3 == 0 { v - 60 } else { v + 1 };
    let face = |f: i32| (0..3 + f % 3).map(|k| format!(" {}", word(corner(f, k)))).collect::<String>();
    vertices + &(0..40).map(|f| format!("f{}\n", face(f))).collect::<String>()
}

/// Texts that plain blocks, blocks of other kinds and ends of blocks in all places make the same mesh or error of.
const TEXTS: [&str; 8] = [
    "\u{feff}v 0 0 0\nv 1 0 0\r\nv 1 1 \\\n 0\nv 0 \\\r\n1 0\nf 1 2 3 4\nf 4 3 2 1\nt corner 1/1/0 2 3\n",
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nv 2 2 2\nf -1 -2 -3\nbevel on\nnonsense 1\nf 1 2 4\n# end",
    "vt 0 0\nvt 1 0\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/1 2/2 3/1\nvt 1 1\nf 3/3 2/1 1/2\n\n\nf 1/1 2/1 3/2\n",
    "vt 0 0\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/1 2/1 3/1\nf 1 2 3\nf 1/1 2/1 3/1\n",
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 2 7\nf 1 2 9\nf 1 2 9\nf 1 2 3\n",
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nv 1 x 0\nf 1 2\n",
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 2 0\nt corner 1/1\n",
    "",
];

#[test]
fn blocks_make_the_mesh_that_lines_make() {
    for text in TEXTS {
        let told = |result: Result<ObjMesh>| result.map(|m| (m.mesh, m.warnings)).map_err(|e| e.to_string());
        let expected = told(parse(text));
        for block_bytes in [1, 7, 16, 33, 1000] {
            let read = blocks::parse_blocks(text.as_bytes(), Path::new("m.obj"), 2, block_bytes);
            assert_eq!(told(read), expected, "{text:?} in blocks of {block_bytes}");
        }
    }
}
