//! `Layout` constants for hosts that write their structs by hand. To be removed with the last of them, and with `Layout` itself.

use super::Written;
use crate::{Kernel, What};
use std::fmt::Write;

/// One for each struct of a kernel, unless a constant of WGSL has the name.
pub fn layouts(out: &mut String, kernel: &Kernel) -> Written {
    let taken =
        |name: &str| kernel.items.iter().any(|i| matches!(&i.what, What::Constant(c) if c.name == name));
    for item in &kernel.items {
        let What::Struct(s, _) = &item.what else { continue };
        let name = constant(&s.name);
        if taken(&name) {
            continue;
        }
        let mut fields: Vec<_> =
            s.fields.iter().filter(|f| !f.padding).map(|f| (f.name.as_str(), f.offset, f.size)).collect();
        fields.extend(s.tail.iter().map(|(name, offset)| (name.as_str(), *offset, 0)));
        writeln!(out, "    /// Layout of [`{}`].", s.name)?;
        writeln!(out, "    pub const {name}: crate::gpu::shader::Layout = crate::gpu::shader::Layout {{")?;
        writeln!(out, "        name: {:?}, size: {}, fields: &{fields:?}", s.name, s.span)?;
        writeln!(out, "    }};")?;
    }
    Ok(())
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
