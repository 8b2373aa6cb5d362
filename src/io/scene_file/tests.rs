use super::*;
use crate::scene::description::{Albedo, IntegratorKind, Light, Rate};
use glam::{DVec3, Vec3};

const MESH: &str = "[[mesh]]\nfile = \"a.obj\"\n";

fn scene(text: &str) -> SceneDescription {
    parse_scene(text, Path::new("s/scene.toml")).unwrap()
}

fn error(text: &str) -> String {
    parse_scene(text, Path::new("scene.toml")).unwrap_err().to_string()
}

fn moved(transform: &str) -> DVec3 {
    let scene = scene(&format!("{MESH}transform = {transform}"));
    scene.meshes[0].world_from_object.transform_point3(DVec3::new(1.0, 2.0, 3.0))
}

#[test]
fn smallest_scene_has_the_bare_scene_s_light_and_material() {
    let scene = scene(MESH);
    let bare = SceneDescription::bare("s/a.obj".into());
    assert_eq!(scene, bare);
}

#[test]
fn everything_is_read() {
    let text = r##"
        background = 0.25
        [camera]
        eye = [1, 2.5, 3]
        at = [0, 0, 0]
        up = [0, 0, 2]
        fov = 40
        [render]
        size = [640, 480]
        spp = 16
        integrator = "debug:uv"
        rate = "px:0.5"
        max_depth = 5
        ao_samples = 32
        [materials.floor]
        checker = { even = 1, odd = [0, 0.5, 1], size = 2 }
        specular = 0.1
        shininess = 100
        mirror = 0.2
        [materials.ball]
        glass = { ior = 1.5, transmit = "#ffffff" }
        [[mesh]]
        file = "/m/a.obj"
        material = "floor"
        rate = "fixed:8"
        [[mesh]]
        file = "../b.obj"
        material = "ball"
        [[light]]
        kind = "point"
        position = [1, 2, 3]
        intensity = [10, 20, 30]
        [[light]]
        kind = "directional"
        direction = [0, -2, 0]
        irradiance = 3
        [[light]]
        kind = "sky"
        radiance = "#000000"
    "##;
    let scene = scene(text);
    let camera = scene.camera.unwrap();
    assert_eq!((camera.eye, camera.up, camera.fov), (DVec3::new(1.0, 2.5, 3.0), DVec3::Z, 40.0));
    assert_eq!(scene.render.size, Some([640, 480]));
    assert_eq!(scene.render.integrator, "debug:uv".parse::<IntegratorKind>().ok());
    assert_eq!((scene.render.spp, scene.render.max_depth, scene.render.ao_samples), (Some(16), Some(5), Some(32)));
    assert_eq!((scene.render.rate, scene.meshes[0].rate), (Some(Rate::Pixels(0.5)), Some(Rate::Fixed(8))));
    assert_eq!(scene.meshes[0].file, Path::new("/m/a.obj"));
    assert_eq!(scene.meshes[1].file, Path::new("s/../b.obj"));
    let checker = Albedo::Checker { even: Vec3::ONE, odd: Vec3::new(0.0, 0.5, 1.0), size: 2.0 };
    assert_eq!(scene.meshes[0].material.diffuse, checker);
    assert_eq!(scene.meshes[1].material.glass.unwrap().ior, 1.5);
    assert_eq!(scene.meshes[1].material.diffuse, Albedo::Constant(Vec3::ZERO));
    let expected = [
        Light::Point { position: DVec3::new(1.0, 2.0, 3.0), intensity: Vec3::new(10.0, 20.0, 30.0) },
        Light::Directional { direction: DVec3::NEG_Y, irradiance: Vec3::splat(3.0) },
        Light::Sky { radiance: Vec3::ZERO },
    ];
    assert_eq!(scene.lights, expected);
}

#[test]
fn transforms_scale_then_rotate_then_translate() {
    let near = |transform: &str, x: f64, y: f64, z: f64| {
        let distance = moved(transform).distance(DVec3::new(x, y, z));
        assert!(distance < 1e-12, "{transform}: {}", moved(transform));
    };
    near("{ translate = [1, 1, 1] }", 2.0, 3.0, 4.0);
    near("{ scale = 2 }", 2.0, 4.0, 6.0);
    near("{ scale = [1, 2, -1] }", 1.0, 4.0, -3.0);
    near("{ rotate = { axis = [0, 0, 5], degrees = 90 } }", -2.0, 1.0, 3.0);
    near("{ rotate = [0, 0, 90] }", -2.0, 1.0, 3.0);
    near("{ rotate = [90, 90, 0] }", 2.0, -3.0, -1.0);
    near("{ rotate = [0, 0, 90], scale = 2, translate = [10, 0, 0] }", 6.0, 2.0, 6.0);
    near("{ matrix = [[0, 1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }", 7.0, 1.0, 3.0);
}

#[test]
fn hex_colours_are_srgb() {
    let scene = scene(&format!("background = \"#80ff00\"\n{MESH}"));
    assert!((scene.background - Vec3::new(0.215_860_5, 1.0, 0.0)).length() < 1e-6);
}

#[test]
fn every_mistake_gets_a_sentence_with_its_line() {
    let cases = [
        ("", ": the scene has no meshes: add a [[mesh]]"),
        ("mesh = 3", ":1: invalid type: integer `3`, expected a sequence"),
        ("\n[camera\n", ":2: "),
        ("a = 1\na = 2\n", ":2: duplicate key"),
        ("[camara]\n", ":1: unknown field `camara`, expected one of `background`, `camera`"),
        ("[camera]\neye = [0, 0, 1]\n", ":1: missing field `at`"),
        ("[camera]\neye = [0, 0]\n", ":2: invalid length 2, expected an array of length 3"),
        ("[camera]\neye = [0, 0, inf]\n", ":2: inf is no number that can be used"),
        ("[camera]\neye = [0, 0, nan]\n", ":2: NaN is no number that can be used"),
        ("[camera]\neye = [0, 0, 1]\nat = [0, 0, 0]\nup = [0, 0, 0]\n", ":4: [0, 0, 0] is no direction"),
        ("background = -1\n", ":1: a colour cannot be negative"),
        ("background = true\n", ":1: invalid type: boolean `true`, expected a colour: a grey"),
        ("background = [1, 2]\n", ":1: invalid length 2, expected a colour"),
        ("background = [1, 2, 3, 4]\n", ":1: invalid length 4, expected a colour"),
        ("background = \"red\"\n", ":1: 'red' is no colour: write \"#rrggbb\""),
        ("\n[render]\nrate = \"fine\"\n", ":3: 'fine' is no dicing rate"),
        ("[render]\nintegrator = \"fast\"\n", ":2: 'fast' is no integrator: choose from whitted"),
        ("[render]\nspp = -1\n", ":2: invalid value: integer `-1`, expected u32"),
        ("[materials.a]\ndiffuse = 1.5\n", ":2: a surface cannot give back more light"),
        ("[materials.a]\nshininess = 0\n", ":2: 0 should be above 0"),
        ("[materials.a]\nglass = { ior = 0 }\n", ":2: 0 should be above 0"),
        ("[materials.a]\nshininess = 1e300\n", ":2: 1e300 is no number that can be used"),
        ("background = 1e38\n", ":1: 1e38 is no number that can be used"),
        ("[[mesh]]\nfile = 3\n", ":2: invalid type: integer `3`, expected a string"),
        ("[[mesh]]\nfile = \"\"\n", ":2: the mesh needs the name of a file"),
        ("[[mesh]]\nfile = \"a.obj\"\nfils = 1\n", ":3: unknown field `fils`"),
        ("[[mesh]]\nmaterial = \"a\"\n", ":1: missing field `file`"),
    ];
    for (text, expected) in cases {
        assert!(error(text).starts_with(&format!("scene.toml{expected}")), "{text:?}: {}", error(text));
    }
}

#[test]
fn every_mistake_in_a_scene_with_a_mesh_gets_a_sentence_with_its_line() {
    let cases = [
        ("material = \"wax\"", "3: material 'wax' is not defined; [materials] has none"),
        (
            "material = \"a\"\n[materials.a]\nmirror = 0.5\nglass = { ior = 1.5 }\n",
            "6: glass has neither diffuse nor checker nor mirror",
        ),
        ("material = \"wax\"\n[materials.wood]\n", "3: material 'wax' is not defined; [materials] has wood"),
        ("transform = { scale = 0 }", "3: the transform is singular"),
        ("transform = { scale = [1, 0, 1] }", "3: the transform is singular"),
        ("transform = { scale = 1e-320 }", "3: the transform is singular"),
        ("transform = { matrix = [[1,0,0,0],[2,0,0,0],[0,0,1,0],[0,0,0,1]] }", "3: the transform is singular"),
        ("transform = { matrix = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[1,0,0,1]] }", "3: the last row of matrix"),
        ("transform = { matrix = [[1,0],[0,1]] }", "3: invalid length 2, expected an array of length 4"),
        (
            "transform = { matrix = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], scale = 1 }",
            "3: a transform has matrix, or",
        ),
        ("transform = { scale = true }", "3: invalid type: boolean `true`, expected a scale"),
        ("transform = { rotate = 3 }", "3: invalid type: integer `3`, expected a rotation"),
        ("transform = { rotate = { axis = [0,0,0], degrees = 3 } }", "3: [0, 0, 0] is no direction"),
        ("[camera]\neye = [0,0,0]\nat = [0,0,0]", "3: the camera's eye and at are the same point"),
        ("[camera]\neye = [0,1,0]\nat = [0,0,0]", "3: the camera looks along its up direction"),
        ("[camera]\neye = [0,0,1]\nat = [0,0,0]\nfov = 180", "3: the field of view is 180 degrees"),
        ("[render]\nsize = [0, 5]", "4: a picture's width and height should be in 1..65536"),
        ("[render]\nao_samples = 0", "4: a number of samples should be in 1..65536"),
        (
            "[materials.a]\ndiffuse = 1\nchecker = { even = 0, odd = 1, size = 1 }",
            "5: a material has diffuse or checker",
        ),
        ("[[light]]\nkind = \"spot\"", "4: light kind 'spot' does not exist: write point, directional or sky"),
        (
            "[[light]]\nkind = \"point\"\nposition = [0,0,0]",
            "3: a point light has position and intensity, and nothing else",
        ),
        (
            "[[light]]\nkind = \"sky\"\nradiance = 1\nposition = [0,0,0]",
            "3: a sky light has radiance, and nothing else",
        ),
        ("[[light]]\nkind = \"directional\"", "3: a directional light has direction and irradiance, and nothing else"),
    ];
    for (lines, expected) in cases {
        let message = error(&format!("{MESH}{lines}\n"));
        assert!(message.starts_with(&format!("scene.toml:{expected}")), "{lines}: {message}");
    }
}

#[test]
fn files_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    assert!(read_scene(&path).unwrap_err().to_string().starts_with("cannot read "));
    std::fs::write(&path, format!("\n{MESH}")).unwrap();
    let message = read_scene(&path).unwrap_err().to_string();
    assert!(message.contains("scene.toml:3: the mesh file ") && message.ends_with("a.obj does not exist"), "{message}");
    std::fs::write(folder.path().join("a.obj"), "").unwrap();
    assert!(read_scene(&path).is_ok());
    std::fs::write(&path, b"# \n\xff\n").unwrap();
    assert!(read_scene(&path).unwrap_err().to_string().contains(":2: this is no UTF-8 text"));
}

#[test]
fn deep_nesting_is_an_error() {
    for open in ["[", "{a=", "[["] {
        assert!(error(&format!("x = {}", open.repeat(100_000))).starts_with("scene.toml:1: "));
    }
    assert!(error(&"a.".repeat(100_000)).starts_with("scene.toml:1: "));
}
