//! The same shapes in Embree, by the program `embree_probe` of `../shared/peers`, where the variable `EMBREE_PROBE`
//! names it.

use serde_json::Value;
use std::process::Command;

/// What the program prints for these arguments; `None` without the program.
pub fn probe(arguments: &[&str]) -> Option<Value> {
    let program = std::env::var_os("EMBREE_PROBE")?;
    let output = Command::new(&program).args(arguments).output().expect("EMBREE_PROBE names a program that runs");
    serde_json::from_slice(&output.stdout).ok()
}

/// A number of a report with two digits, or what stands for none.
pub fn cell(report: &Option<Value>, number: impl Fn(&Value) -> Option<f64>) -> String {
    report
        .as_ref()
        .and_then(number)
        .map_or("-".to_owned(), |x| if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") })
}
