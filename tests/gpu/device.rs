//! Finding and opening devices, what is said when that fails, and that validation really watches.

use cao_gpu::Error;
use cao_gpu::{BufferUse, Gpu, OpenOptions, Shader, shader};
use cao_testing::wgsl::{bind, compile, device_buffer, leak};
use cao_testing::{close, open, validated};
use std::process::Command;

/// Runs one ignored test of this module in a process of its own, with these variables in its environment.
fn in_environment(test: &str, variables: &[(&str, &str)]) {
    let (_executable, module) = module_path!().split_once("::").unwrap();
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", &format!("{module}::{test}")])
        .envs(variables.iter().copied())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && text.contains("1 passed"),
        "{text}{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

fn one_line(result: cao_gpu::Result<impl Sized>) -> String {
    match result.err().expect("must fail") {
        Error::Device { problem } => {
            assert_eq!(problem.lines().count(), 1, "{problem}");
            problem
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn devices_are_opened_by_index_or_name() {
    let list = Gpu::list().unwrap();
    assert!(!list.is_empty());
    for (i, info) in list.iter().enumerate() {
        assert!(
            !info.name.is_empty() && info.max_image_3d >= 256 && info.max_storage_range >= 1 << 27,
            "{info:?}"
        );
        if info.missing.is_empty() {
            let by_index = OpenOptions { device: Some(i.to_string()), ..Default::default() };
            assert_eq!(Gpu::open(&by_index).unwrap().info().name, info.name);
            let by_name = OpenOptions { device: Some(info.name.to_uppercase()), ..Default::default() };
            assert_eq!(Gpu::open(&by_name).unwrap().info().name, info.name);
        }
    }
    let message = one_line(Gpu::open(&OpenOptions { device: Some("voodoo".into()), ..Default::default() }));
    assert!(message.contains("voodoo") && message.contains(&list[0].name), "{message}");
}

#[test]
fn the_environment_names_the_device() {
    in_environment("child_is_told_voodoo", &[("CAO_DEVICE", "voodoo")]);
}

#[test]
#[ignore = "run by the_environment_names_the_device"]
fn child_is_told_voodoo() {
    assert!(one_line(Gpu::open(&OpenOptions::default())).contains("voodoo"));
}

#[test]
fn a_machine_without_driver_is_told_what_to_install() {
    in_environment(
        "child_has_no_driver",
        &[("VK_DRIVER_FILES", "/nonexistent.json"), ("VK_ICD_FILENAMES", "/nonexistent.json")],
    );
}

#[test]
#[ignore = "run by a_machine_without_driver_is_told_what_to_install"]
fn child_has_no_driver() {
    for message in [one_line(Gpu::open(&OpenOptions::default())), one_line(Gpu::list())] {
        assert!(message.contains("apt install mesa-vulkan-drivers"), "{message}");
    }
}

#[test]
fn a_machine_without_validation_layer_is_told_what_to_install() {
    in_environment("child_has_no_layer", &[("VK_LAYER_PATH", "/nonexistent"), ("CAO_VALIDATION", "1")]);
}

#[test]
#[ignore = "run by a_machine_without_validation_layer_is_told_what_to_install"]
fn child_has_no_layer() {
    let message = one_line(Gpu::open(&OpenOptions::default()));
    assert!(message.contains("apt install vulkan-validationlayers"), "{message}");
}

/// The same shader with reflection that says something else.
fn lie(truth: &'static Shader, uses: shader::Use) -> &'static Shader {
    let entry = &truth.entry_points[0];
    let entry = shader::EntryPoint { uses: Box::leak(Box::new([uses])), ..*entry };
    leak(cao_reflect::Shader { entry_points: Box::leak(Box::new([entry])), ..**truth })
}

/// The distribution's layer sees this kind of missing barrier, if its synchronization checks are on.
#[test]
fn synchronization_validation_catches_a_barrier_that_reflection_hides() {
    if !validated() {
        eprintln!("skipped: CAO_VALIDATION=0, and this is about the validation layer");
        return;
    }
    let gpu = open();
    let write = compile(
        "struct Numbers { x: array<u32> }
         @group(0) @binding(0) var<storage, read_write> b: Numbers;
         @compute @workgroup_size(1) fn main() { b.x[0] = 1u; }",
    );
    let write =
        gpu.compute(lie(write, shader::Use { binding: 0, reads: true, writes: false }), "main").unwrap();
    let (x, y) = (device_buffer(&gpu, "x", &[0; 4]), gpu.buffer("y", 16, BufferUse::Device).unwrap());
    let mut rec = gpu.recorder("race").unwrap();
    rec.dispatch(&write, &[bind("b", &x)], &[], [1; 3]).unwrap();
    rec.copy_buffer(&x, 0, &y, 0, 16).unwrap();
    rec.submit_and_wait().unwrap();
    let messages = gpu.validation_messages();
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD-READ-AFTER-WRITE") || m.contains("SYNC-HAZARD-READ_AFTER_WRITE")), "{messages:?}");
    assert!(gpu.assert_clean().unwrap_err().to_string().contains("SYNC-HAZARD"));
}

#[test]
fn core_validation_catches_a_descriptor_that_reflection_hides() {
    if !validated() {
        eprintln!("skipped: CAO_VALIDATION=0, and this is about the validation layer");
        return;
    }
    let gpu = open();
    let truth = compile(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
         @compute @workgroup_size(1) fn main() { b[0] = 1u; }",
    );
    let binding = shader::Binding { binding: 5, ..truth.bindings[0] };
    let wrong = leak(cao_reflect::Shader { bindings: Box::leak(Box::new([binding])), ..**truth });
    // The driver may take it or refuse it; the layer must speak.
    let _ = gpu.compute(wrong, "main");
    assert!(gpu.assert_clean().unwrap_err().to_string().contains("VUID"), "{:?}", gpu.validation_messages());
}

#[test]
fn everything_keeps_the_device_alive_until_it_is_dropped() {
    let gpu = open();
    let log = gpu.validation_log();
    let shader = compile(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
         @compute @workgroup_size(1) fn main() { b[0] = 1u; }",
    );
    let pipeline = gpu.compute(shader, "main").unwrap();
    let x = device_buffer(&gpu, "x", &[0; 4]);
    let mut rec = gpu.clone().recorder("last").unwrap();
    drop(gpu);
    rec.dispatch(&pipeline, &[bind("b", &x)], &[], [1; 3]).unwrap();
    drop((pipeline, x));
    rec.submit_and_wait().unwrap();
    log.assert_clean().unwrap();
}

#[test]
fn what_belongs_to_another_device_is_refused() {
    let (ours, theirs) = (open(), open());
    let shader = compile(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
         @compute @workgroup_size(1) fn main() { b[0] = 1u; }",
    );
    let pipelines = [&ours, &theirs].map(|gpu| gpu.compute(shader, "main").unwrap());
    let buffers = [&ours, &theirs].map(|gpu| device_buffer(gpu, "x", &[0; 4]));
    let mut rec = ours.recorder("test").unwrap();
    for (pipeline, buffer, fine) in [(0, 0, true), (0, 1, false), (1, 0, false), (1, 1, false)] {
        let result = rec.dispatch(&pipelines[pipeline], &[bind("b", &buffers[buffer])], &[], [1; 3]);
        assert_eq!(result.is_ok(), fine, "{result:?}");
        assert!(fine || result.unwrap_err().to_string().contains("another device"));
    }
    assert!(rec.copy_buffer(&buffers[0], 0, &buffers[1], 0, 4).is_err());
    rec.submit_and_wait().unwrap();
    drop((pipelines, buffers));
    close(ours);
    close(theirs);
}

#[test]
fn devices_can_be_opened_side_by_side_from_threads() {
    let threads: Vec<_> = (0..3)
        .map(|i| {
            std::thread::spawn(move || {
                let gpu = open();
                let x = device_buffer(&gpu, "x", &[i; 8]);
                assert_eq!(cao_testing::wgsl::read_back(&gpu, &x), [i; 8]);
                drop(x);
                close(gpu);
            })
        })
        .collect();
    threads.into_iter().for_each(|t| t.join().unwrap());
}
