//! What loaders promise of every scene, whatever the file was. The fuzz targets ask it too.

use frieze::Scene;

/// What loaders promise of every scene.
pub fn check(scene: &Scene) {
    for mesh in &scene.meshes {
        assert!(mesh.positions.iter().flatten().all(|v| v.is_finite()));
        assert!(mesh.corners.iter().all(|&c| (c as usize) < mesh.positions.len()));
        match &mesh.polygons {
            None => assert_eq!(mesh.corners.len() % 3, 0),
            Some(p) => {
                assert_eq!(*p.starts.last().unwrap() as usize, mesh.corners.len());
                assert!(p.starts.windows(2).all(|w| w[0] + 3 <= w[1]));
                assert_eq!(p.triangles.len(), p.face_of.len());
                for (t, &f) in p.triangles.iter().zip(&p.face_of) {
                    let face = p.starts[f as usize]..p.starts[f as usize + 1];
                    assert!(t.iter().all(|c| face.contains(c)));
                }
            }
        }
        let corners = mesh.corners.len();
        let attribute = |index: Option<&Vec<u32>>, len: usize| match index {
            Some(index) => assert!(index.len() == corners && index.iter().all(|&k| (k as usize) < len)),
            None => assert_eq!(len, mesh.positions.len()),
        };
        mesh.normals.iter().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        mesh.uv.iter().flatten().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        mesh.colors.iter().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        mesh.tangents.iter().for_each(|a| attribute(a.index.as_ref(), a.values.len()));
        assert!(mesh.normals.iter().flat_map(|a| &a.values).flatten().all(|v| v.is_finite()));
        assert!(mesh.uv.iter().flatten().flat_map(|a| &a.values).flatten().all(|v| v.is_finite()));
        assert!(mesh.materials.is_empty() || mesh.materials.len() == mesh.face_count());
    }
    for object in &scene.objects {
        let mesh = &scene.meshes[object.mesh];
        assert!(object.materials.iter().all(|&m| m < scene.materials.len()));
        let slots = mesh.materials.iter().max().map_or(1, |&m| m as usize + 1);
        assert!(object.materials.len() >= slots);
        assert!(object.transform.0.iter().flatten().all(|v| v.is_finite()));
    }
    for (texture, _) in scene.materials.iter().flat_map(|m| m.textures()) {
        assert!(texture.image < scene.images.len() && texture.uv < 2);
    }
}
