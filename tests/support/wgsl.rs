//! WGSL compiled on the spot, and buffers of numbers for it.

use cao_compile as compile;
use cao_compile::{Bounds, Options, reflect};
use cao_gpu::{Bind, Buffer, BufferUse, Format, Gpu, Shader, shader};

/// Compiles WGSL as the build does.
pub fn compile(wgsl: &str) -> &'static Shader {
    compile_with(wgsl, Options { bounds: Bounds::Unchecked, debug: false })
}

/// Compiles WGSL.
pub fn compile_with(wgsl: &str, options: Options) -> &'static Shader {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.wgsl");
    std::fs::write(&path, wgsl).unwrap();
    leak(compile::file(&path, options).unwrap_or_else(|e| panic!("{e}")))
}

fn leaked<T>(list: Vec<T>) -> &'static [T] {
    list.leak()
}

/// The form that the library takes; its memory is never freed, as that of a built-in shader.
pub fn leak(s: reflect::Shader) -> &'static Shader {
    let uses = |list: Vec<reflect::Use>| {
        leaked(
            list.into_iter()
                .map(|u| shader::Use { binding: u.binding, reads: u.reads, writes: u.writes })
                .collect(),
        )
    };
    let entry_points = s.entry_points.into_iter().map(|e| shader::EntryPoint {
        name: e.name.leak(),
        stage: match e.stage {
            "Compute" => shader::Stage::Compute,
            "Vertex" => shader::Stage::Vertex,
            _ => shader::Stage::Fragment,
        },
        workgroup: e.workgroup,
        uses: uses(e.uses),
        push_bytes: e.push_bytes,
    });
    let bindings = s.bindings.into_iter().map(|b| shader::Binding {
        name: b.name.leak(),
        group: b.group,
        binding: b.binding,
        kind: match b.kind {
            reflect::BindingKind::Uniform => shader::BindingKind::Uniform,
            reflect::BindingKind::Storage => shader::BindingKind::Storage,
            reflect::BindingKind::Sampled => shader::BindingKind::Sampled,
            reflect::BindingKind::StorageImage => shader::BindingKind::StorageImage,
            reflect::BindingKind::Sampler => shader::BindingKind::Sampler,
        },
        image: b.image.map(|i| shader::ImageBinding {
            view: match i.view {
                "D2" => shader::ViewDim::D2,
                "D2Array" => shader::ViewDim::D2Array,
                _ => shader::ViewDim::D3,
            },
            texel: match i.texel {
                "Float" => shader::Texel::Float,
                "Uint" => shader::Texel::Uint,
                "Sint" => shader::Texel::Sint,
                _ => shader::Texel::Depth,
            },
            format: i.format.map(format),
        }),
        reads: b.reads,
        writes: b.writes,
    });
    Box::leak(Box::new(Shader {
        name: s.name.leak(),
        entry_points: leaked(entry_points.collect()),
        bindings: leaked(bindings.collect()),
        spirv: leaked(s.spirv),
        push_bytes: s.push_bytes,
    }))
}

fn format(name: &str) -> Format {
    use Format::*;
    [
        R8Unorm,
        R8Uint,
        R16Unorm,
        R16Float,
        R32Float,
        R32Uint,
        Rg32Float,
        Rgba8Unorm,
        Rgba16Float,
        Rgba32Float,
        D32Float,
    ]
    .into_iter()
    .find(|f| format!("{f:?}") == name)
    .unwrap_or_else(|| panic!("unknown format {name}"))
}

/// A device buffer with these numbers in it.
pub fn device_buffer(gpu: &Gpu, name: &str, data: &[u32]) -> Buffer {
    let buffer = gpu.buffer(name, 4 * data.len() as u64, BufferUse::Device).unwrap();
    let mut rec = gpu.recorder("upload").unwrap();
    rec.update(&buffer, 0, bytemuck::cast_slice(data)).unwrap();
    rec.submit_and_wait().unwrap();
    buffer
}

/// All numbers of a device buffer.
pub fn read_back(gpu: &Gpu, buffer: &Buffer) -> Vec<u32> {
    let back = gpu.buffer("read back", buffer.bytes(), BufferUse::Readback).unwrap();
    let mut rec = gpu.recorder("read back").unwrap();
    rec.copy_buffer(buffer, 0, &back, 0, buffer.bytes()).unwrap();
    rec.submit_and_wait().unwrap();
    bytemuck::pod_collect_to_vec(&back.read(0, back.bytes()).unwrap())
}

/// Shorthand.
pub fn bind<'a>(name: &'a str, buffer: &'a Buffer) -> (&'a str, Bind<'a>) {
    (name, Bind::Buffer(buffer))
}
