//! What is known about a shader, as a static.

use super::Written;
use cao_reflect::{Binding, EntryPoint, Shader};
use std::fmt::Write;

/// `SHADER`.
pub fn shader(out: &mut String, shader: &Shader) -> Written {
    writeln!(out, "    /// Code, entry points and bindings.")?;
    writeln!(out, "    #[allow(unsafe_code, reason = \"the build keeps the promise of `Shader::new`\")]")?;
    writeln!(out, "    pub static SHADER: crate::gpu::Shader = {{")?;
    writeln!(out, "        use cao_reflect::*;")?;
    writeln!(out, "        // SAFETY: code and reflection are of one module that naga validated.")?;
    writeln!(out, "        unsafe {{ crate::gpu::Shader::new(Shader {{")?;
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
    writeln!(out, "        }}) }}\n    }};")
}

fn entry_point(out: &mut String, entry: &EntryPoint) -> Written {
    writeln!(
        out,
        "            EntryPoint {{ name: {:?}, stage: Stage::{:?}, workgroup: {:?}, push_bytes: {}, uses: &[",
        entry.name, entry.stage, entry.workgroup, entry.push_bytes
    )?;
    for used in entry.uses {
        writeln!(out, "                {used:?},")?;
    }
    writeln!(out, "            ] }},")
}

fn binding(out: &mut String, b: &Binding) -> Written {
    let image = b.image.map_or("None".into(), |i| {
        let format = i.format.map_or("None".into(), |f| format!("Some(Format::{f:?})"));
        format!(
            "Some(ImageBinding {{ view: ViewDim::{:?}, texel: Texel::{:?}, format: {format} }})",
            i.view, i.texel
        )
    });
    writeln!(
        out,
        "            Binding {{ name: {:?}, group: {}, binding: {}, kind: BindingKind::{:?}, min_bytes: {}, image: {image}, reads: {}, writes: {} }},",
        b.name, b.group, b.binding, b.kind, b.min_bytes, b.reads, b.writes
    )
}
