//! Compiles the kernels of all rooms, which `lib.rs` includes.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    cao_compile::build(".")
}
