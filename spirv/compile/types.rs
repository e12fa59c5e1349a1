//! WGSL types in Rust. In memory everything is made of 32-bit numbers, so a Rust struct has padding only where it is written.

use naga::{ArraySize, Handle, Module, Scalar, ScalarKind, TypeInner};

/// A type that hosts have too.
#[derive(Debug, Clone, PartialEq)]
pub enum Type {
    /// `u32`, `i32`, `f32`; as a constant also `bool`.
    Number(&'static str),
    /// Vectors, and matrices as arrays of columns, too.
    Array(Box<Type>, u32),
    /// A struct of this name.
    Struct(String),
}

fn number(scalar: Scalar) -> Option<Type> {
    Some(Type::Number(match scalar {
        Scalar::U32 => "u32",
        Scalar::I32 => "i32",
        Scalar::F32 => "f32",
        Scalar { kind: ScalarKind::Bool, .. } => "bool",
        _ => return None,
    }))
}

fn array(of: Type, n: u32) -> Type {
    Type::Array(Box::new(of), n)
}

/// As a value, without regard to layout. `None` for structs and what hosts do not have.
pub fn of_constant(module: &Module, ty: Handle<naga::Type>) -> Option<Type> {
    match module.types[ty].inner {
        TypeInner::Scalar(scalar) => number(scalar),
        TypeInner::Vector { size, scalar } => Some(array(number(scalar)?, size as u32)),
        TypeInner::Matrix { columns, rows, scalar } => {
            Some(array(array(number(scalar)?, rows as u32), columns as u32))
        }
        TypeInner::Array { base, size: ArraySize::Constant(n), .. } => {
            Some(array(of_constant(module, base)?, n.get()))
        }
        _ => None,
    }
}

/// As it lies in memory, in a place of `bytes`: an element of an array, or a member without what follows it.
pub fn in_memory(module: &Module, ty: Handle<naga::Type>, bytes: u32) -> Result<Type, String> {
    let inner = &module.types[ty].inner;
    let made = match *inner {
        TypeInner::Scalar(scalar) | TypeInner::Atomic(scalar) => number(scalar),
        // In a larger place, as vec3 in arrays, the surplus is one more component.
        TypeInner::Vector { scalar, .. } => number(scalar).map(|n| array(n, bytes / 4)),
        TypeInner::Matrix { columns, scalar, .. } => {
            number(scalar).map(|n| array(array(n, bytes / 4 / columns as u32), columns as u32))
        }
        TypeInner::Array { base, size: ArraySize::Constant(n), stride } => {
            Some(array(in_memory(module, base, stride)?, n.get()))
        }
        TypeInner::Struct { .. } => Some(Type::Struct(module.types[ty].name.clone().unwrap_or_default())),
        _ => None,
    };
    made.ok_or_else(|| format!("{inner:?} has no counterpart in hosts"))
}
