//! Bindings of entry points as structs, so that a missing or misspelt one does not compile.

use super::{Written, doc, raw};
use crate::Kernel;
use cao_reflect::{Binding, BindingKind, EntryPoint, Stage, ViewDim};
use std::fmt::Write;

/// Those of all pipelines that a kernel can be part of. Entry points that touch the same bindings have one struct under several names,
/// so that a host may choose between them at run time.
pub fn all(out: &mut String, kernel: &Kernel) -> Written {
    let of = |stage| kernel.shader.entry_points.iter().filter(move |e| e.stage == stage);
    let mut pipelines = Vec::new();
    for entry in of(Stage::Compute) {
        writeln!(out, "    /// Invocations `[x, y, z]` of a workgroup of `{}`.", entry.name)?;
        let name = entry.name.to_uppercase();
        writeln!(out, "    pub const {name}_WORKGROUP: [u32; 3] = {:?};", entry.workgroup)?;
        pipelines.push((camel(entry.name), vec![entry]));
    }
    let only = of(Stage::Vertex).count() * of(Stage::Fragment).count() == 1;
    for (vertex, fragment) in of(Stage::Vertex).flat_map(|v| of(Stage::Fragment).map(move |f| (v, f))) {
        let name = if only { "Draw".into() } else { camel(vertex.name) + &camel(fragment.name) };
        pipelines.push((name, vec![vertex, fragment]));
    }
    for (i, (name, points)) in pipelines.iter().enumerate() {
        let bindings = touched(points);
        if bindings.is_empty() {
            continue;
        }
        let points: Vec<_> = points.iter().map(|point| format!("`{}`", point.name)).collect();
        writeln!(out, "    /// What {} touches.", points.join(" with "))?;
        match pipelines[..i].iter().find(|(_, other)| touched(other) == bindings) {
            Some((same, _)) => writeln!(out, "    pub type {name}Bindings<'a> = {same}Bindings<'a>;")?,
            None => one(out, kernel, name, &bindings)?,
        }
    }
    Ok(())
}

/// Indices of the bindings that a pipeline of these entry points touches.
fn touched(points: &[&EntryPoint]) -> Vec<usize> {
    let mut list: Vec<_> = points.iter().flat_map(|p| p.uses).map(|used| used.binding).collect();
    list.sort_unstable();
    list.dedup();
    list
}

fn one(out: &mut String, kernel: &Kernel, name: &str, bindings: &[usize]) -> Written {
    let list = || bindings.iter().map(|&i| (&kernel.shader.bindings[i], &kernel.binding_docs[i]));
    writeln!(out, "    #[derive(Clone, Copy)]")?;
    writeln!(out, "    pub struct {name}Bindings<'a> {{")?;
    for (binding, lines) in list() {
        doc(out, "        ", lines)?;
        writeln!(out, "        pub {}: {},", raw(binding.name), takes(binding))?;
    }
    writeln!(out, "    }}")?;
    writeln!(out, "    impl crate::gpu::Bindings for {name}Bindings<'_> {{")?;
    writeln!(out, "        fn list(&self) -> Vec<(&str, crate::gpu::Bind<'_>)> {{")?;
    writeln!(out, "            vec![")?;
    for (binding, _) in list() {
        writeln!(out, "                ({:?}, self.{}.into()),", binding.name, raw(binding.name))?;
    }
    writeln!(out, "            ]\n        }}\n    }}")
}

fn takes(binding: &Binding) -> &'static str {
    match (binding.kind, binding.image.map(|image| image.view)) {
        (BindingKind::Uniform | BindingKind::Storage, _) => "&'a crate::gpu::Buffer",
        (BindingKind::Sampler, _) => "&'a crate::gpu::Sampler",
        (BindingKind::AccelerationStructure, _) => "&'a crate::gpu::AccelerationStructure",
        // Of an image of several layers, it takes one.
        (_, Some(ViewDim::D2)) => "crate::gpu::Flat<'a>",
        _ => "&'a crate::gpu::Image",
    }
}

/// `list_bricks` → `ListBricks`
fn camel(name: &str) -> String {
    let mut out = String::new();
    for word in name.split('_') {
        let mut chars = word.chars();
        out.extend(chars.next().into_iter().flat_map(char::to_uppercase));
        out.push_str(chars.as_str());
    }
    out
}
