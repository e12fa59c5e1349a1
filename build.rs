//! Compiles `spirv/`, which `src/gpu/mod.rs` includes.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    cao_compile::build("spirv")
}
