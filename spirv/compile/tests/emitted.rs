//! The emitted text of the kernels in `kernels/` is `kernels/emitted.rs`, kept so that its form can be read, and so that `tests/shaders.rs`
//! of the workspace can compile it beside a Vulkan layer and look at what it means. `CAO_BLESS=1` writes it anew.

use cao_compile::{Bounds, Options, emit, file, files};
use std::{env, fs, path::Path};

#[test]
fn the_emitted_rust_is_what_was_agreed_on() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/kernels");
    let options = Options { bounds: Bounds::Unchecked, debug: false };
    let kernels: Vec<_> = files(&root)
        .unwrap()
        .iter()
        .map(|path| {
            let mut kernel = file(&root, path, options).unwrap_or_else(|e| panic!("{e}"));
            // Code is naga's.
            kernel.shader.spirv = &[];
            kernel
        })
        .collect();
    assert_eq!(kernels.len(), 2);
    let text = emit::rust(&kernels).unwrap();
    let kept = root.join("emitted.rs");
    if env::var_os("CAO_BLESS").is_some() {
        fs::write(&kept, &text).unwrap();
    }
    assert_eq!(text, fs::read_to_string(kept).unwrap(), "CAO_BLESS=1 writes it anew");
}
