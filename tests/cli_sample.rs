//! `lazytess sample`, driven as a user would.

mod common;

use assert_cmd::Command;
use predicates::prelude::*;
use std::path::Path;

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

fn sample(mesh: &str, places: &str) -> assert_cmd::assert::Assert {
    sample_with(&[], mesh, places)
}

fn sample_with(options: &[&str], mesh: &str, places: &str) -> assert_cmd::assert::Assert {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.obj"), mesh).unwrap();
    std::fs::write(folder.path().join("s.csv"), places).unwrap();
    let mut command = Command::cargo_bin("lazytess").unwrap();
    command.current_dir(folder.path()).args(["sample", "m.obj", "--at", "s.csv"]).args(options).assert()
}

#[test]
fn corner_rule_keeps_the_quad_s_corners() {
    let mesh = format!("{QUAD}t interpolateboundary 1/0/0 1\n");
    let output = sample(&mesh, "face,sub,u,v\n0,0,1,1\n0,0,0.5,0.5\n").success().stderr("");
    let text = String::from_utf8(output.get_output().stdout.clone()).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|row| row.split(',').map(|value| value.parse().unwrap()).collect()).collect();
    assert_eq!(text.lines().next(), Some("face,sub,u,v,px,py,pz,dux,duy,duz,dvx,dvy,dvz"));
    let near = |row: &[f64], expected: [f64; 3]| row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(near(&rows[0][4..7], [1.0, 1.0, 0.0]), "{text}");
    assert!(near(&rows[1][4..7], [0.5, 0.5, 0.0]), "{text}");
    assert!(rows[1][7] > 0.5 && rows[1][11] > 0.5, "{text}");
}

#[test]
fn mistakes_are_sentences_with_exit_code_two() {
    let fails = |mesh: &str, places: &str, expected: &str| {
        sample(mesh, places).code(2).stdout("").stderr(predicate::str::contains(expected));
    };
    fails(QUAD, "0,0,2,0\n", "lazytess: s.csv:1: parameter '2' should lie within 0..1");
    fails(QUAD, "1,0,0,0\n", "lazytess: s.csv:1: face 1 does not exist: the mesh has 1");
    fails(QUAD, "0,1,0,0\n", "lazytess: s.csv:1: face 0 has 1 quads, counted from 0; 1 does not exist");
    fails(&format!("{QUAD}t hole 1/0/0 0\n"), "0,0,0,0\n", "lazytess: s.csv:1: face 0 has no surface");
    fails("v 0 0\n", "0,0,0,0\n", "lazytess: m.obj:1: a vertex needs x, y and z; z is missing");
}

#[test]
fn hierarchical_edits_count_unless_they_are_left_out() {
    let bump = format!("{QUAD}t vertexedit 4/3/3 3 0 0 2 0 0 1 add P value\n");
    let height = |output: assert_cmd::assert::Assert| {
        let text = String::from_utf8(output.success().get_output().stdout.clone()).unwrap();
        text.lines().nth(1).unwrap().split(',').nth(6).unwrap().parse::<f64>().unwrap()
    };
    assert!(height(sample(&bump, "0,0,0.5,0.5\n")) > 0.4);
    assert_eq!(height(sample_with(&["--no-edits"], &bump, "0,0,0.5,0.5\n")), 0.0);
    let hole = format!("{QUAD}t faceedit 3/0/1 2 0 2 hole\n");
    let message = "face 0 has no surface at u = 0.5, v = 0.75: `t faceedit` makes a hole there";
    sample(&hole, "0,0,0.5,0.75\n").code(2).stderr(predicate::str::contains(message));
    sample(&hole, "0,0,0.25,0.75\n").success();
}

#[test]
fn warnings_go_to_stderr_and_do_not_stop_the_work() {
    let mesh = format!("{QUAD}t wobble 0/0/0\n");
    let warning = "lazytess: warning: m.obj:6: tag 'wobble' is unknown";
    sample(&mesh, "0,0,0,0\n").success().stderr(predicate::str::starts_with(warning));
}

#[test]
fn limit_tables_can_be_fed_back() {
    let Some(folder) = common::shared("meshes/opensubdiv") else { return };
    let diagonal = 3f64.sqrt();
    for row in sampled_rows(&folder, "cube") {
        let (expected, found) = row;
        let distance = (0..3).map(|k| (expected[4 + k] - found[4 + k]).powi(2)).sum::<f64>().sqrt();
        assert!(distance < 1e-6 * diagonal, "{expected:?} {found:?}");
    }
}

/// Rows of the table beside what the command prints for the same places.
fn sampled_rows(folder: &Path, shape: &str) -> Vec<(Vec<f64>, Vec<f64>)> {
    let table = folder.join(format!("{shape}.limit.csv"));
    let mut command = Command::cargo_bin("lazytess").unwrap();
    let command = command.arg("sample").arg(folder.join(format!("{shape}.obj"))).arg("--at").arg(&table);
    let printed = String::from_utf8(command.assert().success().get_output().stdout.clone()).unwrap();
    let numbers = |row: &str| row.split(',').take(13).map(|value| value.parse().unwrap()).collect::<Vec<f64>>();
    let expected = std::fs::read_to_string(&table).unwrap();
    let expected = expected.lines().filter(|row| row.starts_with(|c: char| c.is_ascii_digit())).map(numbers);
    let rows: Vec<_> = expected.zip(printed.lines().skip(1).map(numbers)).collect();
    assert!(rows.len() > 100 && rows.len() + 1 == printed.lines().count());
    rows
}
