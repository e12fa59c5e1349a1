//! Values of module-scope constants.
//!
//! naga evaluates constants, but its WGSL front end drops those of abstract type (`const CHUNK = 8;`) from the module. A second module,
//! in which each constant initializes a variable, has them all, of the types that WGSL gives them where nothing else decides: `i32`, `f32`.

use super::{
    diagnose,
    include::Source,
    notes::{Note, Notes},
    types::{self, Type},
};
use naga::{ArraySize, Expression, Handle, Literal, Module, ScalarKind, TypeInner, proc::flatten_compose};
use std::fmt::Write;

/// A constant of a type that hosts have too.
#[derive(Debug, PartialEq)]
pub struct Constant {
    /// Name.
    pub name: String,
    /// Type.
    pub ty: Type,
    /// Its value, in Rust.
    pub value: String,
}

/// Begins the names of the variables.
const PROBE: &str = "cao_value_of_";

/// The constants with their declarations. `module` is naga's of the same source: what it knows must have been found.
pub fn constants<'a>(
    source: &Source,
    notes: &'a Notes,
    module: &Module,
) -> Result<Vec<(&'a Note, Constant)>, String> {
    let declared = || notes.0.iter().filter(|note| note.constant);
    for name in module.constants.iter().filter_map(|(_, constant)| constant.name.as_ref()) {
        if !declared().any(|note| note.name == *name) {
            return Err(format!("constant `{name}`: its line must begin with `const `"));
        }
    }
    let mut text = source.text.clone();
    for note in declared() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "var<private> {PROBE}{0} = {0};", note.name);
    }
    let probe = naga::front::wgsl::parse_str(&text).map_err(|e| diagnose::parse(source, &e))?;
    let mut found = Vec::new();
    for note in declared() {
        let wanted = format!("{PROBE}{}", note.name);
        let variable = probe.global_variables.iter().find(|(_, v)| v.name.as_ref() == Some(&wanted));
        let Some((variable, init)) = variable.and_then(|(_, v)| Some((v, v.init?))) else {
            return Err(format!("constant `{}`: naga has not evaluated it", note.name));
        };
        // Structs and the like stay the kernel's own.
        if let Some(ty) = types::of_constant(&probe, variable.ty) {
            let value =
                value(&probe, init).ok_or_else(|| format!("constant `{}`: not a value", note.name))?;
            found.push((note, Constant { name: note.name.clone(), ty, value }));
        }
    }
    Ok(found)
}

/// In Rust. `None` for what naga should have evaluated.
fn value(module: &Module, expression: Handle<Expression>) -> Option<String> {
    Some(match &module.global_expressions[expression] {
        Expression::Literal(literal) => match literal {
            Literal::U32(x) => x.to_string(),
            Literal::I32(x) => x.to_string(),
            Literal::F32(x) => format!("{x:?}"),
            Literal::Bool(x) => x.to_string(),
            _ => return None,
        },
        Expression::Constant(constant) => value(module, module.constants[*constant].init)?,
        Expression::ZeroValue(ty) => zero(module, *ty)?,
        Expression::Splat { size, value: of } => {
            format!("[{}; {}]", value(module, *of)?, *size as usize)
        }
        Expression::Compose { ty, components } => {
            // A vector may be composed of shorter ones.
            let flat = flatten_compose(*ty, components, &module.global_expressions, &module.types);
            let list: Option<Vec<_>> = flat.map(|part| value(module, part)).collect();
            format!("[{}]", list?.join(", "))
        }
        _ => return None,
    })
}

fn zero(module: &Module, ty: Handle<naga::Type>) -> Option<String> {
    let scalar = |kind| match kind {
        ScalarKind::Bool => "false",
        ScalarKind::Float => "0.0",
        _ => "0",
    };
    Some(match module.types[ty].inner {
        TypeInner::Scalar(s) => scalar(s.kind).into(),
        TypeInner::Vector { size, scalar: s } => format!("[{}; {}]", scalar(s.kind), size as usize),
        TypeInner::Matrix { columns, rows, scalar: s } => {
            format!("[[{}; {}]; {}]", scalar(s.kind), rows as usize, columns as usize)
        }
        TypeInner::Array { base, size: ArraySize::Constant(n), .. } => {
            format!("[{}; {n}]", zero(module, base)?)
        }
        _ => return None,
    })
}
