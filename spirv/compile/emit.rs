//! Writes reflected shaders as Rust constants of the types in `src/gpu/shader.rs`.

use super::reflect::{Binding, EntryPoint, Layout, Shader};
use std::fmt::Write;

/// One module for each shader. Nothing but the shaders decides the text, so equal sources give equal files.
pub fn rust(shaders: &[Shader]) -> String {
    let mut out = String::new();
    for shader in shaders {
        // Writing to a string cannot fail.
        let _ = module(&mut out, shader);
    }
    out
}

fn module(out: &mut String, shader: &Shader) -> std::fmt::Result {
    writeln!(out, "/// Compiled from `spirv/{}.wgsl`.", shader.name)?;
    writeln!(out, "pub mod {} {{", shader.name)?;
    writeln!(out, "    use cao_gpu::{{Format, shader::*}};")?;
    writeln!(out, "    /// Code, entry points and bindings.")?;
    writeln!(out, "    pub static SHADER: Shader = Shader {{")?;
    writeln!(out, "        name: {:?},", shader.name)?;
    writeln!(out, "        spirv: &[")?;
    for words in shader.spirv.chunks(12) {
        let words: Vec<_> = words.iter().map(|w| format!("{w:#x}")).collect();
        writeln!(out, "            {},", words.join(", "))?;
    }
    writeln!(out, "        ],")?;
    writeln!(out, "        entry_points: &[")?;
    shader.entry_points.iter().try_for_each(|e| entry_point(out, e))?;
    writeln!(out, "        ],")?;
    writeln!(out, "        bindings: &[")?;
    shader.bindings.iter().try_for_each(|b| binding(out, b))?;
    writeln!(out, "        ],")?;
    writeln!(out, "        push_bytes: {},", shader.push_bytes)?;
    writeln!(out, "    }};")?;
    // Without bindings or entry points some of the names stay unused.
    writeln!(out, "    const _: Option<(Format, Layout)> = None;")?;
    shader.layouts.iter().try_for_each(|l| layout(out, l))?;
    writeln!(out, "}}")
}

fn entry_point(out: &mut String, entry: &EntryPoint) -> std::fmt::Result {
    writeln!(
        out,
        "            EntryPoint {{ name: {:?}, stage: Stage::{}, workgroup: {:?}, push_bytes: {}, uses: &[",
        entry.name, entry.stage, entry.workgroup, entry.push_bytes
    )?;
    for used in &entry.uses {
        writeln!(out, "                {used:?},")?;
    }
    writeln!(out, "            ] }},")
}

fn binding(out: &mut String, b: &Binding) -> std::fmt::Result {
    let image = b.image.map_or("None".into(), |i| {
        let format = i.format.map_or("None".into(), |f| format!("Some(Format::{f})"));
        format!(
            "Some(ImageBinding {{ view: ViewDim::{}, texel: Texel::{}, format: {format} }})",
            i.view, i.texel
        )
    });
    writeln!(
        out,
        "            Binding {{ name: {:?}, group: {}, binding: {}, kind: BindingKind::{:?}, image: {image}, reads: {}, writes: {} }},",
        b.name, b.group, b.binding, b.kind, b.reads, b.writes
    )
}

fn layout(out: &mut String, layout: &Layout) -> std::fmt::Result {
    writeln!(out, "    /// Layout of `{}`.", layout.name)?;
    writeln!(
        out,
        "    pub const {}: Layout = Layout {{ name: {:?}, size: {}, fields: &{:?} }};",
        constant(&layout.name),
        layout.name,
        layout.size,
        layout.fields
    )
}

/// `LaoParams` → `LAO_PARAMS`.
fn constant(name: &str) -> String {
    let mut out = String::new();
    let mut previous_lower = false;
    for c in name.chars() {
        if c.is_uppercase() && previous_lower {
            out.push('_');
        }
        previous_lower = c.is_lowercase() || c.is_ascii_digit();
        out.extend(c.to_uppercase());
    }
    out
}
