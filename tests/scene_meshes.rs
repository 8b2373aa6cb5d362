//! The meshes that ship with the scenes are those that the program makes.

use lazytess::io::obj::read_obj;
use lazytess::io::obj_write::ObjWriter;
use lazytess::io::scene_file::read_scene;
use lazytess::mesh::shapes;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/meshes")
}

#[test]
fn shipped_meshes_are_the_generated_ones() {
    for (name, mesh) in shapes::scene_meshes() {
        let mut made = Vec::new();
        let mut writer = ObjWriter::new(&mut made);
        writer.comment(&format!("made by: lazytess generate {name}")).unwrap();
        writer.mesh(&mesh).unwrap();
        let path = folder().join(format!("{name}.obj"));
        let shipped = fs::read(&path).unwrap_or_default();
        assert!(made == shipped, "{} is out of date: run scenes/meshes/make.sh", path.display());
    }
}

#[test]
fn no_mesh_ships_that_the_program_does_not_make() {
    let made: BTreeSet<_> = shapes::scene_meshes().into_iter().map(|(name, _)| format!("{name}.obj")).collect();
    let shipped = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let others: Vec<_> = shipped.filter(|name| name.ends_with(".obj") && !made.contains(name)).collect();
    assert_eq!(others, Vec::<String>::new());
}

#[test]
fn meshes_of_a_scene_are_small_enough_to_ship() {
    let bytes: u64 = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().metadata().unwrap().len()).sum();
    assert!(bytes < 4_000_000, "{bytes} bytes");
}

#[test]
fn scenes_read_and_their_meshes_are_there() {
    for scene in ["hello", "chess", "city"] {
        let description = read_scene(&folder().with_file_name(format!("{scene}.toml"))).unwrap();
        assert!(description.camera.is_some() && description.lights.len() >= 2, "{scene}");
        for mesh in description.meshes {
            assert!(read_obj(&mesh.file).unwrap().warnings.is_empty(), "{}", mesh.file.display());
        }
    }
}
