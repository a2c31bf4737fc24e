//! Document 000: the vertex shader that builds the TBN matrix, and a fragment shader that lights the mapped normal
//! with Blinn-Phong (rows 5 to 8, 59 to 61, 64). Writes `blinn_phong.png` (row 3: the texture's picture is made
//! here; a file would come from `frieze::load`).

use frieze::image::pyramid::Pyramid;
use frieze::image::{Encoding, Image, Pixels};
use frieze::map::{Filter, Map, Wrap};
use frieze::math::exact;
use frieze::math::vec::{Mat4, Vec2, Vec3, Vec4};
use frieze::mesh::{shape, tangent};
use frieze::shade::shader::{Canvas, Fragment, Shader, Vertex, draw, perspective, texture};
use std::sync::Arc;

struct BlinnPhong;

/// `uniform` variables, each with its type.
struct Uniforms {
    model: Mat4,
    view: Mat4,
    projection: Mat4,
    light_pos: Vec3,
    view_pos: Vec3,
    normal_map: Map,
}

frieze::varying! {
    struct VsOut { frag_pos: Vec3, tex_coords: Vec2, tbn: [Vec3; 3] }
}

impl Shader for BlinnPhong {
    type Uniforms = Uniforms;
    type Varying = VsOut;

    fn vertex(&self, u: &Uniforms, v: &Vertex) -> (Vec4, VsOut) {
        // mat3 normalMatrix = transpose(inverse(mat3(model)));
        let n = u.model.normal_matrix().direction(v.normal).normalize();
        let t = u.model.direction(v.tangent.xyz()).normalize();
        let t = (t - n * t.dot(n)).normalize();
        // cross(N, T), and its sign for mirrored texture coordinates.
        let b = n.cross(t) * v.tangent.w;
        let frag_pos = u.model.point(v.position);
        let position = u.projection.apply(u.view.project(frag_pos));
        (position, VsOut { frag_pos, tex_coords: v.uv, tbn: [t, b, n] })
    }

    fn fragment(&self, u: &Uniforms, f: &Fragment<VsOut>) -> Option<[f32; 4]> {
        let fs_in = &f.varying;
        // normal = texture(normalMap, TexCoords).rgb * 2 - 1, then TBN * normal.
        let c = texture(&u.normal_map, fs_in.tex_coords, f.dx.tex_coords, f.dy.tex_coords).xyz();
        let c = c * 2.0 - Vec3::splat(1.0);
        let [t, b, n] = fs_in.tbn;
        let normal = (t * c.x + b * c.y + n * c.z).normalize();

        let (kd, ks, ka) = (Vec3::new(0.75, 0.55, 0.4), 0.3, 0.1);
        let l = (u.light_pos - fs_in.frag_pos).normalize();
        let v = (u.view_pos - fs_in.frag_pos).normalize();
        let h = (l + v).normalize();
        let diffuse = kd * f32::max(normal.dot(l), 0.0);
        let specular = Vec3::splat(ks * exact::pow(f32::max(normal.dot(h), 0.0), 32.0));
        Some((kd * ka + diffuse + specular).extend(1.0).array())
    }
}

/// Round studs, as tangent-space normals.
fn studs() -> Result<Map, frieze::Error> {
    let size = 64;
    let mut texels = Vec::new();
    for y in 0..size {
        for x in 0..size {
            let p = [x, y].map(|v| (v as f32 + 0.5) / size as f32 * 2.0 - 1.0);
            let r2 = p[0] * p[0] + p[1] * p[1];
            // A dome of radius 0.8; v runs down, so green is turned.
            let n = if r2 < 0.64 { Vec3::new(p[0], -p[1], 1.0).normalize() } else { Vec3::new(0.0, 0.0, 1.0) };
            texels.extend(n.array().map(|c| ((c * 0.5 + 0.5) * 255.0).round() as u8));
        }
    }
    let image = Image::new(size, size, 3, Pixels::U8(texels), Encoding::Linear)?;
    Ok(Map { pyramid: Arc::new(Pyramid::new(&image, false)), filter: Filter::Trilinear, wrap: [Wrap::Repeat; 2] })
}

fn main() -> Result<(), frieze::Error> {
    let mut mesh = shape::torus(2.0, 48);
    if let Some(uv) = &mut mesh.uv[0] {
        uv.values.iter_mut().for_each(|uv| *uv = [uv[0] * 12.0, uv[1] * 4.0]);
    }
    if let (Some(normals), Some(uv)) = (&mesh.normals, &mesh.uv[0]) {
        mesh.tangents = Some(tangent::mikktspace(&mesh, normals, uv));
    }
    let view_pos = Vec3::new(0.0, 1.8, 2.2);
    let uniforms = Uniforms {
        model: Mat4::IDENTITY,
        view: Mat4::look_at(view_pos, Vec3::default(), Vec3::new(0.0, 1.0, 0.0)),
        projection: perspective(45.0, 4.0 / 3.0, 0.1),
        light_pos: Vec3::new(2.0, 3.0, 1.0),
        view_pos,
        normal_map: studs()?,
    };
    let mut canvas = Canvas::new(320, 240, 4, [0.1, 0.1, 0.1, 1.0])?;
    draw(&BlinnPhong, &uniforms, &mesh, &mut canvas);
    canvas.frame()?.save("blinn_phong.png")
}
