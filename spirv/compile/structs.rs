//! Structs in the memory that hosts share with kernels, byte for byte.

use super::types::{self, Type};
use naga::{AddressSpace, ArraySize, Handle, Module, TypeInner, proc::Layouter};
use std::collections::BTreeMap;

/// A struct without its member of run-time size, which hosts write behind it. Nothing but such a member is no struct.
#[derive(Debug, PartialEq)]
pub struct Struct {
    /// Name.
    pub name: String,
    /// In the order of memory, without gaps.
    pub fields: Vec<Field>,
    /// Bytes of all fields.
    pub size: u32,
    /// Name and offset of the member of run-time size.
    pub tail: Option<(String, u32)>,
}

/// A member or padding.
#[derive(Debug, PartialEq)]
pub struct Field {
    /// Name.
    pub name: String,
    /// Type.
    pub ty: Type,
    /// Bytes from the start of the struct.
    pub offset: u32,
    /// Bytes.
    pub size: u32,
    /// It is no member of the WGSL struct.
    pub padding: bool,
}

/// All of them, sorted by name.
pub fn structs(module: &Module) -> Result<Vec<Struct>, String> {
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).map_err(|e| e.to_string())?;
    let mut found: BTreeMap<_, Struct> = BTreeMap::new();
    for (_, variable) in module.global_variables.iter() {
        if matches!(
            variable.space,
            AddressSpace::Uniform | AddressSpace::Storage { .. } | AddressSpace::Immediate
        ) {
            visit(module, &layouter, variable.ty, &mut found)?;
        }
    }
    Ok(found.into_values().filter(|s| !s.fields.is_empty()).collect())
}

/// A type and those inside it.
fn visit(
    module: &Module,
    layouter: &Layouter,
    ty: Handle<naga::Type>,
    found: &mut BTreeMap<String, Struct>,
) -> Result<(), String> {
    match &module.types[ty].inner {
        TypeInner::Array { base, .. } => visit(module, layouter, *base, found),
        TypeInner::Struct { members, span } => {
            let name = module.types[ty].name.clone().unwrap_or_default();
            if found.contains_key(&name) {
                return Ok(());
            }
            let mut made = Struct { name: name.clone(), fields: Vec::new(), size: 0, tail: None };
            let taken: Vec<_> = members.iter().filter_map(|m| m.name.as_deref()).collect();
            for member in members {
                let field = member.name.clone().unwrap_or_default();
                made.pad_to(member.offset, &taken);
                if let TypeInner::Array { size: ArraySize::Dynamic, .. } = module.types[member.ty].inner {
                    made.tail = Some((field, member.offset));
                } else {
                    let size = layouter[member.ty].size;
                    let ty = types::in_memory(module, member.ty, size)
                        .map_err(|e| format!("struct `{name}`: `{field}`: {e}"))?;
                    made.push(field, ty, size, false);
                }
            }
            if made.tail.is_none() {
                made.pad_to(*span, &taken);
            }
            found.insert(name, made);
            members.iter().try_for_each(|member| visit(module, layouter, member.ty, found))
        }
        _ => Ok(()),
    }
}

impl Struct {
    fn push(&mut self, name: String, ty: Type, size: u32, padding: bool) {
        self.fields.push(Field { name, ty, offset: self.size, size, padding });
        self.size += size;
    }

    fn pad_to(&mut self, offset: u32, taken: &[&str]) {
        let bytes = offset - self.size;
        if bytes == 0 {
            return;
        }
        let free = |name: &String| {
            !taken.contains(&name.as_str()) && self.fields.iter().all(|field| field.name != *name)
        };
        let mut names = std::iter::once("pad".to_owned()).chain((1..).map(|i| format!("pad_{i}")));
        let name = names.find(free).unwrap_or_default();
        self.push(name, Type::Array(Box::new(Type::Number("u32")), bytes / 4), bytes, true);
    }
}
