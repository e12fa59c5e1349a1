//! The Rust of all kernels, to be included where `crate::gpu` is the Vulkan layer, and `cao_reflect` and `bytemuck` are at hand.
//!
//! * `pub mod <stem>` for each kernel: `SHADER`; its constants and its structs; for each compute entry point the size of its
//!   workgroups and, where it touches any, its bindings; the same for each pair of a vertex and a fragment entry point.
//! * `pub mod shared`, with a module for each included file, whose declarations the kernels re-export.
//!
//! Comments become documentation. Nothing but the sources decides the text, so equal sources give equal files.

mod bindings;
mod items;
mod shader;

use super::{Item, Kernel, stem};
use std::{
    collections::BTreeMap,
    fmt::{Result as Written, Write},
    path::{Path, PathBuf},
};

/// An included file's declarations, and who had them first.
struct Included<'a> {
    path: &'a Path,
    /// By line: a kernel has only the structs that it uses.
    items: BTreeMap<usize, (&'a Item, &'a Kernel)>,
}

/// All modules. Fails where an included file is not the same to all.
pub fn rust(kernels: &[Kernel]) -> Result<String, String> {
    let shared = shared(kernels)?;
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = kernels.iter().try_for_each(|kernel| module(&mut out, kernel));
    let _ = includes(&mut out, &shared);
    Ok(out)
}

fn shared(kernels: &[Kernel]) -> Result<BTreeMap<&str, Included<'_>>, String> {
    let mut shared = BTreeMap::new();
    for kernel in kernels {
        for path in &kernel.files[1..] {
            let file = shared.entry(stem(path)?).or_insert_with(|| Included { path, items: BTreeMap::new() });
            if file.path != path {
                return Err(format!(
                    "error: {} and {}: two included files of one name, which names their module",
                    file.path.display(),
                    path.display()
                ));
            }
            for item in kernel.items.iter().filter(|item| item.file == *path) {
                let (first, other) = file.items.entry(item.line).or_insert((item, kernel));
                if *first != item {
                    return Err(format!(
                        "error: {}:{}: is not the same in {} and in {}",
                        path.display(),
                        item.line,
                        other.files[0].display(),
                        kernel.files[0].display()
                    ));
                }
            }
        }
    }
    Ok(shared)
}

fn module(out: &mut String, kernel: &Kernel) -> Written {
    let own = &kernel.files[0];
    writeln!(out, "/// Kernel `{}`.", name(own))?;
    writeln!(out, "pub mod {} {{", kernel.shader.name)?;
    for path in kernel.files[1..].iter().filter(|path| kernel.items.iter().any(|item| item.file == **path)) {
        writeln!(out, "    pub use super::shared::{}::*;", stem(path).unwrap_or_default())?;
    }
    shader::shader(out, &kernel.shader)?;
    kernel.items.iter().filter(|item| item.file == *own).try_for_each(|i| items::item(out, kernel, i))?;
    bindings::all(out, kernel)?;
    writeln!(out, "}}")
}

fn includes(out: &mut String, shared: &BTreeMap<&str, Included<'_>>) -> Written {
    if shared.values().all(|file| file.items.is_empty()) {
        return Ok(());
    }
    writeln!(out, "/// What kernels include.\npub mod shared {{")?;
    for (stem, file) in shared.iter().filter(|(_, file)| !file.items.is_empty()) {
        writeln!(out, "/// Included file `{}`.", name(file.path))?;
        writeln!(out, "pub mod {stem} {{")?;
        file.items.values().try_for_each(|(item, kernel)| items::item(out, kernel, item))?;
        writeln!(out, "}}")?;
    }
    writeln!(out, "}}")
}

fn name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Where a struct is seen from the module of `from`.
fn path_of(kernel: &Kernel, of: &str, from: &PathBuf) -> String {
    let declared = kernel.items.iter().find(|item| item.names(of)).map(|item| &item.file);
    match declared {
        Some(file) if file != from && *from != kernel.files[0] => {
            format!("super::{}::{of}", stem(file).unwrap_or_default())
        }
        _ => of.into(),
    }
}

/// Lines of documentation. What Markdown would take for links or tags is meant as it stands.
fn doc(out: &mut String, indent: &str, lines: &[String]) -> Written {
    let mut code = false;
    for line in lines {
        let mut text = String::new();
        for c in line.chars() {
            code ^= c == '`';
            if !code && "[]<*".contains(c) {
                text.push('\\');
            }
            text.push(c);
        }
        writeln!(out, "{indent}/// {text}")?;
    }
    Ok(())
}

/// A name as Rust takes it: these are its keywords that WGSL leaves free.
fn raw(name: &str) -> String {
    if ["box", "gen", "in"].contains(&name) { format!("r#{name}") } else { name.into() }
}
