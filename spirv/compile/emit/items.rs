//! Constants and structs.

use super::{Written, doc, path_of, raw};
use crate::{Item, Kernel, What, structs::Struct, types::Type};
use std::fmt::Write;

/// A declaration, for the module of its file. `kernel` is one that has it.
pub fn item(out: &mut String, kernel: &Kernel, item: &Item) -> Written {
    doc(out, "    ", &item.doc)?;
    match &item.what {
        What::Constant(c) => {
            writeln!(out, "    pub const {}: {} = {};", c.name, ty(kernel, item, &c.ty), c.value)
        }
        What::Struct(s, docs) => made(out, kernel, item, s, docs),
    }
}

impl Item {
    /// It declares the struct of this name.
    pub(super) fn names(&self, name: &str) -> bool {
        matches!(&self.what, What::Struct(s, _) if s.name == name)
    }
}

fn ty(kernel: &Kernel, within: &Item, of: &Type) -> String {
    match of {
        Type::Number(name) => (*name).into(),
        Type::Array(of, n) => format!("[{}; {n}]", ty(kernel, within, of)),
        Type::Struct(name) => path_of(kernel, name, &within.file),
    }
}

fn made(out: &mut String, kernel: &Kernel, item: &Item, s: &Struct, docs: &[Vec<String>]) -> Written {
    writeln!(out, "    #[repr(C)]")?;
    writeln!(out, "    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]")?;
    writeln!(out, "    pub struct {} {{", s.name)?;
    for (field, lines) in s.fields.iter().zip(docs) {
        doc(out, "        ", lines)?;
        writeln!(out, "        pub {}: {},", raw(&field.name), ty(kernel, item, &field.ty))?;
    }
    writeln!(out, "    }}")?;
    // True by construction, unless the emitter errs; then nothing compiles.
    writeln!(out, "    const _: () = {{")?;
    writeln!(out, "        assert!(size_of::<{}>() == {});", s.name, s.size)?;
    for field in &s.fields {
        writeln!(
            out,
            "        assert!(core::mem::offset_of!({}, {}) == {});",
            s.name,
            raw(&field.name),
            field.offset
        )?;
    }
    writeln!(out, "    }};")?;
    let Some((tail, offset)) = &s.tail else { return Ok(()) };
    writeln!(out, "    impl {} {{", s.name)?;
    writeln!(out, "        /// Bytes before `{tail}`, whose length only the buffer decides.")?;
    writeln!(out, "        pub const {}_AT: u64 = {offset};", tail.to_uppercase())?;
    writeln!(out, "    }}")
}
