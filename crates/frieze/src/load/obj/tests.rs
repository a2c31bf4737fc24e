use crate::error::Result;
use crate::load::{LoadOptions, Loaded, load, load_bytes};
use crate::scene::{Material, Model};

fn read(text: &str) -> Result<Loaded> {
    load_bytes("obj", text.as_bytes(), &LoadOptions::default())
}
fn codes(loaded: &Loaded) -> Vec<&'static str> {
    loaded.findings.iter().map(|f| f.code).collect()
}
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn polygons_keep_their_corners_and_get_triangles() {
    let mesh = read(&format!("{SQUARE}f 1 2 3 4\nf 1 2 3\n")).unwrap().scene.meshes.remove(0);
    assert_eq!(mesh.corners, [0, 1, 2, 3, 0, 1, 2]);
    assert_eq!((mesh.face_count(), mesh.triangle_count()), (2, 3));
    let polygons = mesh.polygons.unwrap();
    assert_eq!((polygons.starts, polygons.face_of), (vec![0, 4, 7], vec![0, 0, 1]));
    assert_eq!(polygons.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
    assert!(read(&format!("{SQUARE}f 1 2 3\nf 1 3 4")).unwrap().scene.meshes[0].polygons.is_none());
}

#[test]
fn every_form_of_index_is_read() {
    let text = "\u{feff}# a comment\r\nv 0 0 0 1.0\r\nv 1 0 0\r\nv 0 1 0\r\nvt 0.25 0.25\r\nvt 1\r\nvn 0 0 1\r\nvn 0 1 0\r\n\
                f 1/1/2 2/2/1 \\\r\n 3/1/1\r\nf -3/-2/-1 -2//2 -1/2\r\nf 1 2 3 # end";
    let Loaded { scene, findings } = read(text).unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.corners, [0, 1, 2, 0, 1, 2, 0, 1, 2]);
    let uv = mesh.uv[0].as_ref().unwrap();
    // v runs down; the corners without one have (0, 0).
    assert_eq!(uv.values, [[0.25, 0.75], [1.0, 1.0], [0.0, 0.0]]);
    assert_eq!(uv.index.as_ref().unwrap(), &[0, 1, 0, 0, 2, 1, 2, 2, 2]);
    let normals = mesh.normals.as_ref().unwrap();
    assert_eq!(normals.index.as_ref().unwrap(), &[1, 0, 0, 1, 1, 3, 4, 4, 4]);
    assert_eq!(normals.values[4], [0.0, 0.0, 1.0]);
    assert_eq!(findings.iter().map(|f| f.code).collect::<Vec<_>>(), ["obj.attribute-missing"; 2]);
}

#[test]
fn indices_equal_to_the_positions_are_not_kept() {
    let text = format!("{SQUARE}vn 0 0 1\nvn 0 0 1\nvn 0 0 1\nvn 0 0 1\nf 1//1 2//2 3//3\nf 1//1 3//3 4//4\n");
    assert!(read(&text).unwrap().scene.meshes[0].normals.as_ref().unwrap().index.is_none());
}

#[test]
fn colours_follow_positions() {
    let mesh = read("v 0 0 0\nv 1 0 0 0.5 0.25 1\nv 0 1 0 1 0 0 0.5\nf 1 2 3").unwrap().scene.meshes.remove(0);
    assert_eq!(mesh.colors.unwrap().values, [[1.0; 4], [0.5, 0.25, 1.0, 1.0], [1.0, 0.0, 0.0, 0.5]]);
}

#[test]
fn objects_become_meshes_with_their_own_vertices() {
    let text =
        format!("o left\n{SQUARE}usemtl a\nf 1 2 3\no right\nv 5 5 5\nusemtl b\nf 2 3 5\nusemtl a\nf 3 4 5\no empty\n");
    let scene = read(&text).unwrap().scene;
    let names: Vec<_> = scene.objects.iter().map(|o| &o.name[..]).collect();
    assert_eq!(names, ["left", "right"]);
    assert_eq!(scene.meshes[0].positions.len(), 3);
    assert_eq!(scene.meshes[1].positions, [[1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [5., 5., 5.]]);
    assert_eq!(scene.meshes[1].corners, [0, 1, 3, 1, 2, 3]);
    assert_eq!(scene.meshes[1].materials, [0, 1]);
    let name = |o: usize, s: usize| &scene.materials[scene.objects[o].materials[s]].name[..];
    assert_eq!((name(0, 0), name(1, 0), name(1, 1)), ("a", "b", "a"));
}

#[test]
fn faces_before_the_first_material_are_plain() {
    let scene = read(&format!("{SQUARE}f 1 2 3\nusemtl a\nf 1 3 4\n")).unwrap().scene;
    assert_eq!(scene.meshes[0].materials, [0, 1]);
    let names: Vec<_> = scene.objects[0].materials.iter().map(|&m| &scene.materials[m].name[..]).collect();
    assert_eq!(names, ["", "a"]);
    assert!(scene.materials.iter().all(|m| m.double_sided));
}

#[test]
fn smoothing_groups_make_normals_when_there_are_none() {
    // Two triangles folded along an edge.
    let fold = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 0 0 1\n";
    let normals = |text: &str| {
        let mesh = read(&format!("{fold}{text}")).unwrap().scene.meshes.remove(0);
        let normals = mesh.normals.clone();
        normals.map(|n| (0..6).map(|c| n.at(&mesh, c)).collect::<Vec<_>>())
    };
    assert_eq!(normals("f 1 3 2\nf 1 2 4\n"), None);
    assert_eq!(normals("s 1\nf 1 3 2\nf 1 2 4\n"), None);
    let flat = normals("s off\nf 1 3 2\nf 1 2 4\n").unwrap();
    assert_eq!((flat[0], flat[3]), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]));
    let apart = normals("s 1\nf 1 3 2\ns 2\nf 1 2 4\n").unwrap();
    assert_eq!((apart[0], apart[3]), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]));
    let both = normals("f 1 3 2\nf 1 2 4\ns 2\nf 1 3 2\n").unwrap();
    assert_eq!(both[0], both[3]);
    assert!(both[0][0] > 0.7 && both[0][2] > 0.7);
}

#[test]
fn errors_name_the_line() {
    let error = |text: &str| {
        let e = read(text).unwrap_err();
        (e.code, e.place.unwrap_or_default())
    };
    assert_eq!(error("v 0 0 0\nv 0 x 0\n"), ("obj.number", "line 2".into()));
    assert_eq!(error("v 0 0\n"), ("obj.number", "line 1".into()));
    assert_eq!(error("\nv 0 0 nan\n"), ("mesh.not-finite", "line 2".into()));
    assert_eq!(error(&format!("{SQUARE}f 1 2 3\nf 1 2 9\n")), ("obj.index-out-of-range", "line 6".into()));
    assert_eq!(error(&format!("{SQUARE}f 1 2 -9\n")), ("obj.index-out-of-range", "line 5".into()));
    assert_eq!(error(&format!("{SQUARE}f 1 2 0\n")), ("obj.index", "line 5".into()));
    assert_eq!(error(&format!("{SQUARE}f 1 2 3x\n")), ("obj.index", "line 5".into()));
    assert_eq!(error(&format!("{SQUARE}f 1 2 99999999999999\n")).0, "obj.index-out-of-range");
}

#[test]
fn oddities_are_findings() {
    let loaded = read(&format!("{SQUARE}mtllib none.mtl\nusemtl x\nl 1 2\nf 1 2\nf 1/9/9 2 3\nvp 1\nvp 2\n")).unwrap();
    let want = ["obj.lines-ignored", "obj.ignored", "obj.face-short", "obj.attribute-index", "obj.attribute-index"];
    assert_eq!(&codes(&loaded)[..5], want);
    assert!(codes(&loaded).contains(&"mtl.missing"));
    assert_eq!(loaded.scene.materials[0], Material { name: "x".into(), ..crate::load::mtl::plain("") });
}

#[test]
fn a_file_of_many_pieces_reads_as_one() {
    // Over a megabyte, with relative indices and continued lines across piece ends.
    let mut text = String::new();
    for k in 0..30_000 {
        text += &format!("v {k} 0 0\nv {k} 1 0\nv {k} 0 1\nf -3 \\\n -2 -1\n");
    }
    let mesh = read(&text).unwrap().scene.meshes.remove(0);
    assert!(text.len() > 4 * super::lines::PIECE);
    assert_eq!(mesh.positions.len(), 90_000);
    assert!(mesh.corners.iter().enumerate().all(|(k, &c)| c as usize == k));
    text += "f 1 2 99999\n";
    assert_eq!(read(&text).unwrap_err().place.as_deref(), Some("line 150001"));
}

#[test]
fn material_files_and_pictures_are_found_beside_the_model() {
    let folder = std::env::temp_dir().join(format!("frieze-obj-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("tex")).unwrap();
    let mut picture = Vec::new();
    png::Encoder::new(&mut picture, 1, 1).write_header().unwrap().write_image_data(&[7]).unwrap();
    std::fs::write(folder.join("tex/Wood.png"), &picture).unwrap();
    let mtl = "newmtl a\nKd .5 .5 .5\nmap_Kd tex\\wood.png\nmap_Ks tex/wood.png\nnewmtl b\nPr 0.2\nnewmtl never\nmap_Kd no.png\n\
               newmtl c\nmap_Kd ../../secret.png\nnewmtl d\nmap_d tex/Wood.png";
    std::fs::write(folder.join("my materials.mtl"), mtl).unwrap();
    let obj = format!(
        "mtllib my materials.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl c\nf 1 3 4\nusemtl d\nf 1 2 4"
    );
    let path = folder.join("model.obj");
    std::fs::write(&path, obj).unwrap();
    let loaded = load(&path, &LoadOptions::default()).unwrap();
    let scene = &loaded.scene;
    let a = &scene.materials[0];
    assert_eq!((a.albedo, a.model), ([0.5; 3], Model::BlinnPhong));
    assert_eq!(a.albedo_map.as_ref().unwrap().image, 0);
    assert_eq!(scene.images[0].rgba(0, 0)[0], 7.0 / 255.0);
    assert_eq!(scene.materials[1].model, Model::Pbr);
    assert_eq!(codes(&loaded), ["file.case", "file.case", "texture.missing"]);
    assert!(scene.materials[2].albedo_map.is_none());
    std::fs::remove_dir_all(&folder).unwrap();
}
