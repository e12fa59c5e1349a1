//! What naga does not keep of a source: where constants, structs, members and bindings are declared, and the comments above them.
//! Relies on the way these files are written: one declaration a line.

use super::Source;
use std::path::PathBuf;

/// One declaration.
#[derive(Debug)]
pub struct Note {
    /// The struct that it is a member of.
    pub within: Option<String>,
    /// Its name.
    pub name: String,
    /// It is a `const`.
    pub constant: bool,
    /// The file that it is in.
    pub file: PathBuf,
    /// Line from 1 in the file.
    pub line: usize,
    /// The comment lines directly above it, or else the declaration itself.
    pub doc: Vec<String>,
}

/// All declarations of a source.
#[derive(Debug)]
pub struct Notes(pub Vec<Note>);

impl Notes {
    /// Reads them.
    pub fn read(source: &Source) -> Self {
        let mut notes = Vec::new();
        let mut comment: Vec<String> = Vec::new();
        let (mut depth, mut within, mut before) = (0_usize, None, None);
        for (i, line) in source.text.lines().enumerate() {
            let Some((file, number)) = source.origin(i + 1) else { continue };
            // A comment at the end of a file is not about what follows in another.
            if before.replace(file) != Some(file) {
                comment.clear();
            }
            let line = line.trim();
            if let Some(text) = line.strip_prefix("//") {
                comment.push(text.trim().to_owned());
                continue;
            }
            let code = line.split("//").next().unwrap_or_default().trim();
            let name = match (depth, &within) {
                (0, _) => at_module_scope(code),
                (1, Some(_)) => before_colon(code),
                _ => None,
            };
            if let Some(name) = name {
                notes.push(Note {
                    within: within.clone().filter(|_| depth == 1),
                    name: name.to_owned(),
                    constant: code.starts_with("const "),
                    file: file.to_owned(),
                    line: number,
                    doc: if comment.is_empty() { vec![itself(code)] } else { std::mem::take(&mut comment) },
                });
            }
            comment.clear();
            if depth == 0 {
                within = code.strip_prefix("struct ").and(name).map(str::to_owned);
            }
            depth = (depth + code.matches('{').count()).saturating_sub(code.matches('}').count());
        }
        Self(notes)
    }

    /// The declaration of this name at module scope, or of this member.
    pub fn find(&self, within: Option<&str>, name: &str) -> Option<&Note> {
        self.0.iter().find(|note| note.within.as_deref() == within && note.name == name)
    }

    /// The text for a declaration.
    pub fn doc(&self, within: Option<&str>, name: &str) -> Vec<String> {
        self.find(within, name).map_or_else(|| vec![format!("`{name}`.")], |note| note.doc.clone())
    }
}

fn at_module_scope(code: &str) -> Option<&str> {
    if let Some(rest) = code.strip_prefix("const ").or_else(|| code.strip_prefix("struct ")) {
        return rest.trim().split([':', '=', '{', ' ']).next();
    }
    if code.contains("var<") || code.contains("var ") { before_colon(code) } else { None }
}

/// `@size(16) dims: vec3<u32>,` → `dims`
fn before_colon(code: &str) -> Option<&str> {
    code.split_once(':')?.0.split_whitespace().next_back()
}

/// A declaration as its own description, without the numbers of its binding.
fn itself(code: &str) -> String {
    let code = code
        .split_once("var")
        .filter(|_| code.starts_with('@'))
        .map_or(code, |(attributes, _)| &code[attributes.len()..]);
    format!("`{}`", code.trim_end_matches(['{', ',', ';', ' ']))
}
