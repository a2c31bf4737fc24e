//! What can be typed. One struct per verb; the verbs themselves live in files of their own.

use clap::builder::styling::{AnsiColor, Styles};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

/// Renders, compares and inspects textured 3D assets.
///
/// On any machine: no GPU, no driver, no display. And with the same bytes on every one of them.
#[derive(Debug, Parser)]
#[command(
    name = "frieze",
    styles = STYLES,
    arg_required_else_help = true,
    disable_version_flag = true,
    infer_long_args = false,
    max_term_width = 100,
    after_help = "See `frieze COMMAND --help` for the options and examples of a command.",
    after_long_help = "\
Examples:
  frieze render                                 our showpiece, to frieze.png
  frieze render model.glb                       a picture of a model, to model.png
  frieze render scene.toml -o scene.exr         a scene file, to linear light
  frieze compare expected.png actual.png        how two pictures differ
  frieze inspect model.obj                      what is in a file, and what is odd about it
  frieze convert height.png -o n.png --to normal  a normal map of a height map

Exit codes:
  0 done   1 a check that was asked for failed   2 bad arguments   3 bad input file
  4 over the memory that was allowed   5 cannot write   70 a bug in frieze   130 interrupted

Environment:
  FRIEZE_SIMD   scalar, sse, avx2, avx512 or neon: uses this SIMD level of the processor instead of the
                fastest one. The level changes the time a picture takes, never the picture.
  NO_COLOR      no colour in messages"
)]
pub struct Cli {
    /// Print the version; with --json also the SIMD levels of this processor
    #[arg(short = 'V', long)]
    pub version: bool,
    /// Options that all commands share.
    #[command(flatten)]
    pub common: Common,
    /// What to do.
    #[command(subcommand)]
    pub verb: Option<Verb>,
}

/// Options that all commands share.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Print one JSON document on stdout (`frieze schema` prints its schema)
    #[arg(long, global = true)]
    pub json: bool,
    /// Print errors only (`inspect`, `explain` and `samples` still print what they are asked for)
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Overwrite existing files
    #[arg(short, long, global = true)]
    pub force: bool,
    /// Threads to use; the result does not depend on it [default: one per core]
    #[arg(long, global = true, value_name = "N", value_parser = threads)]
    pub threads: Option<u16>,
    /// Seed of whatever is drawn at random; the same seed gives the same result
    #[arg(long, global = true, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub seed: u64,
    /// Most memory to use, such as 512M or 2G; work that needs more ends with exit code 4
    #[arg(long, global = true, value_name = "SIZE", value_parser = memory)]
    pub max_memory: Option<u64>,
    /// When to colour messages
    #[arg(long, global = true, value_name = "WHEN", value_enum, default_value_t = Color::Auto, hide_default_value = true)]
    pub color: Color,
}

/// When to colour messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Color {
    /// When they go to a terminal
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Render a model or a scene to a picture
    Render(Box<Render>),
    /// Tell how two pictures or maps differ
    Compare(Compare),
    /// Turn maps into maps: heights into normals and back, conventions, curvature
    Convert(Box<Convert>),
    /// Tell what is in a model, a scene or a picture
    Inspect(Inspect),
    /// Tell why a pixel has its colour
    Explain(Explain),
    /// Run the shaders of GAMES101's assignment 3 by the rules of its framework
    Games101(Games101),
    /// List the built-in scenes
    Samples,
    /// Print a completion script for a shell
    #[command(after_long_help = "\
Examples:
  frieze completions bash > ~/.local/share/bash-completion/completions/frieze
  frieze completions zsh  > ~/.zfunc/_frieze
  frieze completions fish > ~/.config/fish/completions/frieze.fish")]
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
    /// Write man pages
    #[command(after_long_help = "\
Examples:
  frieze man -o ~/.local/share/man/man1")]
    Man {
        /// The folder to write to; it is made if need be
        #[arg(short, long = "output", value_name = "DIR")]
        out: PathBuf,
    },
    /// Print the JSON schema of what --json prints
    Schema,
}

/// `frieze render`
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  frieze render                                         our showpiece, to frieze.png
  frieze render model.glb                               to model.png
  frieze render model.obj -o big.png --size 3840x2160 --samples 16
  frieze render sample:teapot -o - | your-viewer        PNG on stdout
  frieze render model.glb --camera \"eye=2,1,3 target=0,0.5,0 fov=30\"
  frieze render model.glb --turntable 36 -o turn.png    turn.000.png to turn.035.png
  frieze render model.glb -o planes.exr --aov depth,normal
  frieze render sample:cubes --light-depth 0 -o dmap.png
  frieze render model.glb --overlay wire,tbn            edges and tangent frames over the picture
  frieze render model.obj --albedo wood.png --normal-map wood_n.png --normal-map-scale 0.5

A model without a camera is framed from the front, a little from the right and above; one without lights
gets a key light with shadows and a fill light. A scene file gets what it says: docs/scene-file.md of the
source lists its keys. `frieze samples` lists the built-in scenes.")]
pub struct Render {
    /// A model (.glb .gltf .obj .ply .stl), a scene (.toml) or sample:NAME [default: sample:frieze]
    pub scene: Option<PathBuf>,
    /// Where to write: .png .exr .hdr .jpg .webp, or - for PNG on stdout [default: the scene's name + .png]
    #[arg(short, long = "output", value_name = "OUT")]
    pub out: Option<PathBuf>,
    /// Pixels: WxH, or N for NxN, up to 16384 a side (with supersampling) [default: the scene's]
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub size: Option<(u32, u32)>,
    /// Samples per pixel along edges: 1, 4, 8 or 16 [default: the scene's]
    #[arg(long, value_name = "N", value_parser = samples)]
    pub samples: Option<u32>,
    /// Bits per channel of a .png
    #[arg(long, value_name = "8|16", value_parser = bits, default_value = "8")]
    pub bits: u8,
    /// auto, the name or number of a camera of the scene, or "eye=x,y,z target=x,y,z fov=45"
    ///
    /// Other keys: up=x,y,z ortho=HEIGHT (instead of fov) near= far=. What is not given is taken from the
    /// scene's camera. Distances are in metres, fov is the full vertical angle in degrees.
    #[arg(long, value_name = "CAMERA", value_parser = crate::view::parse)]
    pub camera: Option<crate::view::Choice>,
    /// Write N pictures, the camera going once around its target
    #[arg(long, value_name = "N", value_parser = turntable)]
    pub turntable: Option<u32>,
    /// Extra planes beside the colour, with commas between: depth, normal, view-normal, tangent, uv,
    /// position, object, material, triangle, barycentric, mip-level, texel-density; or all
    ///
    /// They go into the same .exr; beside a .png or another picture each becomes a file of its own, out.depth.exr and so
    /// on. `color` is always written.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = aov)]
    pub aov: Vec<Plane>,
    /// Lines over the picture, with commas between: normals, map-normals, tbn, wire, uv-seams, light-frustum
    ///
    /// Normals, and tangents (red), bitangents (green) and normals (blue) stand at the vertices; map-normals are those
    /// that pixels are shaded with. Lines that lie behind something are hidden.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = overlay)]
    pub overlay: Vec<frieze::render::Overlay>,
    /// Length of the arrows of --overlay, metres [default: 1/20 of the picture's height]
    #[arg(long, value_name = "METRES", requires = "overlay", value_parser = positive)]
    pub overlay_length: Option<f32>,
    /// Width of the lines of --overlay, pixels [default: 1/400 of the picture's shorter side]
    #[arg(long, value_name = "PIXELS", requires = "overlay", value_parser = positive)]
    pub overlay_width: Option<f32>,
    /// Pixels between the arrows of map-normals [default: 1/20 of the picture's shorter side]
    #[arg(long, value_name = "PIXELS", requires = "overlay", value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub overlay_spacing: Option<u32>,
    /// Write the depth map of a light (its name or number) instead of the picture: black near the light, white far
    ///
    /// One channel, linear: 0 at the near plane of the light's shadow map, 1 at its far plane and where nothing is,
    /// the metric of a shadow's `bias`. The picture has the size of the map. Directional lights have one.
    #[arg(long, value_name = "LIGHT", conflicts_with_all = ["size", "samples", "turntable", "aov", "bench", "camera", "overlay"])]
    pub light_depth: Option<String>,
    /// Where all materials compute their lighting
    #[arg(long, value_enum, value_name = "HOW")]
    pub shading: Option<Shading>,
    /// The reflection model of all materials
    #[arg(long, value_enum, value_name = "MODEL")]
    pub material: Option<Model>,
    /// Also show the picture in the terminal
    #[arg(long)]
    pub preview: bool,
    /// Afterwards render N more frames into memory and report how long they took
    ///
    /// The camera moves a little from frame to frame, so the counters are not those of the picture.
    #[arg(long, value_name = "N", value_parser = bench)]
    pub bench: Option<u32>,
    /// Let the files name others outside of their own folder
    #[arg(long)]
    pub allow_outside: bool,
    /// Maps for all materials.
    #[command(flatten)]
    pub maps: Maps,
    /// Words of the contract that come later.
    #[command(flatten)]
    pub later: Later,
}

/// One-off maps.
#[derive(Args, Debug)]
#[command(next_help_heading = "Maps for all materials")]
pub struct Maps {
    /// Colour
    #[arg(long, value_name = "FILE")]
    pub albedo: Option<PathBuf>,
    /// Multiplies the colour
    #[arg(long, value_name = "X", requires = "albedo", value_parser = finite)]
    pub albedo_scale: Option<f32>,
    /// Tangent-space normals, +Y up
    #[arg(long, value_name = "FILE")]
    pub normal_map: Option<PathBuf>,
    /// Multiplies the tilt of the normals
    #[arg(long, value_name = "X", requires = "normal_map", value_parser = finite)]
    pub normal_map_scale: Option<f32>,
    /// How much ambient light arrives
    #[arg(long, value_name = "FILE")]
    pub occlusion: Option<PathBuf>,
    /// How much the occlusion counts, 0 to 1
    #[arg(long, value_name = "X", requires = "occlusion", value_parser = unit)]
    pub occlusion_scale: Option<f32>,
}

/// Options of the contract that this version cannot honour yet: each is an error that says so.
#[derive(Args, Debug)]
pub struct Later {
    #[arg(long, hide = true, value_name = "FILE")]
    pub bump: Option<PathBuf>,
    #[arg(long, hide = true, value_name = "X")]
    pub bump_scale: Option<f32>,
    #[arg(long, hide = true, value_name = "FILE")]
    pub displacement: Option<PathBuf>,
    #[arg(long, hide = true, value_name = "X")]
    pub displacement_scale: Option<f32>,
    #[arg(long, hide = true, value_name = "FILE")]
    pub parallax: Option<PathBuf>,
    #[arg(long, hide = true, value_name = "X")]
    pub parallax_scale: Option<f32>,
    #[arg(long, hide = true, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    #[arg(long, hide = true, value_name = "X")]
    pub environment_scale: Option<f32>,
    #[arg(long, hide = true, value_name = "HOW")]
    pub method: Option<String>,
    #[arg(long, hide = true, value_name = "FILE")]
    pub export_mesh: Option<PathBuf>,
    #[arg(long, hide = true)]
    pub exact: bool,
}

/// Where lighting is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shading {
    /// Once per triangle
    Flat,
    /// Once per vertex
    Gouraud,
    /// Per pixel
    Phong,
}

/// The reflection model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Model {
    /// Ambient, diffuse and specular lobes
    BlinnPhong,
    /// Metallic-roughness
    Pbr,
}

/// A word of `--aov`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// The picture itself.
    Color,
    /// Every extra plane.
    All,
    /// An extra plane.
    Extra(frieze::render::Aov),
}

/// `frieze compare`
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  frieze compare expected.png actual.png
  frieze compare expected.png actual.png -o heat.png --fail-above flip=0.01
  frieze compare a.png b.png --fail-above max=0 --quiet && echo the same
  frieze compare baked_n.png reference_n.png --normals --fail-above angle=2
  frieze compare expected.exr actual.exr --metrics rmse,flip --json

FLIP is LDR-FLIP, and HDR-FLIP where both files hold floats; 0 is the same, 1 is most different, seen from
67.02 pixels per degree. max and rmse are in units of the full range of the file (1 = white). The first
picture is the reference. A failed check ends with exit code 1.")]
pub struct Compare {
    /// The reference
    pub a: PathBuf,
    /// The picture to judge
    pub b: PathBuf,
    /// Write a heat map of the difference (.png .webp .jpg): FLIP, or the angle with --normals
    #[arg(short, long = "output", value_name = "OUT")]
    pub out: Option<PathBuf>,
    /// Fail (exit 1) where a metric is above a limit: max, rmse, flip or angle (mean, degrees)
    #[arg(long, value_name = "METRIC=X", value_parser = crate::compare::above)]
    pub fail_above: Vec<crate::compare::Limit>,
    /// Fail (exit 1) where a metric is below a limit: psnr (dB)
    #[arg(long, value_name = "METRIC=X", value_parser = crate::compare::below)]
    pub fail_below: Vec<crate::compare::Limit>,
    /// What to measure, with commas between [default: max,rmse,psnr,flip, and angle for normal maps]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    pub metrics: Vec<crate::compare::Metric>,
    /// The pictures are normal maps [default: guessed from the file names]
    #[arg(long)]
    pub normals: bool,
}

/// `frieze convert`
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  frieze convert height.png -o normal.png --to normal --strength 24
  frieze convert height.exr -o normal.png --to normal --texel-size 0.002 --tile
  frieze convert normal.png -o directx.png --to normal --y down      flips green, makes lengths 1
  frieze convert wood_n.png -o both.png --to normal --with scratches_n.png
  frieze convert normal.png -o height.exr --to height --tile
  frieze convert normal.png -o curvature.png --to curvature
  frieze convert normal.png -o object.png --to object --mesh head.glb
  frieze convert normal.png -o normal.ktx2 --to bc5                  says what angle compression costs
  frieze convert odd.png -o normal.png --fix auto                    mends what `frieze inspect odd.png` finds
  frieze convert bc5.png -o normal.png --fix rebuild-z,normalize

--fix auto mends what `frieze inspect` is at least 90 % sure of, leaves green pointing up (+Y), says what it did and
why, and leaves alone what it is not sure of. It never closes seams, as no map tells whether it should tile.

Maps are read as data: no sRGB curve is undone. Heights count in texels: --strength 24 says that white lies 24
texels above black (that a float of 1 is 24 texels high), so a slope does not depend on the size of the map. With
--texel-size it is AMPLITUDE / SIZE. A height's midlevel makes no difference to its slope. Kernels, for a wave of
k radians per texel: sobel and central keep sin(k)/k of a slope, spline 1 - k^4/180; bicubic is the gradient of
the surface that filter = \"bicubic\" draws, which at texels is that of central; forward is h[+1] - h[0].")]
pub struct Convert {
    /// The map
    pub map: PathBuf,
    /// Where to write: .png (8 or 16 bits), .exr (floats), .ktx2 (bc5, bc7, ktx2)
    #[arg(short, long = "output", value_name = "OUT")]
    pub out: PathBuf,
    /// What to make
    #[arg(long, value_enum, value_name = "KIND", required_unless_present = "fix")]
    pub to: Option<Target>,
    /// What to mend, with commas between: auto, flip-y, srgb, normalize, neutral, rebuild-z, seams
    ///
    /// auto mends what `frieze inspect` finds for certain, and says what it did and why.
    #[arg(long, value_name = "ISSUES", value_delimiter = ',', value_parser = crate::convert_fix::issue)]
    #[arg(conflicts_with_all = ["to", "from", "strength", "texel_size", "with", "mesh"])]
    pub fix: Vec<crate::convert_fix::Issue>,
    /// What the map holds [default: guessed]
    #[arg(long, value_enum, value_name = "KIND")]
    pub from: Option<Holds>,
    /// How many texels high the full range of heights is [default: 2 % of the width; for heights that are made, as needed]
    #[arg(long, value_name = "TEXELS", value_parser = finite, conflicts_with = "texel_size", allow_negative_numbers = true)]
    pub strength: Option<f32>,
    /// How wide a texel is, metres
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub texel_size: Option<f32>,
    /// How high the full range of heights is, metres [default: 1]
    #[arg(long, value_name = "METRES", value_parser = finite, requires = "texel_size", allow_negative_numbers = true)]
    pub amplitude: Option<f32>,
    /// Which number of a texel is its height: r, g, b, a, luminance or rgb-norm
    #[arg(long, value_enum, value_name = "CHANNEL", default_value = "r")]
    pub channel: Number,
    /// How slopes are found
    #[arg(long, value_enum, value_name = "KERNEL", default_value = "sobel")]
    pub kernel: SlopeKernel,
    /// The map is a tile: its edges meet. Without it slopes are one-sided at the edges
    #[arg(long)]
    pub tile: bool,
    /// Where green points in the normal map that is made: up (OpenGL, glTF) or down (DirectX)
    #[arg(long, value_enum, value_name = "WAY", default_value = "up")]
    pub y: Way,
    /// Where green points in the normal map that is read
    #[arg(long, value_enum, value_name = "WAY", default_value = "up")]
    pub from_y: Way,
    /// Channels of the normal map that is read; 2 rebuilds blue
    #[arg(long, value_name = "2|3", value_parser = clap::value_parser!(u8).range(2..=3), default_value = "3")]
    pub channels: u8,
    /// A second normal map, of the same conventions, whose detail is put on the first (reoriented)
    #[arg(long, value_name = "MAP")]
    pub with: Option<PathBuf>,
    /// The mesh that wears the map, for --to object and --to tangent
    ///
    /// Its own tangents count, or MikkTSpace where it has none.
    #[arg(long, value_name = "MESH")]
    pub mesh: Option<PathBuf>,
    /// What the numbers are stored in [default: 16 for .png, f32 for .exr]
    #[arg(long, value_enum, value_name = "DEPTH")]
    pub depth: Option<MapDepth>,
    /// Round 8 bits plainly, without noise
    #[arg(long)]
    pub no_dither: bool,
    /// The slope or the curvature at the ends of an integer's range [default: 1, 0.5]
    #[arg(long, value_name = "X", value_parser = positive)]
    pub range: Option<f32>,
}

/// What `frieze convert` makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// Tangent-space normals
    Normal,
    /// Heights (from normals)
    Height,
    /// Slopes along u (red) and v (green)
    Derivative,
    /// Mean curvature, positive where it bulges out
    Curvature,
    /// A cone map, for cone stepping
    #[value(hide = true)]
    Cone,
    /// Object-space normals from tangent-space ones (with --mesh)
    Object,
    /// Tangent-space normals from object-space ones (with --mesh)
    Tangent,
    /// A displaced mesh
    #[value(hide = true)]
    Mesh,
    /// Normals in BC5 blocks, two channels (.ktx2)
    Bc5,
    /// Normals in BC7 blocks, three channels (.ktx2)
    Bc7,
    /// Normals, not compressed, as a texture for graphics hardware (.ktx2)
    Ktx2,
}

/// What `frieze convert` reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Holds {
    /// Heights
    Height,
    /// Tangent-space normals
    Normal,
}

/// A number of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Number {
    /// Red, or grey
    R,
    /// Green
    G,
    /// Blue
    B,
    /// Alpha
    A,
    /// Rec. 709 luminance of the values as they are stored
    Luminance,
    /// Length of the RGB vector
    RgbNorm,
}

/// How slopes are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SlopeKernel {
    /// 3x3, least noise
    Sobel,
    /// Half the difference of the neighbours
    Central,
    /// Gradient of the Catmull-Rom surface: at texels that of central
    Bicubic,
    /// Difference to the next texel
    Forward,
    /// Gradient of the bicubic B-spline through the heights
    Spline,
}

/// Where green points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Way {
    /// Up the image
    Up,
    /// Down the image
    Down,
}

/// What numbers are stored in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MapDepth {
    /// 8 bits, dithered
    #[value(name = "8")]
    Eight,
    /// 16 bits
    #[value(name = "16")]
    Sixteen,
    /// Half floats
    F16,
    /// Single floats
    F32,
}

/// `frieze inspect`
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  frieze inspect model.glb
  frieze inspect model.obj --json | jq .findings
  frieze inspect wood_normal.png               which kind of normal map it is, and what is wrong with it
  frieze inspect n.png --mesh model.glb        and which tangent basis it was baked for
  frieze inspect sample:teapot")]
pub struct Inspect {
    /// A model, a scene, a picture or sample:NAME
    pub file: PathBuf,
    /// The model that FILE, a normal map, is for: tells which tangent basis fits
    #[arg(long, value_name = "MODEL")]
    pub mesh: Option<PathBuf>,
    /// Let the files name others outside of their own folder
    #[arg(long)]
    pub allow_outside: bool,
}

/// `frieze explain`
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  frieze explain sample:teapot --pixel 512,384
  frieze explain scene.toml --size 1920x1080 --pixel 960,540 --json")]
pub struct Explain {
    /// A model, a scene or sample:NAME
    pub scene: PathBuf,
    /// The pixel: column from the left, row from the top, both from 0
    #[arg(long, value_name = "X,Y", value_parser = pixel)]
    pub pixel: (u32, u32),
    /// Pixels of the picture: WxH, or N for NxN [default: the scene's]
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub size: Option<(u32, u32)>,
    /// As in `frieze render`
    #[arg(long, value_name = "CAMERA", value_parser = crate::view::parse)]
    pub camera: Option<crate::view::Choice>,
    /// Let the files name others outside of their own folder
    #[arg(long)]
    pub allow_outside: bool,
}

/// `frieze games101`
#[derive(Args, Debug)]
#[command(after_long_help = "\
Examples:
  frieze games101 normal --mesh spot.obj -o normal.png
  frieze games101 texture --mesh spot.obj --texture spot_texture.png -o texture.png
  frieze games101 bump --mesh spot.obj --texture hmap.jpg -o bump.png
  frieze games101 phong --mesh spot.obj -o phong.png --coverage int

The picture is 700x700. The shaders follow the course's framework, oddities included, and are held to closed forms; they
have not been compared with the pictures of a build of it.")]
pub struct Games101 {
    /// The fragment shader
    #[arg(value_enum)]
    pub shader: Lesson,
    /// A model of one mesh (.obj .glb .gltf .ply .stl) or sample:NAME; the course uses its Spot (.obj)
    #[arg(long, value_name = "MODEL")]
    pub mesh: PathBuf,
    /// The texture of `texture`, or the height map of `bump` and `displacement`
    #[arg(long, value_name = "IMG")]
    pub texture: Option<PathBuf>,
    /// Where to write
    #[arg(short, long = "output", value_name = "OUT")]
    pub out: PathBuf,
    /// Coverage: of 4 sub-samples, or as the framework does when insideTriangle takes integers
    #[arg(long, value_enum, value_name = "4|int", default_value = "4")]
    pub coverage: Coverage,
    /// Mend the known errata of the framework
    #[arg(long)]
    pub corrected: bool,
}

/// The five fragment shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Lesson {
    /// Normals as colours
    Normal,
    /// Blinn-Phong
    Phong,
    /// Blinn-Phong with a texture
    Texture,
    /// The bumped normal as a colour
    Bump,
    /// Blinn-Phong on a displaced point
    Displacement,
}

/// The coverage rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Coverage {
    /// Four sub-samples
    #[value(name = "4")]
    Four,
    /// The pixel's corner
    Int,
}

/// Most pixels along a side.
const MOST_PIXELS: u32 = frieze::raster::MAX_SIZE;

/// `WxH` or `N`.
pub fn size(s: &str) -> Result<(u32, u32), String> {
    let side = |v: &str| match v.parse::<u32>() {
        Ok(n) if (1..=MOST_PIXELS).contains(&n) => Ok(n),
        _ => Err(format!(
            "`{v}` is not a number of pixels from 1 to {MOST_PIXELS}; write WxH or N, such as 1920x1080 or 512"
        )),
    };
    match s.split_once(['x', 'X']) {
        Some((w, h)) => Ok((side(w)?, side(h)?)),
        None => side(s).map(|n| (n, n)),
    }
}

/// A number of bytes with a suffix: `512M`, `2G`, `1.5GiB`. Suffixes are powers of 1024.
pub fn memory(s: &str) -> Result<u64, String> {
    let wrong = || format!("`{s}` is not a size; write it as 512M or 2G");
    let digits = s.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(s.len());
    let (number, suffix) = s.split_at(digits);
    let number: f64 = number.parse().map_err(|_| wrong())?;
    let shift = match suffix.to_ascii_lowercase().trim_end_matches("ib").trim_end_matches('b') {
        "" => 0,
        "k" => 10,
        "m" => 20,
        "g" => 30,
        "t" => 40,
        _ => return Err(wrong()),
    };
    let bytes = number * (1u64 << shift) as f64;
    // 2^53: beyond it f64 has no whole bytes, and no machine has them either.
    if bytes.is_finite() && (1.0..=9_007_199_254_740_992.0).contains(&bytes) { Ok(bytes as u64) } else { Err(wrong()) }
}

/// A whole number of `things` from 1 to `most`.
fn count(s: &str, most: u32, things: &str) -> Result<u32, String> {
    s.parse().ok().filter(|n| (1..=most).contains(n)).ok_or_else(|| format!("1 to {most} {things} are possible"))
}

fn turntable(s: &str) -> Result<u32, String> {
    count(s, 100_000, "pictures of a turn")
}

fn bench(s: &str) -> Result<u32, String> {
    count(s, 1_000_000, "frames")
}

fn threads(s: &str) -> Result<u16, String> {
    count(s, 1024, "threads").map(|n| n as u16)
}

fn samples(s: &str) -> Result<u32, String> {
    match s.parse() {
        Ok(n @ (1 | 4 | 8 | 16)) => Ok(n),
        _ => Err("1, 4, 8 or 16 are possible".into()),
    }
}

fn bits(s: &str) -> Result<u8, String> {
    match s {
        "8" => Ok(8),
        "16" => Ok(16),
        _ => Err("8 or 16 are possible".into()),
    }
}

fn pixel(s: &str) -> Result<(u32, u32), String> {
    let parts = s.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    parts.ok_or_else(|| format!("`{s}` is not a pixel; write X,Y such as 512,384"))
}

fn aov(s: &str) -> Result<Plane, String> {
    if s == "color" {
        return Ok(Plane::Color);
    }
    if s == "all" {
        return Ok(Plane::All);
    }
    let all = frieze::render::Aov::ALL;
    all.iter().find(|(name, _)| *name == s).map(|(_, a)| Plane::Extra(*a)).ok_or_else(|| {
        let names: Vec<_> = ["color", "all"].into_iter().chain(all.iter().map(|(n, _)| *n)).collect();
        format!("there is no plane `{s}`{}; there are {}", did_you_mean(s, &names), names.join(", "))
    })
}

fn overlay(s: &str) -> Result<frieze::render::Overlay, String> {
    let all = frieze::render::Overlay::ALL;
    all.iter().find(|(name, _)| *name == s).map(|(_, o)| *o).ok_or_else(|| {
        let names = all.map(|(n, _)| n);
        format!("there is no overlay `{s}`{}; there are {}", did_you_mean(s, &names), names.join(", "))
    })
}

fn positive(s: &str) -> Result<f32, String> {
    finite(s).ok().filter(|v| *v > 0.0).ok_or_else(|| "a number above 0 is needed".into())
}

fn finite(s: &str) -> Result<f32, String> {
    s.parse().ok().filter(|v: &f32| v.is_finite()).ok_or_else(|| "a number is needed".into())
}

fn unit(s: &str) -> Result<f32, String> {
    finite(s).ok().filter(|v| (0.0..=1.0).contains(v)).ok_or_else(|| "a number from 0 to 1 is needed".into())
}

/// `; did you mean `x`?` for the name nearest to `word`, or nothing when none is near.
pub fn did_you_mean(word: &str, names: &[&str]) -> String {
    let near = names.iter().map(|n| (distance(word, n), n)).min_by_key(|(d, _)| *d);
    match near {
        Some((d, name)) if d <= 1 + name.len() / 3 => format!(" (did you mean `{name}`?)"),
        _ => String::new(),
    }
}

/// Levenshtein distance.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let cost = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = cost.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn sizes() {
        assert_eq!(size("512"), Ok((512, 512)));
        assert_eq!(size("1920x1080"), Ok((1920, 1080)));
        for wrong in ["", "0", "x", "10x", "-1", "16385", "1e3", "10x20x30"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn memory_sizes() {
        assert_eq!(memory("512M"), Ok(512 << 20));
        assert_eq!(memory("2GiB"), Ok(2 << 30));
        assert_eq!(memory("1.5k"), Ok(1536));
        assert_eq!(memory("100"), Ok(100));
        for wrong in ["", "M", "-1G", "1X", "inf", "1e400", "0"] {
            assert!(memory(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_near_word_is_offered_and_a_far_one_is_not() {
        assert!(did_you_mean("depht", &["normal", "depth"]).contains("depth"));
        assert_eq!(did_you_mean("zebra", &["normal", "depth"]), "");
    }
}
