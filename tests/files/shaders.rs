//! The shader build: every shipped shader compiles, is valid SPIR-V, and the compiler's own checks work.

use cao_compile::{self as compile, Bounds, Kernel, Options, Source, What};
use cao_kernels as shaders;
use cao_reflect::{BindingKind, Shader, Stage};
use std::{fs, path::Path, process::Command};

const UNCHECKED: Options = Options { bounds: Bounds::Unchecked, debug: false };
const CHECKED: Options = Options { bounds: Bounds::Checked, debug: true };

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/spirv"))
}

/// A folder with these files in it.
fn files(list: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in list {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

fn compile_main(list: &[(&str, &str)]) -> Result<Kernel, String> {
    let folder = files(list);
    compile::file(folder.path(), &folder.path().join("main.wgsl"), UNCHECKED)
}

fn compile_text(wgsl: &str) -> Result<Kernel, String> {
    compile_main(&[("main.wgsl", wgsl)])
}

fn refused(wgsl: &str) -> String {
    compile_text(wgsl).expect_err("must be refused")
}

/// `spirv-val`'s complaints; `None` where the program is not installed.
fn spirv_val(shader: &Shader) -> Option<Result<(), String>> {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), shader.spirv.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<_>>()).unwrap();
    let output =
        Command::new("spirv-val").args(["--target-env", "vulkan1.3"]).arg(file.path()).output().ok()?;
    Some(if output.status.success() {
        Ok(())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    })
}

fn assert_valid(shader: &Shader, what: &str) {
    match spirv_val(shader) {
        Some(result) => result.unwrap_or_else(|e| panic!("{what}: {e}")),
        None => println!("{what}: not checked, spirv-val is not installed (Debian: spirv-tools)"),
    }
}

#[test]
fn every_shader_compiles_and_is_valid_with_and_without_bounds_checks() {
    for path in compile::files(folder()).unwrap() {
        for options in [UNCHECKED, CHECKED] {
            let what = format!("{} {:?}", path.display(), options.bounds);
            let shader =
                compile::file(folder(), &path, options).unwrap_or_else(|e| panic!("{what}:\n{e}")).shader;
            assert!(!shader.entry_points.is_empty(), "{what} has no entry point");
            assert_valid(&shader, &what);
        }
    }
}

/// What the shaders build on, in one file.
const SAMPLER: &str = "
    struct Inner { scale: vec4f, count: u32 }
    struct Params { dims: vec4u, inner: Inner, step: f32 }
    struct Out { total: atomic<u32>, values: array<f32> }
    struct Push { eye: vec4f, index: u32 }
    @group(0) @binding(3) var<uniform> params: Params;
    @group(0) @binding(1) var<storage, read_write> out: Out;
    @group(0) @binding(5) var field: texture_3d<f32>;
    @group(0) @binding(6) var depth: texture_depth_2d_array;
    @group(0) @binding(7) var linear: sampler;
    @group(0) @binding(8) var result: texture_storage_3d<r8unorm, write>;
    @group(0) @binding(9) var counters: texture_storage_2d<r32uint, atomic>;
    @group(0) @binding(10) var norm: texture_storage_3d<r16unorm, read_write>;
    @group(0) @binding(0) var<storage, read> lengths: array<vec4f>;
    var<immediate> push: Push;
    var<workgroup> shared_: array<f32, 64>;
    fn touch() { textureAtomicAdd(counters, vec2u(0u), 1u); }
    @compute @workgroup_size(4, 4, 4)
    fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
        shared_[local] = params.step * push.eye.x;
        workgroupBarrier();
        atomicAdd(&out.total, 1u);
        touch();
        let v = textureSampleLevel(field, linear, vec3f(id) / vec3f(params.dims.xyz), 0.0).r;
        textureStore(result, id, vec4f(v + shared_[63u - local]));
    }
    @compute @workgroup_size(64)
    fn second(@builtin(global_invocation_id) id: vec3u) {
        if id.x < arrayLength(&out.values) { out.values[id.x] = lengths[id.x].w; }
        textureStore(norm, id, textureLoad(norm, id));
    }
    struct Fragment { @builtin(position) p: vec4f, @location(0) uv: vec2f, @location(1) @interpolate(flat) eye: u32 }
    @vertex fn corner(@builtin(vertex_index) i: u32, @builtin(view_index) eye: u32) -> Fragment {
        return Fragment(vec4f(f32(i), push.eye.y, 0.0, 1.0), vec2f(0.0), eye);
    }
    @fragment fn shade(in: Fragment) -> @location(0) vec4f {
        return vec4f(f32(textureLoad(depth, vec2i(in.uv), i32(in.eye), 0)));
    }
";

#[test]
fn reflection_says_what_each_entry_point_touches() {
    let s = compile_text(SAMPLER).unwrap().shader;
    assert_valid(&s, "SAMPLER");
    let folder = files(&[("main.wgsl", SAMPLER)]);
    assert_valid(
        &compile::file(folder.path(), &folder.path().join("main.wgsl"), CHECKED).unwrap().shader,
        "SAMPLER with bounds checks",
    );
    let names: Vec<_> = s.bindings.iter().map(|b| (b.binding, b.name)).collect();
    let expected = [
        (0, "lengths"),
        (1, "out"),
        (3, "params"),
        (5, "field"),
        (6, "depth"),
        (7, "linear"),
        (8, "result"),
        (9, "counters"),
        (10, "norm"),
    ];
    assert_eq!(names, expected, "sorted by number");
    assert_eq!(s.push_bytes, 32);
    let uses = |entry: &str| -> Vec<(&str, bool, bool)> {
        let entry = s.entry_points.iter().find(|e| e.name == entry).unwrap();
        entry.uses.iter().map(|u| (s.bindings[u.binding].name, u.reads, u.writes)).collect()
    };
    let main = [
        ("out", true, true),
        ("params", true, false),
        ("field", true, false),
        ("linear", true, false),
        ("result", false, true),
        ("counters", true, true),
    ];
    assert_eq!(uses("main"), main);
    assert_eq!(uses("second"), [("lengths", true, false), ("out", false, true), ("norm", true, true)]);
    assert_eq!(uses("corner"), []);
    assert_eq!(uses("shade"), [("depth", true, false)]);
    let facts: Vec<_> = s.entry_points.iter().map(|e| (e.stage, e.workgroup, e.push_bytes)).collect();
    assert_eq!(
        facts,
        [
            (Stage::Compute, [4, 4, 4], 32),
            (Stage::Compute, [64, 1, 1], 0),
            (Stage::Vertex, [0; 3], 32),
            (Stage::Fragment, [0; 3], 0)
        ]
    );
}

/// What the compiler emits for a few awkward kernels; its own tests hold it to that text.
#[expect(dead_code, reason = "these tests look at a part of it")]
mod emitted {
    include!("../../spirv/compile/tests/kernels/emitted.rs");
}

/// The same as text.
const EMITTED: &str = include_str!("../../spirv/compile/tests/kernels/emitted.rs");

/// Offsets as the WGSL specification has them, section 14.4.1.
#[test]
fn emitted_structs_lie_in_memory_as_in_wgsl() {
    use emitted::awkward::{Awkward, Counted, Inner, Outer};
    macro_rules! at {
        ($of:ident: $($field:ident $offset:literal),+; $size:literal) => {
            $(assert_eq!(std::mem::offset_of!($of, $field), $offset, stringify!($of.$field));)+
            assert_eq!(size_of::<$of>(), $size, stringify!($of));
        };
    }
    at!(Inner: direction 0, count 12, place 16, pad 24; 32);
    at!(Outer: inner 0; 64);
    at!(Counted: total 0; 16);
    at!(Awkward: normal 0, weight 12, centre 16, size 32, corner 48, points 64, inner 96, turn 128, view 176, narrow 240,
        pad 256, r#in 260, far 288, many 304; 1184);
    assert_eq!(Counted::PARTS_AT, 16);
    assert_eq!(size_of::<emitted::picture::Look>(), 16);
}

#[test]
fn a_host_writes_a_struct_whole_and_its_bytes_are_the_kernels() {
    use emitted::shared::parts::Inner;
    let inner = Inner { direction: [1.0, 2.0, 3.0], count: 4, place: [5, 6], pad: Default::default() };
    let bytes = bytemuck::bytes_of(&inner);
    let words = [1.0_f32.to_bits(), 2.0_f32.to_bits(), 3.0_f32.to_bits(), 4, 5, 6, 0, 0];
    assert_eq!(bytes, words.map(u32::to_ne_bytes).concat());
    assert_eq!(bytemuck::pod_read_unaligned::<Inner>(bytes), inner);
    // The kernels that ship, too.
    let params: shaders::near::NearParams = bytemuck::Zeroable::zeroed();
    assert_eq!(bytemuck::bytes_of(&params).len() as u32, shaders::near::SHADER.push_bytes);
}

#[test]
fn emitted_constants_have_the_values_that_the_kernels_compute_with() {
    use emitted::awkward as k;
    let (step, below, turn, tiny, mask): (i32, i32, f32, f32, u32) =
        (k::STEP, k::BELOW, k::TURN, k::TINY, k::MASK);
    assert_eq!((step, below, turn, tiny, mask), (8, -9, std::f32::consts::TAU, 1e-6, u32::MAX));
    assert_eq!((k::CHANGED, k::ALL_CHANGED), (256, 0xff00));
    let wide: bool = k::WIDE;
    assert!(wide);
    assert_eq!((k::TILE, k::ZERO), ([8_u32, 4], [0_i32; 3]));
    assert_eq!(k::MIXED, [1.0_f32, 2.0, 3.0, 3.0]);
    assert_eq!(k::OFFSETS, [[0.5_f32; 3], [1.0, 2.0, 3.0]]);
    assert_eq!(k::SCALED, [[turn, 0.0], [0.0, 1.0]]);
    assert_eq!((k::MAIN_WORKGROUP, k::LIST_WORDS_WORKGROUP), ([4, 4, 2], [64, 1, 1]));
    // Of the kernels that ship: of abstract type, and computed.
    assert_eq!((shaders::rays::UNIT, shaders::rays::VOXELS), (65536, shaders::shared::bricks::BRICK.pow(3)));
}

/// Two kernels that include one file have its types in common.
#[test]
fn what_kernels_share_is_one_type() {
    let one: emitted::picture::Inner = bytemuck::Zeroable::zeroed();
    let _: emitted::awkward::Inner = one;
    assert_eq!(EMITTED.matches("pub struct Inner").count(), 1);
    assert_eq!(EMITTED.matches("pub const CHANGED").count(), 1);
    assert!(!EMITTED.contains("struct Local"), "no buffer holds it");
}

/// That an entry point's struct has no other fields is what makes a missing or misspelt binding an error of the compiler.
#[test]
fn an_entry_points_bindings_are_exactly_what_it_touches() {
    let list = |name: &str| {
        let body = EMITTED.split(&format!("pub struct {name}Bindings<'a> {{")).nth(1).unwrap();
        let body = body.split("\n    }").next().unwrap();
        body.lines()
            .filter_map(|line| line.trim().strip_prefix("pub ")?.strip_suffix(','))
            .collect::<Vec<_>>()
    };
    let main = [
        "awkward: &'a crate::gpu::Buffer",
        "counted: &'a crate::gpu::Buffer",
        "outer: &'a crate::gpu::Buffer",
        "volume: &'a crate::gpu::Image",
        "linear: &'a crate::gpu::Sampler",
        "words: &'a crate::gpu::Buffer",
    ];
    assert_eq!(list("Main"), main);
    assert_eq!(list("ListWords"), ["words: &'a crate::gpu::Buffer"]);
    assert_eq!(list("Draw"), ["corners: &'a crate::gpu::Buffer", "before: crate::gpu::Flat<'a>"]);
    assert!(EMITTED.contains("pub type ClearWordsBindings<'a> = ListWordsBindings<'a>;"));
    assert!(!EMITTED.contains("NothingBindings"));
}

#[test]
fn the_emitted_rust_is_the_same_for_the_same_sources() {
    let folder = files(&[
        ("b.wgsl", SAMPLER),
        ("room/a.wgsl", "@compute @workgroup_size(1) fn main() {}"),
        ("shared/c.wgsl", "broken"),
    ]);
    let rust = compile::folder(folder.path(), UNCHECKED).unwrap();
    assert_eq!(rust, compile::folder(folder.path(), UNCHECKED).unwrap());
    let at = |text: &str| rust.find(text).unwrap_or_else(|| panic!("no {text} in\n{rust}"));
    assert!(at("pub mod a {") < at("pub mod b {"));
    at("pub struct Params {");
    at("assert!(size_of::<Params>() == 64);");
    assert!(!rust.contains("mod c"), "what no kernel includes is no part of it");
}

#[test]
fn a_struct_in_memory_has_every_member_and_every_gap() {
    let kernel = compile_text(SAMPLER).unwrap();
    let structs: Vec<_> = kernel
        .items
        .iter()
        .filter_map(|item| match &item.what {
            What::Struct(s, _) => Some((
                s.name.as_str(),
                s.size,
                s.fields.iter().map(|f| (f.name.as_str(), f.offset, f.size)).collect(),
            )),
            What::Constant(_) => None,
        })
        .collect();
    let expected = [
        ("Inner", 32, vec![("scale", 0, 16), ("count", 16, 4), ("pad", 20, 12)]),
        ("Params", 64, vec![("dims", 0, 16), ("inner", 16, 32), ("step", 48, 4), ("pad", 52, 12)]),
        ("Out", 4, vec![("total", 0, 4)]),
        ("Push", 32, vec![("eye", 0, 16), ("index", 16, 4), ("pad", 20, 12)]),
    ];
    assert_eq!(structs, expected);
}

#[test]
fn two_kernels_of_one_name_are_refused_whatever_their_rooms() {
    let empty = "@compute @workgroup_size(1) fn main() {}";
    let folder = files(&[("cast/a.wgsl", empty), ("draw/a.wgsl", empty), ("draw/b.wgsl", empty)]);
    let errors = compile::folder(folder.path(), UNCHECKED).unwrap_err();
    assert_eq!(errors.len(), 1, "{errors:?}");
    assert!(errors[0].contains("cast/a.wgsl") && errors[0].contains("draw/a.wgsl"), "{errors:?}");
    let folder = files(&[("cast/shared.wgsl", empty)]);
    assert!(compile::folder(folder.path(), UNCHECKED).unwrap_err()[0].contains("shared.wgsl"));
}

/// A shared constant may be made of one that each kernel has.
#[test]
fn an_included_file_that_says_two_things_is_refused() {
    let shared = ("shared/c.wgsl", "\nconst TWICE = 2u * ONCE;");
    let kernel = |once: u32| {
        format!(
            "#include \"shared/c.wgsl\"\nconst ONCE = {once}u;\n@compute @workgroup_size(1) fn main() {{ _ = TWICE; }}"
        )
    };
    let folder = files(&[("a.wgsl", &kernel(1)), ("b.wgsl", &kernel(1)), shared]);
    let rust = compile::folder(folder.path(), UNCHECKED).unwrap();
    assert_eq!(rust.matches("pub const TWICE: u32 = 2;").count(), 1);
    let folder = files(&[("a.wgsl", &kernel(1)), ("b.wgsl", &kernel(2)), shared]);
    let errors = compile::folder(folder.path(), UNCHECKED).unwrap_err();
    for part in ["c.wgsl:2", "a.wgsl", "b.wgsl"] {
        assert!(errors[0].contains(part), "{errors:?}");
    }
}

/// Declarations are found line by line; one that is not found must not go missing.
#[test]
fn a_declaration_in_the_middle_of_a_line_is_refused() {
    let main = "@compute @workgroup_size(1) fn main() {}";
    let message = refused(&format!("struct S {{ x: u32 }} const N = 1u;\n{main}"));
    assert!(message.contains("`N`"), "{message}");
    let message = refused(&format!(
        "const N = 1u; struct S {{ x: u32 }}\n@group(0) @binding(0) var<uniform> s: S;\n{main}"
    ));
    assert!(message.contains("`S`"), "{message}");
}

#[test]
fn no_shader_at_all_is_fine() {
    assert_eq!(compile::folder(Path::new("no such folder"), UNCHECKED).unwrap(), "");
    assert_eq!(compile::folder(files(&[]).path(), UNCHECKED).unwrap(), "");
}

#[test]
fn a_name_that_is_no_rust_module_is_refused() {
    let folder = files(&[("two-words.wgsl", "@compute @workgroup_size(1) fn main() {}")]);
    let errors = compile::folder(folder.path(), UNCHECKED).unwrap_err();
    assert!(errors[0].contains("two-words.wgsl"), "{errors:?}");
}

#[test]
fn the_errors_of_all_shaders_are_reported_together() {
    let folder = files(&[
        ("a.wgsl", "fn f() -> { }"),
        ("b.wgsl", "@compute @workgroup_size(1) fn main() {}"),
        ("c.wgsl", "fn g() { oops(); }"),
    ]);
    let errors = compile::folder(folder.path(), UNCHECKED).unwrap_err();
    assert_eq!(errors.len(), 2);
    assert!(errors[0].contains("a.wgsl:1:") && errors[1].contains("c.wgsl:1:"), "{errors:?}");
}

#[test]
fn a_file_is_included_once_however_often_it_is_asked_for() {
    let s = compile_main(&[
        (
            "main.wgsl",
            "#include \"shared/a.wgsl\"\n#include \"shared/b.wgsl\"\n@compute @workgroup_size(1) fn main() { _ = A + B; }",
        ),
        ("shared/a.wgsl", "const A = 1u;"),
        ("shared/b.wgsl", "  #include \"shared/a.wgsl\"\nconst B = A;"),
    ]);
    s.unwrap();
}

#[test]
fn an_error_names_the_file_and_line_it_is_in_also_when_included() {
    let shared = ("shared/a.wgsl", "// one\n// two\nfn half(x: f32) -> f32 { return x * 0.5; }\n");
    let in_main = compile_main(&[
        ("main.wgsl", "\n#include \"shared/a.wgsl\"\nfn f() -> f32 {\n    return halve(1.0);\n}\n"),
        shared,
    ]);
    let message = in_main.unwrap_err();
    assert!(message.contains("main.wgsl:4:12") && message.contains("return halve(1.0);"), "{message}");
    let broken = ("shared/a.wgsl", "// one\n// two\nfn half(x: f32) -> u32 { return x * 0.5; }\n");
    let message = compile_main(&[("main.wgsl", "\n#include \"shared/a.wgsl\"\n"), broken]).unwrap_err();
    assert!(message.contains("a.wgsl:3:") && message.contains("x * 0.5"), "{message}");
    assert!(message.lines().any(|line| line.contains("^^^")), "{message}");
}

#[test]
fn a_missing_include_names_who_asked_for_it() {
    let message = compile_main(&[("main.wgsl", "// head\n#include \"shared/none.wgsl\"\n")]).unwrap_err();
    assert!(message.contains("main.wgsl:2") && message.contains("none.wgsl"), "{message}");
    let message = compile_main(&[("main.wgsl", "#include shared/none.wgsl\n")]).unwrap_err();
    assert!(message.contains("main.wgsl:1") && message.contains("#include \"file\""), "{message}");
}

#[test]
fn an_include_cycle_is_refused_at_the_line_that_closes_it() {
    let message = compile_main(&[
        ("main.wgsl", "#include \"shared/a.wgsl\"\n"),
        ("shared/a.wgsl", "// a\n#include \"shared/b.wgsl\"\n"),
        ("shared/b.wgsl", "// b\n// b\n#include \"shared/a.wgsl\"\n"),
    ])
    .unwrap_err();
    assert!(message.contains("b.wgsl:3") && message.contains("itself"), "{message}");
}

#[test]
fn lines_map_back_through_includes() {
    let folder = files(&[("main.wgsl", "a\n#include \"x.wgsl\"\nb\n"), ("x.wgsl", "c\nd\n")]);
    let source = Source::read(folder.path(), &folder.path().join("main.wgsl")).unwrap();
    assert_eq!(source.text, "a\nc\nd\nb\n");
    let origin = |line| {
        source.origin(line).map(|(path, n)| (path.file_name().unwrap().to_str().unwrap().to_owned(), n))
    };
    assert_eq!(origin(1), Some(("main.wgsl".into(), 1)));
    assert_eq!(origin(3), Some(("x.wgsl".into(), 2)));
    assert_eq!(origin(4), Some(("main.wgsl".into(), 3)));
    assert_eq!(origin(5), None);
}

#[test]
fn too_large_workgroups_are_refused() {
    let message = refused("@compute @workgroup_size(8, 8, 5) fn main() {}");
    assert!(message.contains("320") && message.contains("256"), "{message}");
    compile_text("@compute @workgroup_size(8, 8, 4) fn main() {}").unwrap();
    let shared = |n: u32| {
        format!(
            "var<workgroup> x: array<u32, {n}>;\n@compute @workgroup_size(1) fn main() {{ x[0] = 1u; }}\n@compute @workgroup_size(1) fn other() {{}}"
        )
    };
    let message = refused(&shared(4097));
    assert!(
        message.contains("`main`") && message.contains("16388") && !message.contains("`other`"),
        "{message}"
    );
    compile_text(&shared(4096)).unwrap();
}

/// A kernel with this body, after a barrier function.
fn kernel(body: &str) -> String {
    format!(
        "var<workgroup> x: array<u32, 64>;
         var<immediate> n: u32;
         fn wait() {{ workgroupBarrier(); }}
         @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32, @builtin(workgroup_id) g: vec3u) {{
             {body}
         }}"
    )
}

#[test]
fn a_barrier_that_some_invocations_miss_is_refused() {
    for body in [
        "if i > 3u { return; } x[i] = i; workgroupBarrier();",
        "if i > 3u { return; } x[i] = i; wait();",
        "for (var k = 0u; k < 4u; k++) { if x[k] == i { return; } } storageBarrier();",
        "for (var k = 0u; k < 4u; k++) { workgroupBarrier(); if x[k] == i { return; } }",
        "if i > 3u { workgroupBarrier(); }",
        "if n > 3u { if x[i] == 0u { wait(); } }",
        "switch i { case 1u: { workgroupBarrier(); } default: {} }",
    ] {
        let message = refused(&kernel(body));
        assert!(message.contains("a barrier") && message.contains("main.wgsl:"), "{body}: {message}");
    }
    for body in [
        "x[i] = i; workgroupBarrier(); if i > 3u { return; } x[0] = x[i];",
        "if n > 3u { x[i] = i; workgroupBarrier(); }",
        "if g.x > 3u { wait(); }",
        "for (var k = 0u; k < 4u; k++) { x[i] += k; workgroupBarrier(); }",
        "if i > 3u { x[i] = i; } wait();",
    ] {
        compile_text(&kernel(body)).unwrap_or_else(|e| panic!("{body}: {e}"));
    }
}

#[test]
fn what_the_host_side_cannot_serve_is_refused_by_name() {
    for (wgsl, word) in [
        (
            "@group(1) @binding(0) var<uniform> far: vec4f; @compute @workgroup_size(1) fn main() { _ = far; }",
            "`far`",
        ),
        (
            "@group(0) @binding(0) var cube: texture_cube<f32>; @compute @workgroup_size(1) fn main() {}",
            "`cube`",
        ),
        (
            "@group(0) @binding(0) var odd: texture_storage_2d<rg32uint, write>; @compute @workgroup_size(1) fn main() {}",
            "`odd`",
        ),
        ("override n: u32 = 1u; @compute @workgroup_size(1) fn main() { _ = n; }", "override"),
    ] {
        let message = refused(wgsl);
        assert!(message.contains(word), "{message}");
    }
}

/// Vulkan wants 1.4 of them, and naga would write any version.
#[test]
fn modules_that_query_rays_are_of_spirv_1_4() {
    let kernel = |head: &str, body: &str| {
        let text = format!(
            "{head}
             struct Out {{ kind: u32 }}
             @group(0) @binding(1) var<storage, read_write> out: Out;
             @compute @workgroup_size(1) fn main() {{ {body} }}"
        );
        compile_text(&text).unwrap().shader
    };
    let queries = kernel(
        "enable wgpu_ray_query;
         @group(0) @binding(0) var world: acceleration_structure;",
        "var query: ray_query;
         rayQueryInitialize(&query, world, RayDesc(0u, 0xffu, 0.0, 1.0, vec3f(0.0), vec3f(1.0)));
         while rayQueryProceed(&query) {}
         out.kind = rayQueryGetCommittedIntersection(&query).kind;",
    );
    assert_valid(&queries, "ray queries");
    assert_eq!(queries.spirv[1], 0x1_0400);
    let world = &queries.bindings[0];
    assert_eq!((world.name, world.kind), ("world", BindingKind::AccelerationStructure));
    assert!(world.reads && !world.writes && world.min_bytes == 0);
    assert_eq!(kernel("", "out.kind = 0u;").spirv[1], 0x1_0300);
}
