//! `#include "shared/x.wgsl"` lines, replaced by the file's text; remembers which line came from where.

use std::path::{Path, PathBuf};

/// A source with its includes in place.
#[derive(Debug)]
pub struct Source {
    /// The whole text.
    pub text: String,
    /// The file itself, then what it includes, in the order in which they begin.
    pub files: Vec<PathBuf>,
    /// File and line (from 1) of each line of `text`.
    lines: Vec<(usize, usize)>,
}

impl Source {
    /// Reads a file and what it includes. Paths of includes are relative to `root`; each file is included once, where it is first
    /// asked for.
    pub fn read(root: &Path, path: &Path) -> Result<Self, String> {
        let mut source = Self { text: String::new(), lines: Vec::new(), files: Vec::new() };
        source.append(root, path, &mut Vec::new()).map_err(|e| format!("error: {e}"))?;
        Ok(source)
    }

    /// `open` are the files that are being included, outermost first.
    fn append(&mut self, root: &Path, path: &Path, open: &mut Vec<usize>) -> Result<(), String> {
        if let Some(seen) = self.files.iter().position(|file| file == path) {
            let cycle = open.contains(&seen);
            return if cycle { Err("includes itself, through this line".into()) } else { Ok(()) };
        }
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        let file = self.files.len();
        self.files.push(path.to_owned());
        open.push(file);
        for (i, line) in text.lines().enumerate() {
            if let Some(rest) = line.trim().strip_prefix("#include") {
                let at = |problem: &str| format!("{}:{}: {problem}", path.display(), i + 1);
                let name = rest.trim().strip_prefix('"').and_then(|r| r.strip_suffix('"'));
                let name = name.ok_or_else(|| at("expected #include \"file\""))?;
                self.append(root, &root.join(name), open).map_err(|e| at(&e))?;
            } else {
                self.text.push_str(line);
                self.text.push('\n');
                self.lines.push((file, i + 1));
            }
        }
        open.pop();
        Ok(())
    }

    /// The first file.
    pub fn name(&self) -> String {
        self.files.first().map(|f| f.display().to_string()).unwrap_or_default()
    }

    /// File and line of a line (from 1) of `text`.
    pub fn origin(&self, line: usize) -> Option<(&Path, usize)> {
        let (file, line) = self.lines.get(line.checked_sub(1)?)?;
        Some((&self.files[*file], *line))
    }
}
