use super::*;
use crate::error::{Fault, Severity};
use crate::job::Job;
use crate::map::{Filter, Wrap};
use crate::scene::{Alpha, Channel, Model, Normals, Shading, TangentFrame, TbnPath};
use std::fs;

/// A folder of its own per test, with a model and pictures in it; removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let folder = std::env::temp_dir().join(format!("frieze-toml-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        for (k, n) in ["wood", "n", "h", "ao", "unused"].iter().enumerate() {
            let mut png = ::png::Encoder::new(fs::File::create(folder.join(format!("{n}.png"))).unwrap(), 2, 2);
            png.set_color(::png::ColorType::Grayscale);
            png.write_header().unwrap().write_image_data(&[k as u8; 4]).unwrap();
        }
        use ::exr::prelude::{Image, SpecificChannels, WritableImage};
        let y = SpecificChannels::build().with_channel("Y").with_pixel_fn(|_| (-0.25f32,));
        Image::from_channels((1, 1), y).write().to_file(folder.join("h.exr")).unwrap();
        fs::write(folder.join("spot.gltf"), SPOT).unwrap();
        Folder(folder)
    }
    fn load(&self, text: &str) -> Result<Loaded> {
        let path = self.0.join("scene.toml");
        fs::write(&path, text).unwrap();
        load(&path, &LoadOptions::default())
    }
    fn scene(&self, text: &str) -> Scene {
        let loaded = self.load(text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let odd = |f: &&Finding| f.code != "scene.no-light";
        assert_eq!(loaded.findings.iter().find(odd), None, "{text}");
        loaded.scene
    }
    fn error(&self, text: &str) -> Error {
        match self.load(text) {
            Ok(_) => panic!("should not be accepted: {text}"),
            Err(e) => {
                assert_eq!(e.fault, Fault::Input, "{e}");
                e
            }
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A model of one triangle.
const SPOT: &str = r#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}], "bufferViews": [{"buffer": 0, "byteLength": 36}], "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}"#;

/// The section "Scene file" of the interface, with what it says in comments.
const WHOLE: &str = r#"
version = 1

[output]
size = [1024, 768]
background = [0.1, 0.1, 0.1]
tone_map = "none"
encode = "srgb"
samples = 4
supersample = 1

[camera]
eye = [0, 1, 5]
target = [0, 0, 0]
up = [0, 1, 0]
fov_y = 45.0
near = 0.1
far = 100.0

[ambient]
color = [0.2, 0.2, 0.2]
per_light = false
environment = { file = "sky.hdr", projection = "latlong", rotation = 0.0, intensity = 1.0, sun = false }

[[light]]
kind = "directional"
position = [-2, 4, -1]
target = [0, 0, 0]
color = [1, 1, 1]
intensity = 1.0
falloff = "none"
shadow = { size = 1024, filter = "pcf", radius = 1, bias = 0.005, projection = "orthographic", near = 1.0, far = 7.5, extent = 10.0, wrap = "border", cascades = 1 }

[[light]]
kind = "spot"
position = [0, 4, 0]
inner_angle = 20
outer_angle = 30
range = 10
falloff = "inverse-square"
shadow = false

[[light]]
kind = "area"
shape = "rect"
extent = [1, 2]
position = [0, 4, 0]

[[object]]
mesh = "spot.gltf"
translate = [0, 1.5, 0]
rotate = [0, 0, 0]
scale = [0.5, 0.5, 0.5]
material = "wood"
instances = [[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1], [1,0,0,0, 0,1,0,0, 0,0,1,0, 2,0,0,1]]
time = 0.0

[[object]]
mesh = { primitive = "cube", size = 2.0, uv_scale = [1, 1], segments = 64 }
rotate_axis = [1, 0, 1]
rotate_angle = 60.0

[material.wood]
model = "blinn-phong"
shading = "phong"
diffuse = [1, 1, 1]
ambient = [1, 1, 1]
specular = [0.3, 0.3, 0.3]
shininess = 64.0
reflection = 0.0
alpha = "opaque"
double_sided = false
normals = "file"
tangent_frame = "mikktspace"
tbn_path = "world"
diffuse_map = { file = "wood.png", filter = "trilinear", wrap = "repeat", srgb = true }
normal_map = { file = "n.png", space = "tangent", y = "up", scale = 1.0, channels = 3, variance = "none" }
bump_map = { file = "h.png", scale = 0.02, method = "gradient" }
displacement_map = { file = "h.exr", scale = 0.1, midlevel = 0.5, vector = false, tessellation = "adaptive", edge_pixels = 2.0 }
parallax_map = { file = "h.png", scale = 0.05, method = "relief", self_shadow = true, silhouette = true }
occlusion_map = { file = "ao.png" }
roughness_map = { noise = "fbm", octaves = 5, frequency = 8.0, seed = 1 }
specular_aa = true

[material.other]
model = "pbr"
base_color = [1, 0, 0]
metallic = 1
roughness = 0.25
emissive = [1, 2, 3]
base_color_map = "unused.png"

[[volume]]
file = "fog.raw"
size = [1, 1, 1]
transfer = [[0, 1, 1, 1, 0.5], [1, 1, 1, 1, 2]]
iso = 0.5
steps = 64
scattering = 0.5

[animation]
object = 0
key = "displacement_map.scale"
times = [0, 1]
values = [0, 0.1]
"#;

#[test]
fn the_whole_contract_is_read() {
    let folder = Folder::new("whole");
    let loaded = folder.load(WHOLE).unwrap_or_else(|e| panic!("{e}"));
    let scene = &loaded.scene;
    assert_eq!(scene.name, "scene");
    assert_eq!(scene.output, Output::default());
    let camera = &scene.cameras[0];
    assert_eq!((camera.near, camera.far, camera.eye()), (0.1, 100.0, Vec3::new(0.0, 1.0, 5.0)));
    assert_eq!((scene.view, camera.projection), (View::Camera(0), Projection::Perspective { fov_y: 45.0 }));
    let shadow = scene.lights[0].shadow.unwrap();
    assert_eq!((shadow.bias, shadow.near, shadow.far), (Bias::Value(0.005), Some(1.0), Some(7.5)));
    assert_eq!((shadow.extent, shadow.projection), (Some(10.0), Some(ShadowProjection::Orthographic)));
    assert_eq!(scene.lights[1].kind, LightKind::Spot { inner: 20.0, outer: 30.0 });
    assert_eq!((scene.lights[1].range, scene.lights[1].shadow), (Some(10.0), None));
    assert_eq!(scene.lights[2].kind, LightKind::Point);
    // Two instances of the model and the cube; the model's file is one mesh.
    assert_eq!((scene.objects.len(), scene.meshes.len()), (3, 2));
    let at = |k: usize| scene.objects[k].transform.point(Vec3::new(1.0f32, 0.0, 0.0));
    assert_eq!((at(0), at(1)), (Vec3::new(0.5, 1.5, 0.0), Vec3::new(1.5, 1.5, 0.0)));
    assert_eq!((&scene.objects[0].materials[..], &scene.objects[2].materials[..]), (&[0][..], &[1][..]));
    let m = &scene.materials[0];
    assert_eq!((m.name.as_str(), m.double_sided, m.ambient), ("wood", false, Some([1.0; 3])));
    assert!(scene.materials[1].double_sided, "primitives are");
    // Five files are asked by the used material: wood, ao, n, h.png (twice) and h.exr; unused.png stays shut.
    assert_eq!(scene.images.len(), 5);
    let image = |t: &crate::scene::Texture| scene.images[t.image].value(0, 0, 0) * 255.0;
    assert_eq!(image(m.albedo_map.as_ref().unwrap()), 0.0);
    assert_eq!(image(&m.normal_map.as_ref().unwrap().texture), 1.0);
    assert_eq!(image(&m.parallax_map.as_ref().unwrap().texture), 2.0);
    assert_eq!(image(m.occlusion_map.as_ref().unwrap()), 3.0);
    assert_eq!(m.bump_map.as_ref().unwrap().midlevel, 0.5);
    assert!(m.roughness_map.is_none());
    // What is not drawn is told, with its line.
    let told: Vec<_> = loaded.findings.iter().map(|f| f.message.split('`').nth(1).unwrap()).collect();
    let want = [
        "ambient.environment",
        "light[2].kind",
        "volume",
        "animation",
        "object[0].time",
        "material.wood.specular_aa",
        "material.wood.roughness_map.noise",
        "material.wood.bump_map",
        "material.wood.displacement_map",
        "material.wood.parallax_map",
    ];
    assert_eq!(told, want);
    for f in &loaded.findings {
        assert_eq!((f.code, f.severity), ("scene.not-yet", Severity::Warning));
        let line: usize = f.place.as_ref().unwrap().strip_prefix("line ").unwrap().parse().unwrap();
        let key = f.message.split('`').nth(1).unwrap().rsplit('.').next().unwrap();
        let key = key.split('[').next().unwrap();
        assert!(WHOLE.lines().nth(line - 1).unwrap().contains(key), "{f}");
    }
}

#[test]
fn every_word_of_every_key_is_known() {
    let folder = Folder::new("words");
    for word in ["none", "aces", "agx", "reinhard", "khronos-neutral"] {
        folder.scene(&format!("output.tone_map = \"{word}\""));
    }
    assert_eq!(folder.scene("output.background = \"transparent\"").output.background, Background::Transparent);
    assert_eq!(folder.scene("output.size = 64").output.size, [64, 64]);
    assert_eq!(folder.scene("output = { samples = 16, encode = \"linear\" }").output.samples, 16);
    let material = |keys: &str| {
        let text = format!("[[object]]\nmesh = \"spot.gltf\"\nmaterial = \"m\"\n[material.m]\n{keys}\n");
        folder.scene(&text).materials[0].clone()
    };
    for (word, want) in [("blinn-phong", Model::BlinnPhong), ("pbr", Model::Pbr), ("unlit", Model::Unlit)] {
        assert_eq!(material(&format!("model = \"{word}\"")).model, want);
    }
    for (word, want) in [("flat", Shading::Flat), ("gouraud", Shading::Gouraud), ("phong", Shading::Phong)] {
        assert_eq!(material(&format!("shading = \"{word}\"")).shading, want);
    }
    for (word, want) in
        [("file", Normals::File), ("area", Normals::Area), ("angle", Normals::Angle), ("uniform", Normals::Uniform)]
    {
        assert_eq!(material(&format!("normals = \"{word}\"")).normals, want);
    }
    for (word, want) in [
        ("mikktspace", TangentFrame::Mikktspace),
        ("average", TangentFrame::Average),
        ("per-triangle", TangentFrame::PerTriangle),
        ("from-normal", TangentFrame::FromNormal),
        ("games101", TangentFrame::Games101),
    ] {
        assert_eq!(material(&format!("tangent_frame = \"{word}\"")).tangent_frame, want);
    }
    assert_eq!(material("tbn_path = \"tangent\"").tbn_path, TbnPath::Tangent);
    assert_eq!(material("alpha = \"mask\"\ncutoff = 0.25").alpha, Alpha::Mask(0.25));
    assert_eq!(material("alpha = \"mask\"").alpha, Alpha::Mask(0.5));
    assert_eq!(material("alpha = \"blend\"\nopacity = 0.5").alpha, Alpha::Blend);
    let map = |keys: &str| material(&format!("diffuse_map = {{ file = \"wood.png\", {keys} }}")).albedo_map.unwrap();
    for (keys, want) in [
        ("filter = \"nearest\"", Filter::Nearest),
        ("filter = \"bilinear\"", Filter::Bilinear),
        ("filter = \"bicubic\"", Filter::Bicubic),
        ("filter = \"mip-nearest\"", Filter::MipNearest),
        ("filter = \"trilinear\"", Filter::Trilinear),
        ("filter = \"ripmap\"", Filter::Ripmap),
        ("filter = \"anisotropic\"", Filter::Anisotropic { max: 16 }),
        ("filter = \"anisotropic\", max_anisotropy = 4", Filter::Anisotropic { max: 4 }),
        ("filter = \"ewa\", ewa_radius = 1.5", Filter::Ewa { radius: 1.5 }),
        ("filter = \"supersample\", taps = 64", Filter::Supersample { taps: 64 }),
        ("filter = \"supersample\"", Filter::Supersample { taps: 256 }),
    ] {
        assert_eq!(map(keys).filter, want);
    }
    assert_eq!(map("wrap = [\"mirror\", \"border\"]").wrap, [Wrap::Mirror, Wrap::Border]);
    assert_eq!(map("wrap = \"clamp\"").wrap, [Wrap::Clamp; 2]);
    assert_eq!(map("uv_scale = 3").scale, [3.0; 2]);
    let t = map("uv = 1, offset = [0.1, 0.2], rotate = 30, uv_scale = [2, 3], srgb = false, channel = \"rgb-norm\"");
    assert_eq!((t.uv, t.offset, t.rotate, t.scale), (1, [0.1, 0.2], 30.0, [2.0, 3.0]));
    assert_eq!((t.srgb, t.channel), (Some(false), Some(Channel::RgbNorm)));
    let n = material("normal_map = { file = \"n.png\", y = \"down\", scale = 2, channels = 2 }").normal_map.unwrap();
    assert_eq!((n.y_down, n.scale, n.channels), (true, 2.0, 2));
    let o = material("occlusion_map = { file = \"ao.png\", strength = 0.5 }");
    assert_eq!(o.occlusion_strength, 0.5);
    assert_eq!(material("double_sided = true").albedo_map, None);
    assert!(!material("").double_sided, "glTF says so where it is");
    for key in ["cube", "plane", "sphere", "torus", "teapot"] {
        let scene = folder.scene(&format!("object = [{{ mesh = {{ primitive = \"{key}\", segments = 8 }} }}]"));
        assert!(scene.meshes[0].triangle_count() > 0);
    }
    let uv = |scale: &str| {
        let scene = folder.scene(&format!("object = [{{ mesh = {{ primitive = \"cube\", uv_scale = {scale} }} }}]"));
        scene.meshes[0].uv[0].as_ref().unwrap().values.iter().fold([0.0f32; 2], |a, v| [a[0].max(v[0]), a[1].max(v[1])])
    };
    assert_eq!(uv("[3, 5]"), [3.0, 5.0]);
}

#[test]
fn heights_are_centred_by_the_kind_of_their_image() {
    let folder = Folder::new("heights");
    let text = "[[object]]\nmesh = \"spot.gltf\"\nmaterial = \"m\"\n[material.m]\n\
                bump_map = \"h.png\"\ndisplacement_map = \"h.exr\"\n";
    let m = folder.load(text).unwrap().scene.materials.remove(0);
    assert_eq!((m.bump_map.unwrap().midlevel, m.displacement_map.unwrap().midlevel), (0.5, 0.0));
}

#[test]
fn objects_are_placed_as_the_conventions_say() {
    let folder = Folder::new("place");
    let turn = |keys: &str| {
        let scene = folder.scene(&format!("[[object]]\nmesh = {{ primitive = \"cube\" }}\n{keys}\n"));
        scene.objects[0].transform
    };
    let x = Vec3::new(1.0f32, 0.0, 0.0);
    // Rz * Ry * Rx: x is turned by Rz last. 90 degrees are exact.
    assert_eq!(turn("rotate = [0, 0, 90]").point(x), Vec3::new(0.0, 1.0, 0.0));
    assert_eq!(turn("rotate = [0, 90, 0]").point(x), Vec3::new(0.0, 0.0, -1.0));
    assert_eq!(turn("rotate = [90, 0, 0]").point(Vec3::new(0.0f32, 1.0, 0.0)), Vec3::new(0.0, 0.0, 1.0));
    assert_eq!(turn("rotate = [90, 90, 0]").point(Vec3::new(0.0f32, 1.0, 0.0)), Vec3::new(1.0, 0.0, 0.0));
    assert_eq!(turn("rotate = [0, 90, 90]").point(x), Vec3::new(0.0, 0.0, -1.0));
    // T * R * S.
    let m = turn("translate = [1, 2, 3]\nrotate = [0, 0, 90]\nscale = [2, 1, 1]");
    assert_eq!(m.point(x), Vec3::new(1.0, 4.0, 3.0));
    assert_eq!(turn("scale = 2").point(x), Vec3::new(2.0, 0.0, 0.0));
    // An axis is normalised; a turn about x + z of 180 degrees swaps x and z.
    let p = turn("rotate_axis = [5, 0, 5]\nrotate_angle = 180").point(x);
    assert!((p - Vec3::new(0.0, 0.0, 1.0)).length() < 1e-6); // rounding of f32
    let (a, b) = (turn("rotate = [10, 20, 30]"), turn("rotate_axis = [0, 0, 1]\nrotate_angle = 30"));
    let [rx, ry] = ["rotate = [10, 0, 0]", "rotate = [0, 20, 0]"].map(turn);
    let product = b.times(&ry).times(&rx);
    for c in 0..4 {
        for r in 0..4 {
            assert!((a.0[c][r] - product.0[c][r]).abs() < 1e-6); // three roundings against one
        }
    }
}

#[test]
fn cameras_of_every_kind() {
    let folder = Folder::new("camera");
    let camera = |keys: &str| folder.scene(&format!("[camera]\n{keys}\n")).cameras.remove(0);
    let c = camera("eye = [0, 0, 4]");
    assert_eq!((c.target, c.far), (Vec3::splat(0.0), f32::INFINITY));
    assert_eq!(camera("eye = [0, 0, 4]\nfar = inf").far, f32::INFINITY);
    let c = camera("eye = [0, 0, 4]\nprojection = \"orthographic\"\nheight = 4.0");
    assert_eq!(c.projection, Projection::Orthographic { height: 4.0 });
    let c = camera(
        "matrix = [2,0,0,0, 0,2,0,0, 0,0,2,0, 1,0,4,1]\nintrinsics = { fx = 500, fy = 510, cx = 320.5, cy = 240 }",
    );
    assert_eq!(c.projection, Projection::Intrinsics { fx: 500.0, fy: 510.0, cx: 320.5, cy: 240.0 });
    assert_eq!((c.eye(), c.target), (Vec3::new(1.0, 0.0, 4.0), Vec3::new(1.0, 0.0, 0.0)));
    assert_eq!(c.transform.column(0).xyz(), Vec3::new(1.0, 0.0, 0.0), "rigid");
    assert_eq!(folder.scene("").view, View::Auto);
}

#[test]
fn lights_cast_as_their_kind_does() {
    let folder = Folder::new("lights");
    let light = |keys: &str| {
        let mut loaded = folder.load(&format!("[[light]]\n{keys}\n")).unwrap();
        (loaded.scene.lights.remove(0), loaded.findings.len())
    };
    let (l, told) = light("kind = \"directional\"\nposition = [0, 5, 0]");
    assert_eq!((l.direction, l.shadow, told), (Vec3::new(0.0, -1.0, 0.0), Some(Shadow::default()), 0));
    assert_eq!(light("kind = \"directional\"\ndirection = [0, -2, 0]").0.direction, Vec3::new(0.0, -1.0, 0.0));
    let (l, told) = light("kind = \"point\"\nposition = [0, 5, 0]");
    assert_eq!((l.shadow, told), (None, 0));
    let (l, told) = light("kind = \"spot\"\nposition = [0, 5, 0]");
    assert_eq!((l.shadow, told), (Some(Shadow::default()), 1));
    // Document 002: a point light with an orthographic map.
    let (l, told) = light(
        "kind = \"point\"\nposition = [0, 5, 0]\nshadow = { projection = \"orthographic\", filter = \"none\", wrap = \"repeat\" }",
    );
    assert_eq!((l.shadow.unwrap().filter, told), (ShadowFilter::Hard, 0));
    assert_eq!(l.shadow.unwrap().wrap, ShadowWrap::Repeat);
    let (l, told) = light("kind = \"point\"\nposition = [0, 5, 0]\nshadow = true");
    assert_eq!((l.shadow, told), (None, 1));
    for filter in ["pcss", "moment", "ray"] {
        let keys =
            format!("kind = \"directional\"\nposition = [0, 5, 0]\nshadow = {{ filter = \"{filter}\", radius = 2 }}");
        let (l, told) = light(&keys);
        assert_eq!((l.shadow.unwrap().filter, told), (ShadowFilter::Pcf { radius: 2 }, 1));
    }
    let (l, told) = light("kind = \"directional\"\nposition = [0, 5, 0]\nshadow = { bias = \"auto\", cascades = 4 }");
    assert_eq!((l.shadow.unwrap().bias, told), (Bias::Auto, 1));
}

#[test]
fn unknown_keys_name_the_nearest_known_one_and_the_line() {
    let folder = Folder::new("unknown");
    for (text, key, near, line) in [
        ("\nversoin = 1", "versoin", "version", 2),
        ("[output]\n\ntonemap = \"aces\"", "output.tonemap", "tone_map", 3),
        ("[camera]\neye = [0,0,1]\nfovy = 3", "camera.fovy", "fov_y", 3),
        ("[ambient]\ncolour = [0,0,0]", "ambient.colour", "color", 2),
        ("[[light]]\nkind = \"point\"\nposition = [0,0,0]\nintensty = 3", "light[0].intensty", "intensity", 4),
        ("[[light]]\nkind = \"point\"\nposition = [0,0,0]\nshadow = { siez = 3 }", "light[0].shadow.siez", "size", 4),
        ("[[object]]\nmesh = \"spot.gltf\"\nmaterail = \"m\"", "object[0].materail", "material", 3),
        ("[[object]]\nmesh = { primitive = \"cube\", segmnts = 3 }", "object[0].mesh.segmnts", "segments", 2),
        ("[material.m]\nshinines = 2", "material.m.shinines", "shininess", 2),
        ("[material.m]\ndiffuse_map = { file = \"wood.png\", filtr = 2 }", "material.m.diffuse_map.filtr", "filter", 2),
        ("[[volume]]\nstep = 2", "volume[0].step", "steps", 2),
        ("[animation]\ntime = [2]", "animation.time", "times", 2),
    ] {
        let e = folder.error(text);
        assert_eq!(e.code, "scene.unknown-key", "{e}");
        assert_eq!(e.message, format!("unknown key `{key}`"));
        assert_eq!(e.remedy.as_deref(), Some(&*format!("did you mean `{near}`?")));
        assert_eq!(e.place.as_deref(), Some(&*format!("line {line}")));
        assert!(e.file.unwrap().ends_with("scene.toml"));
    }
}

#[test]
fn keys_that_are_not_near_are_listed_and_other_names_are_known() {
    let folder = Folder::new("far");
    let e = folder.error("[output]\nexposure = 2");
    assert!(e.remedy.as_deref().unwrap().starts_with("possible keys are size, background"), "{e}");
    let e = folder.error("[[object]]\nmesh = \"spot.gltf\"\nposition = [0, 1, 0]");
    assert_eq!(e.remedy.as_deref(), Some("did you mean `translate`?"));
    let e = folder.error("[[light]]\nkind = \"sun\"\nposition = [0, 1, 0]");
    assert!(e.message.contains("possible are directional") && e.remedy.is_none(), "{e}");
}

#[test]
fn a_spot_light_whose_shadow_nobody_asked_for_does_not_warn() {
    let folder = Folder::new("spot-shadow");
    let told = |keys: &str| {
        let text = format!("[[light]]\nkind = \"spot\"\nposition = [0, 5, 0]\n{keys}\n");
        folder.load(&text).unwrap().findings
    };
    let note = told("");
    assert_eq!((note.len(), note[0].severity), (1, Severity::Note));
    assert!(note[0].message.contains("casts no shadow yet"), "{}", note[0]);
    assert!(told("shadow = false").is_empty());
    assert_eq!(told("shadow = true")[0].severity, Severity::Warning);
}

#[test]
fn a_scene_without_light_says_so() {
    let folder = Folder::new("dark");
    let object = "[[object]]\nmesh = { primitive = \"cube\" }\nmaterial = \"m\"\n";
    for (more, told) in [
        ("[material.m]", 1),
        ("[material.m]\n[ambient]", 0),
        ("[material.m]\nemissive = [1, 0, 0]", 0),
        ("[material.m]\n[[light]]\nkind = \"point\"\nposition = [0, 5, 0]", 0),
    ] {
        let found = folder.load(&format!("{object}{more}\n")).unwrap().findings;
        assert_eq!(found.iter().filter(|f| f.code == "scene.no-light").count(), told, "{more}");
    }
}

#[test]
fn wrong_values_are_errors_with_their_line() {
    let folder = Folder::new("values");
    let object = |m: &str| format!("[[object]]\nmesh = \"spot.gltf\"\nmaterial = \"m\"\n[material.m]\n{m}");
    for (text, code, line) in [
        ("version = 2".into(), "scene.version", 1),
        ("version = \"1\"".into(), "scene.type", 1),
        ("output = 3".into(), "scene.type", 1),
        ("[output]\nsize = [0, 3]".into(), "scene.range", 2),
        ("[output]\nsize = [3]".into(), "scene.range", 2),
        ("[output]\nsize = 70000".into(), "scene.range", 2),
        ("[output]\nsize = 1.5".into(), "scene.type", 2),
        ("[output]\nsize = 99999999999999999999".into(), "scene.range", 2),
        ("[output]\nsamples = 3".into(), "scene.range", 2),
        ("[output]\ntone_map = \"filmic\"".into(), "scene.range", 2),
        ("[output]\nbackground = [1, 2]".into(), "scene.range", 2),
        ("[output]\nbackground = [nan, 0, 0]".into(), "scene.range", 2),
        ("[output]\nbackground = [-1, 0, 0]".into(), "scene.range", 2),
        ("[camera]\nfov_y = 3".into(), "scene.missing-key", 1),
        ("[camera]\neye = [0, 0, 0]".into(), "scene.range", 2),
        ("[camera]\neye = [0, 0, 1]\nup = [0, 0, 0]".into(), "scene.range", 3),
        ("[camera]\neye = [0, 0, 1]\nfov_y = 180".into(), "scene.range", 3),
        ("[camera]\neye = [0, 0, 1]\nnear = 0".into(), "scene.range", 3),
        ("[camera]\neye = [0, 0, 1]\nnear = 2\nfar = 1".into(), "scene.range", 4),
        ("[camera]\neye = [0, 0, 1]\nheight = 2".into(), "scene.range", 3),
        ("[camera]\neye = [0, 0, 1]\nprojection = \"orthographic\"".into(), "scene.missing-key", 1),
        ("[camera]\nmatrix = [1,0,0,0, 0,1,0,0, 0,0,0,0, 0,0,0,1]".into(), "scene.range", 2),
        ("[camera]\nmatrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0]".into(), "scene.range", 2),
        ("[camera]\neye = [0,0,1]\nintrinsics = { fx = 1, fy = 1, cx = 0 }".into(), "scene.missing-key", 3),
        ("[ambient]\ncolor = \"red\"".into(), "scene.type", 2),
        ("[ambient]\nenvironment = { faces = [\"a\"] }".into(), "scene.range", 2),
        ("[[light]]\nposition = [0,0,0]".into(), "scene.missing-key", 1),
        ("[[light]]\nkind = \"point\"".into(), "scene.missing-key", 1),
        ("[[light]]\nkind = \"sun\"\nposition = [0,0,0]".into(), "scene.range", 2),
        ("[[light]]\nkind = \"directional\"\nposition = [0,0,0]".into(), "scene.range", 2),
        ("[[light]]\nkind = \"point\"\nposition = [0,1,0]\nouter_angle = 3".into(), "scene.range", 4),
        ("[[light]]\nkind = \"spot\"\nposition = [0,1,0]\ninner_angle = 50".into(), "scene.range", 4),
        ("[[light]]\nkind = \"point\"\nposition = [0,1,0]\nintensity = -1".into(), "scene.range", 4),
        ("[[light]]\nkind = \"point\"\nposition = [0,1,0]\nshadow = 3".into(), "scene.type", 4),
        (
            "[[light]]\nkind = \"directional\"\nposition = [0,1,0]\nshadow = { near = 3, far = 2 }".into(),
            "scene.range",
            4,
        ),
        ("[[object]]\nmaterial = \"m\"".into(), "scene.missing-key", 1),
        ("[[object]]\nmesh = \"spot.gltf\"\nmaterial = \"m\"".into(), "scene.unknown-material", 3),
        ("[[object]]\nmesh = { primitive = \"cone\" }".into(), "scene.range", 2),
        ("[[object]]\nmesh = { primitive = \"sphere\", segments = 100000 }".into(), "scene.range", 2),
        ("[[object]]\nmesh = \"spot.gltf\"\nrotate_axis = [0, 0, 0]\nrotate_angle = 3".into(), "scene.range", 3),
        ("[[object]]\nmesh = \"spot.gltf\"\nrotate_axis = [0, 0, 1]".into(), "scene.range", 3),
        ("[[object]]\nmesh = \"spot.gltf\"\ninstances = [[1, 2]]".into(), "scene.range", 3),
        ("[[object]]\nmesh = \"none.obj\"".into(), "file.missing", 2),
        ("[[object]]\nmesh = \"../spot.gltf\"".into(), "file.outside", 2),
        (object("shininess = true"), "scene.type", 5),
        (object("roughness = 2"), "scene.range", 5),
        (object("diffuse = [1,1,1]\nbase_color = [1,1,1]"), "scene.range", 6),
        (object("diffuse_map = { filter = \"nearest\" }"), "scene.missing-key", 5),
        (object("diffuse_map = { file = \"wood.png\", noise = \"fbm\" }"), "scene.range", 5),
        (object("diffuse_map = { file = \"gone.png\" }"), "file.missing", 5),
        (object("diffuse_map = { file = \"/etc/passwd\" }"), "file.outside", 5),
        (object("diffuse_map = { file = \"http://a.b/c.png\" }"), "file.url", 5),
        (object("diffuse_map = { file = \"wood.png\", wrap = [\"clamp\"] }"), "scene.range", 5),
        (object("diffuse_map = { file = \"wood.png\", max_anisotropy = 64 }"), "scene.range", 5),
        (object("normal_map = { file = \"n.png\", channels = 4 }"), "scene.range", 5),
        ("a = 1\na = 2".into(), "scene.syntax", 2),
        ("[output\n".into(), "scene.syntax", 1),
    ] {
        let e = folder.error(&text);
        assert_eq!((e.code, e.place.as_deref()), (code, Some(&*format!("line {line}"))), "{e}\n{text}");
        assert!(e.file.as_ref().unwrap().ends_with("scene.toml"), "{e}");
    }
    let e = folder.error("[[object]]\nmesh = \"spot.gltf\"\nmaterial = \"wod\"\n[material.wood]");
    assert_eq!(e.remedy.as_deref(), Some("did you mean \"wood\"?"));
    // A broken picture is named itself.
    fs::write(folder.0.join("bad.png"), b"\x89PNG\r\n\x1a\nxxxx").unwrap();
    let e = folder.error(&object("diffuse_map = \"bad.png\""));
    assert!(e.code == "image.corrupt" && e.file.unwrap().ends_with("bad.png"));
}

#[test]
fn hostile_files_end_in_errors() {
    let folder = Folder::new("hostile");
    for text in [
        "x = ".repeat(1000),
        "[".repeat(100_000),
        format!("x = {}", "[".repeat(100_000)),
        format!("x = {}1{}", "{a = ".repeat(1000), "}".repeat(1000)),
        format!("a{} = 1", ".a".repeat(10_000)),
        format!("{} = 1", "k".repeat(1 << 20)),
        "\0\0\0".into(),
        "[material]\nm = 3".into(),
        "object = 3".into(),
        "light = [1, 2]".into(),
    ] {
        folder.error(&text);
    }
    fs::write(folder.0.join("b.toml"), b"a = \"\xff\"").unwrap();
    assert_eq!(load(&folder.0.join("b.toml"), &LoadOptions::default()).unwrap_err().code, "scene.syntax");
    // Every prefix of the whole contract is read or refused.
    for k in (0..WHOLE.len()).step_by(7) {
        let _ = folder.load(&WHOLE[..k]);
    }
}

#[test]
fn images_of_unused_materials_stay_shut_and_used_ones_are_shared() {
    let folder = Folder::new("shared");
    let text = "object = [{ mesh = \"spot.gltf\", material = \"a\" }, { mesh = { primitive = \"cube\" }, material = \"a\" }]\n\
                [material.a]\ndiffuse_map = \"wood.png\"\nspecular_map = \"./wood.png\"\n\
                [material.b]\ndiffuse_map = \"not-there.png\"\n";
    let scene = folder.scene(text);
    // One image; two materials, since a cube is double-sided and a glTF model is not unless it is said.
    assert_eq!((scene.images.len(), scene.materials.len()), (1, 2));
    let said = text.replace("[material.a]", "[material.a]\ndouble_sided = true");
    assert_eq!(folder.scene(&said).materials.len(), 1);
}

#[test]
fn the_order_of_images_does_not_depend_on_threads() {
    let folder = Folder::new("threads");
    folder.load(WHOLE).unwrap();
    let with = |n| {
        let options = LoadOptions { job: Job::builder().threads(n).build(), ..Default::default() };
        load(&folder.0.join("scene.toml"), &options).unwrap().scene
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn the_scene_of_the_benchmark_loads() {
    let folder = Folder::new("bench");
    // As the benchmark's driver writes it for its scene of two textures and a shadow.
    let text = r#"[output]
background = [0, 0, 0]
tone_map = "none"
encode = "linear"
samples = 1

[camera]
eye = [0, 6, 12]
target = [0, 0, 0]
up = [0, 1, 0]
fov_y = 45
near = 0.1
far = 100

[ambient]
color = [0.119999997, 0.12, 0.12]

[[light]]
kind = "directional"
position = [10.5, 14, 7]
target = [0, 0, 0]
color = [1, 1, 1]
intensity = 1.0
shadow = { size = 2048, filter = "pcf", radius = 1, bias = "auto", near = 1, far = 50, extent = 12 }

[[object]]
mesh = "spot.gltf"
material = "m"

[material.m]
model = "blinn-phong"
shading = "phong"
specular = [0.3, 0.3, 0.3]
shininess = 32.0
diffuse_map = { file = "wood.png", filter = "trilinear", wrap = "repeat", srgb = false }
normal_map = { file = "n.png", space = "tangent", y = "up", filter = "trilinear" }
"#;
    let scene = folder.scene(text);
    assert_eq!(scene.output.encode, Encoding::Linear);
    assert_eq!(scene.materials[0].albedo_map.as_ref().unwrap().srgb, Some(false));
    assert_eq!(scene.lights[0].shadow.unwrap().size, 2048);
}
