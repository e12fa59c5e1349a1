//! Acceleration structures and ray queries: what is built is what is hit, wrong use is refused, nothing leaks.

use cao_gpu::{Bind, Buffer, BufferUse, Corners, Gpu, Shader};
use cao_testing::wgsl::{bind, compile, device_buffer, read_back};
use cao_testing::{close, open};

/// Looks along +z from above each of four places; writes number, way and weights of what is hit first, of no triangle 9 and way 8.
const LOOK: &str = "
    enable wgpu_ray_query;
    struct Found { number: u32, way: f32, weights: vec2f }
    struct All { found: array<Found, 4> }
    var<immediate> refused: u32;
    @group(0) @binding(0) var world: acceleration_structure;
    @group(0) @binding(1) var<storage, read_write> out: All;
    @compute @workgroup_size(4) fn main(@builtin(local_invocation_index) i: u32) {
        var query: ray_query;
        let origin = vec3f(0.25 + f32(i), 0.5, -1.0);
        rayQueryInitialize(&query, world, RayDesc(RAY_FLAG_NONE, 0xffu, 0.0, 8.0, origin, vec3f(0.0, 0.0, 1.0)));
        while rayQueryProceed(&query) {
            if rayQueryGetCandidateIntersection(&query).primitive_index != refused { rayQueryConfirmIntersection(&query); }
        }
        let hit = rayQueryGetCommittedIntersection(&query);
        out.found[i] = Found(9u, 8.0, vec2f(0.0));
        if hit.kind == RAY_QUERY_INTERSECTION_TRIANGLE {
            out.found[i] = Found(hit.primitive_index, hit.t, hit.barycentrics);
        }
    }";

/// Over the squares from x = 0 and 1 a triangle each at z = 1 and 3, over that from 0 another behind at 4, of the other side; nothing over the
/// other squares.
fn corners(gpu: &Gpu) -> Buffer {
    let triangle = |x: f32, z: f32| [[x, 0.0, z, 7.0], [x + 1.0, 0.0, z, 7.0], [x, 1.0, z, 7.0]];
    let mut behind = triangle(0.0, 4.0);
    behind.swap(1, 2);
    let places = [triangle(0.0, 1.0), triangle(1.0, 3.0), behind];
    device_buffer(gpu, "corners", bytemuck::cast_slice(places.as_flattened().as_flattened()))
}

fn look(gpu: &Gpu, shader: &'static Shader, world: Bind<'_>, refused: u32) -> cao_gpu::Result<Vec<[f32; 4]>> {
    let pipeline = gpu.compute(shader, "main")?;
    let out = device_buffer(gpu, "out", &[0; 16]);
    let mut rec = gpu.recorder("look")?;
    rec.dispatch(&pipeline, &[("world", world), bind("out", &out)], &refused.to_ne_bytes(), [1; 3])?;
    rec.submit_and_wait()?;
    let found = read_back(gpu, &out);
    Ok(found
        .chunks(4)
        .map(|f| [f[0] as f32, f32::from_bits(f[1]), f32::from_bits(f[2]), f32::from_bits(f[3])])
        .collect())
}

#[test]
fn rays_hit_what_was_built_and_what_kernels_confirm() {
    let gpu = open();
    if !gpu.ray_queries() {
        eprintln!("skipped: this device has no ray queries");
        return close(gpu);
    }
    let buffer = corners(&gpu);
    let made = Corners { buffer: &buffer, stride: 16, triangles: 3 };
    let world = gpu.acceleration_structure("world", made).unwrap();
    let names: Vec<String> = gpu.memory_report().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["corners", "world: instances", "world: triangles"], "scratch memory is freed");
    // It is a copy.
    drop(buffer);
    let shader = compile(LOOK);
    let nothing = [9.0, 8.0, 0.0, 0.0];
    let first = [0.0, 2.0, 0.25, 0.5];
    let second = [1.0, 4.0, 0.25, 0.5];
    assert_eq!(look(&gpu, shader, (&world).into(), 9).unwrap(), [first, second, nothing, nothing]);
    // Its corners are the other way round.
    let behind = [2.0, 5.0, 0.5, 0.25];
    assert_eq!(look(&gpu, shader, (&world).into(), 0).unwrap(), [behind, second, nothing, nothing]);
    assert_eq!(look(&gpu, shader, (&world).into(), 1).unwrap(), [first, nothing, nothing, nothing]);
    // A clone keeps it.
    let other = world.clone();
    drop(world);
    assert_eq!(look(&gpu, shader, (&other).into(), 9).unwrap()[0], first);
    drop(other);
    close(gpu);
}

#[test]
fn wrong_use_is_refused() {
    let gpu = open();
    let buffer = corners(&gpu);
    let made = Corners { buffer: &buffer, stride: 16, triangles: 3 };
    let shader = compile(LOOK);
    if !gpu.ray_queries() {
        let refused = gpu.acceleration_structure("world", made).map(drop).unwrap_err().to_string();
        assert!(refused.contains("Gpu::ray_queries"), "{refused}");
        let refused = gpu.compute(shader, "main").map(drop).unwrap_err().to_string();
        assert!(refused.contains("`world`") && refused.contains("Gpu::ray_queries"), "{refused}");
        drop(buffer);
        return close(gpu);
    }
    let upload = gpu.buffer("upload", 144, BufferUse::Upload).unwrap();
    for (wrong, word) in [
        (Corners { triangles: 0, ..made }, "at least one"),
        (Corners { triangles: 4, ..made }, "outside"),
        (Corners { stride: 8, ..made }, "8 bytes"),
        (Corners { stride: 18, ..made }, "multiple of 4"),
        (Corners { buffer: &upload, ..made }, "Device"),
    ] {
        let refused = gpu.acceleration_structure("world", wrong).map(drop).unwrap_err().to_string();
        assert!(refused.contains(word), "{word}: {refused}");
    }
    let world = gpu.acceleration_structure("world", made).unwrap();
    let refused = look(&gpu, shader, (&buffer).into(), 9).unwrap_err().to_string();
    assert!(refused.contains("AccelerationStructure") && refused.contains("buffer corners"), "{refused}");
    let twice = compile(
        "struct Numbers { x: array<u32> }
         @group(0) @binding(0) var<storage, read_write> a: Numbers;
         @compute @workgroup_size(1) fn main() { a.x[0] = 1u; }",
    );
    let pipeline = gpu.compute(twice, "main").unwrap();
    let mut rec = gpu.recorder("test").unwrap();
    let refused = rec.dispatch(&pipeline, &[("a", (&world).into())], &[], [1; 3]).unwrap_err().to_string();
    assert!(refused.contains("acceleration structure world"), "{refused}");
    drop(rec);
    // What belongs to another device.
    let other = open();
    let refused = look(&other, shader, (&world).into(), 9).unwrap_err().to_string();
    assert!(refused.contains("another device"), "{refused}");
    close(other);
    drop((upload, buffer, world, pipeline));
    close(gpu);
}
