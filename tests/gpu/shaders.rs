//! The compiled shaders on the device: all of them become pipelines, and the bounds-checked build does check.

use cao_compile::{Bounds, Options, file, files};
use cao_gpu::shader::{BindingKind, Stage};
use cao_testing::wgsl::{bind, compile_with, device_buffer, leak, read_back};
use cao_testing::{close, open, source};

const BOTH: [Options; 2] =
    [Options { bounds: Bounds::Unchecked, debug: false }, Options { bounds: Bounds::Checked, debug: false }];

#[test]
fn every_compute_entry_point_becomes_a_pipeline_with_and_without_bounds_checks() {
    let gpu = open();
    let root = source("spirv");
    let kernels = files(&root).unwrap();
    assert!(kernels.len() > 10, "{}: {} kernels", root.display(), kernels.len());
    for path in kernels {
        for options in BOTH {
            let shader = leak(file(&root, &path, options).unwrap_or_else(|e| panic!("{e}")).shader);
            if shader.bindings.iter().any(|b| b.kind == BindingKind::AccelerationStructure)
                && !gpu.ray_queries()
            {
                eprintln!("skipped: {}, this device has no ray queries", shader.name);
                continue;
            }
            for entry in shader.entry_points.iter().filter(|e| e.stage == Stage::Compute) {
                gpu.compute(shader, entry.name).unwrap();
                gpu.assert_clean()
                    .unwrap_or_else(|e| panic!("{}.{} {options:?}: {e}", shader.name, entry.name));
            }
        }
    }
    close(gpu);
}

/// Both builds agree on a kernel that stays inside; only the checked one may be trusted with one that does not.
#[test]
fn the_checked_build_reads_zero_and_drops_writes_outside() {
    let gpu = open();
    let wgsl = "
        struct Numbers { x: array<u32> }
        var<immediate> at: u32;
        @group(0) @binding(0) var<storage, read> a: Numbers;
        @group(0) @binding(1) var<storage, read_write> b: Numbers;
        @compute @workgroup_size(1) fn main() { b.x[0] = a.x[at] + 1u; b.x[at] = 7u; }";
    let run = |options, at: u32| {
        let pipeline = gpu.compute(compile_with(wgsl, options), "main").unwrap();
        let (a, b) = (device_buffer(&gpu, "a", &[5, 5, 5, 5]), device_buffer(&gpu, "b", &[9; 4]));
        let mut rec = gpu.recorder("test").unwrap();
        rec.dispatch(&pipeline, &[bind("a", &a), bind("b", &b)], &at.to_ne_bytes(), [1; 3]).unwrap();
        rec.submit_and_wait().unwrap();
        read_back(&gpu, &b)
    };
    for options in BOTH {
        assert_eq!(run(options, 2), [6, 9, 7, 9], "{options:?}");
    }
    assert_eq!(run(BOTH[1], 100), [1, 9, 9, 9]);
    close(gpu);
}
