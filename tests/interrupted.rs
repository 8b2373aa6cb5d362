//! An interrupted render leaves a readable picture, and an interrupted write the picture that was there.
#![cfg(unix)]

use lazytess::io::picture::read_rgb;
use lazytess::mesh::shapes;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const LAZYTESS: &str = env!("CARGO_BIN_EXE_lazytess");

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("torus.obj");
    let torus = shapes::torus(8, 6, 2.0, 0.75);
    lazytess::io::write::write_whole(&path, |out| lazytess::io::obj_write::ObjWriter::new(out).mesh(&torus)).unwrap();
    folder
}

/// A render that would take hours.
fn long_render(folder: &Path) -> Child {
    let line = "render torus.obj -o out.exr --size 2000x1500 --spp 256 --integrator path --stats s.json";
    let mut command = Command::new(LAZYTESS);
    command.args(line.split(' ')).current_dir(folder).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits until the process has used that much processor time.
fn wait_until_busy(process: &Child, seconds: f64) {
    let (start, stat) = (Instant::now(), format!("/proc/{}/stat", process.id()));
    while start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(10));
        match fs::read_to_string(&stat) {
            // Fields 14 and 15, counted from after the name: ticks of 10 ms.
            Ok(text) => {
                let ticks = |n: usize| text.rsplit(')').next()?.split_whitespace().nth(n - 3)?.parse::<u64>().ok();
                if ticks(14).zip(ticks(15)).is_some_and(|(user, system)| (user + system) as f64 > 100.0 * seconds) {
                    return;
                }
            }
            Err(_) if start.elapsed() > Duration::from_secs(5) => return,
            Err(_) => {}
        }
    }
}

fn signal(process: &Child, name: &str) {
    let sent = Command::new("kill").args([name, &process.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

fn interrupted(name: &str) -> (tempfile::TempDir, Output) {
    let folder = folder();
    let process = long_render(folder.path());
    // A second is far more than reading and preparing the torus take.
    wait_until_busy(&process, 1.0);
    signal(&process, name);
    (folder, process.wait_with_output().unwrap())
}

#[test]
fn ctrl_c_writes_what_is_done_and_says_so() {
    for name in ["-INT", "-TERM"] {
        let (folder, output) = interrupted(name);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{told}");
        assert!(told.contains("lazytess: interrupted: ") && told.contains("pixels are done and in out.exr"), "{told}");
        let picture = read_rgb(&folder.path().join("out.exr")).unwrap();
        assert_eq!((picture.width, picture.height), (2000, 1500));
        assert!(picture.pixels.iter().any(|pixel| pixel[0] > 0.0), "something is done");
        let json = fs::read(folder.path().join("s.json")).unwrap();
        let stats: serde_json::Value = serde_json::from_slice(&json).unwrap();
        let done = stats["picture"]["pixels_done"].as_u64().unwrap();
        assert!(done > 0 && done < 3_000_000, "{done}");
    }
}

#[test]
fn ctrl_c_before_the_first_pixel_leaves_the_old_picture() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| {
        let mut command = Command::new(LAZYTESS);
        command.args(line.split(' ')).current_dir(folder.path()).stderr(Stdio::piped()).spawn().unwrap()
    };
    // Takes seconds to read and prepare.
    assert!(run("generate ground --faces 400k -o ground.obj").wait().unwrap().success());
    fs::write(folder.path().join("out.exr"), "the old picture").unwrap();
    let process = run("render ground.obj -o out.exr --rate fixed:1");
    wait_until_busy(&process, 0.05);
    signal(&process, "-INT");
    let output = process.wait_with_output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{told}");
    assert!(told.contains("interrupted before the first pixel: out.exr is as it was"), "{told}");
    assert_eq!(fs::read(folder.path().join("out.exr")).unwrap(), b"the old picture");
}

/// Renders with a limit on the size of files that stops the write midway.
fn render_into_a_limit(folder: &Path, on_limit: &str) -> Output {
    let script = format!("{on_limit} ulimit -f 2; exec {LAZYTESS} render torus.obj -o out.exr --size 160x120 --quiet");
    Command::new("sh").args(["-c", &script]).current_dir(folder).output().unwrap()
}

#[test]
fn a_process_killed_while_it_writes_leaves_the_old_picture() {
    let folder = folder();
    fs::write(folder.path().join("out.exr"), "the old picture").unwrap();
    let output = render_into_a_limit(folder.path(), "");
    assert_eq!(output.status.code(), None, "the system's signal ends it: {output:?}");
    assert_eq!(fs::read(folder.path().join("out.exr")).unwrap(), b"the old picture");
}

#[test]
fn a_write_that_fails_leaves_the_old_picture_and_nothing_else() {
    let folder = folder();
    fs::write(folder.path().join("out.exr"), "the old picture").unwrap();
    let output = render_into_a_limit(folder.path(), "trap '' XFSZ;");
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(told.contains("lazytess: cannot write out.exr: "), "{told}");
    assert_eq!(fs::read(folder.path().join("out.exr")).unwrap(), b"the old picture");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}
