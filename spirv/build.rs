//! Compiles `*/*.wgsl` into `$OUT_DIR/shaders.rs`, which `lib.rs` includes.
//!
//! `CAO_SHADER_DEBUG=1` keeps names in the SPIR-V, for graphics debuggers.

#![forbid(unsafe_code)]

use cao_compile as compile;
use std::{env, error::Error, fs, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=.");
    println!("cargo::rerun-if-env-changed=CAO_SHADER_DEBUG");
    let debug = env::var("CAO_SHADER_DEBUG").is_ok_and(|value| value != "0");
    let options = compile::Options { bounds: compile::Bounds::Unchecked, debug };
    match compile::folder(Path::new("."), options) {
        Ok(rust) => Ok(fs::write(Path::new(&env::var("OUT_DIR")?).join("shaders.rs"), rust)?),
        Err(errors) => {
            for line in errors.iter().flat_map(|error| error.lines()) {
                println!("cargo::error={line}");
            }
            Err(format!("{} kernels do not compile", errors.len()).into())
        }
    }
}
