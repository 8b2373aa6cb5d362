//! The table of exact limit points (`../shared/meshes/opensubdiv`), and how far an evaluation is from it.

use glam::DVec3;
use lazytess::ids::FaceId;
use lazytess::mesh::ControlMesh;
use std::collections::HashMap;
use std::fs;
use std::path::Path;

/// A mesh of the table with its exact points.
pub struct Shape {
    pub name: String,
    pub mesh: ControlMesh,
    /// Rows by patch: (face, sub).
    pub patches: Vec<((FaceId, u32), Vec<Row>)>,
    /// Diagonal of the bounding box of the vertices that faces use.
    pub diagonal: f64,
    /// The manifest's line, by column name.
    pub facts: HashMap<String, String>,
}

/// One exact point.
pub struct Row {
    pub uv: [f64; 2],
    pub exact: Point,
    /// `R`: derivatives, `E`: unit tangents, `X`: position only.
    pub flag: char,
}

/// A point of a surface and its derivatives.
#[derive(Clone, Copy)]
pub struct Point {
    pub p: DVec3,
    pub du: DVec3,
    pub dv: DVec3,
}

/// Errors of an evaluation of one shape.
#[derive(Default)]
pub struct Errors {
    /// Distances over the diagonal.
    pub position: Vec<f64>,
    /// Distances of derivatives over the longer of the exact one and 1e-3 of the diagonal (rows `R`).
    pub derivative: Vec<f64>,
    /// Distances of unit tangents (rows `E`).
    pub direction: Vec<f64>,
    /// Points that the evaluation says are not on the surface.
    pub missing: usize,
}

/// Reads all shapes, sorted by name. Hierarchical edits are dropped, as the table ignores them.
pub fn read(folder: &Path) -> Vec<Shape> {
    let manifest = read_csv(&folder.join("manifest.csv"));
    manifest.into_iter().map(|facts| read_shape(folder, facts)).collect()
}

fn read_shape(folder: &Path, facts: HashMap<String, String>) -> Shape {
    let name = facts["shape"].clone();
    let mut mesh = lazytess::io::obj::read_obj(&folder.join(format!("{name}.obj"))).expect("the shape is valid").mesh;
    mesh.edits.clear();
    let mut patches: Vec<((FaceId, u32), Vec<Row>)> = Vec::new();
    for line in read_csv(&folder.join(format!("{name}.limit.csv"))) {
        let patch = (FaceId(line["face"].parse().unwrap()), line["sub"].parse().unwrap());
        if patches.last().is_none_or(|(last, _)| *last != patch) {
            patches.push((patch, Vec::new()));
        }
        patches.last_mut().unwrap().1.push(read_row(&line));
    }
    let diagonal = facts["bbox_diagonal"].parse().unwrap();
    Shape { name, mesh, patches, diagonal, facts }
}

fn read_row(line: &HashMap<String, String>) -> Row {
    let number = |column: &str| line[column].parse::<f64>().unwrap();
    let vector = |c: &str| DVec3::new(number(&format!("{c}x")), number(&format!("{c}y")), number(&format!("{c}z")));
    let exact = Point { p: vector("p"), du: vector("du"), dv: vector("dv") };
    Row { uv: [number("u"), number("v")], exact, flag: line["flag"].chars().next().unwrap() }
}

fn read_csv(path: &Path) -> Vec<HashMap<String, String>> {
    let text = fs::read_to_string(path).expect("the table is readable");
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header line").split(',').collect();
    let cells = |l: &str| header.iter().zip(l.split(',')).map(|(h, c)| (h.to_string(), c.to_string())).collect();
    lines.map(cells).collect()
}

impl Shape {
    /// Compares an evaluation of whole patches with the exact points.
    pub fn errors(&self, mut evaluate: impl FnMut(FaceId, u32, &[[f64; 2]]) -> Vec<Option<Point>>) -> Errors {
        let mut errors = Errors::default();
        for ((face, sub), rows) in &self.patches {
            let uvs: Vec<[f64; 2]> = rows.iter().map(|r| r.uv).collect();
            for (row, point) in rows.iter().zip(evaluate(*face, *sub, &uvs)) {
                match point {
                    Some(point) => errors.add(row, point, self.diagonal),
                    None => errors.missing += 1,
                }
            }
        }
        errors
    }
}

impl Errors {
    fn add(&mut self, row: &Row, point: Point, diagonal: f64) {
        let pairs = [(point.du, row.exact.du), (point.dv, row.exact.dv)];
        self.position.push(point.p.distance(row.exact.p) / diagonal);
        match row.flag {
            'R' => {
                self.derivative.extend(pairs.map(|(d, exact)| d.distance(exact) / exact.length().max(1e-3 * diagonal)))
            }
            'E' => self.direction.extend(pairs.map(|(d, exact)| d.normalize_or_zero().distance(exact))),
            _ => {}
        }
    }
}

/// The largest of some errors; NaN counts as largest, none as zero.
pub fn max(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, |a: f64, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) })
}

/// The 99th percentile of some errors.
pub fn percentile_99(errors: &[f64]) -> f64 {
    let mut sorted = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((sorted.len() * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or(0.0)
}
