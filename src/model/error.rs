//! What is wrong with data, said so that the user knows what to do next.
//!
//! Messages hold words of files and names of files, which may be anything: [`shown`] and [`quoted`] make them harmless.

use std::fmt::{self, Display};
use std::path::Path;

/// Result with the crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Data that cannot be worked with. Messages name the setting, mesh or limit and what was expected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting that cannot be honoured.
    #[error("{}: {}", shown(what, MOST_NAMED), shown(problem, MOST_SAID))]
    Config {
        /// Name of the setting as the user wrote it.
        what: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// A triangle mesh that cannot serve as a clip shape.
    #[error("mesh {}: {}", shown(name, MOST_NAMED), shown(problem, MOST_SAID))]
    Mesh {
        /// Name of the mesh (its file).
        name: String,
        /// What was found, where, and what would help.
        problem: String,
    },
    /// A size is beyond a limit of the program.
    #[error("{}: needs {needed}, the limit is {limit}; {hint}", shown(what, MOST_NAMED))]
    Limit {
        /// What is too large.
        what: String,
        /// Needed size.
        needed: u64,
        /// The limit.
        limit: u64,
        /// What the user can do.
        hint: String,
    },
}

impl Error {
    /// The refusal of the setting `what`.
    pub fn refused(what: &str, problem: impl Into<String>) -> Self {
        Self::Config { what: what.into(), problem: problem.into() }
    }

    /// The same refusal of a setting that is part of `section`.
    pub fn under(self, section: &str) -> Self {
        match self {
            Self::Config { what, problem } => Self::Config { what: format!("{section}.{what}"), problem },
            other => other,
        }
    }
}

/// Characters of a file's name, a key or a setting in a message.
pub const MOST_NAMED: usize = 240;
/// Characters of what a message says about it.
pub const MOST_SAID: usize = 800;
/// Characters of a value in such a sentence.
const MOST_QUOTED: usize = 60;

/// Text for a message: characters that command a terminal or turn the line round are escaped, and the middle of what is longer
/// than `most` characters is left out.
pub fn shown(text: &str, most: usize) -> String {
    let length = text.chars().count();
    let (head, tail) = if length > most { (most - most / 3, most / 3) } else { (length, 0) };
    let mut out = String::new();
    let mut add = |c: char| match commands(c) {
        true => out.extend(c.escape_debug()),
        false => out.push(c),
    };
    text.chars().take(head).for_each(&mut add);
    if head < length {
        add('…');
        text.chars().skip(length - tail).for_each(&mut add);
    }
    out
}

/// A file's name for a message, as [`shown`].
pub fn shown_path(path: impl AsRef<Path>) -> String {
    shown(&path.as_ref().to_string_lossy(), MOST_NAMED)
}

/// A value that was found, in quotes, cut to what fits a sentence.
pub fn quoted(text: &str) -> impl Display {
    struct Quoted<'a>(&'a str);
    impl Display for Quoted<'_> {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            match self.0.char_indices().nth(MOST_QUOTED) {
                Some((end, _)) => write!(f, "{:?}…", &self.0[..end]),
                None => write!(f, "{:?}", self.0),
            }
        }
    }
    Quoted(text)
}

/// Control characters, line ends, and those that change the direction of what follows.
fn commands(c: char) -> bool {
    let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || turns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_commands_a_terminal_is_escaped_and_what_is_long_is_cut_in_the_middle() {
        assert_eq!(shown("Schädel (1).nrrd", 99), "Schädel (1).nrrd");
        assert_eq!(shown("a\u{1b}[2Jb\nc\0\u{202e}d\u{9b}", 99), "a\\u{1b}[2Jb\\nc\\0\\u{202e}d\\u{9b}");
        assert_eq!(shown("0123456789", 6), "0123…89");
        assert_eq!(quoted("a\"\u{1b}").to_string(), r#""a\"\u{1b}""#);
        assert_eq!(quoted(&"x".repeat(70)).to_string(), format!("{:?}…", "x".repeat(60)));
    }

    #[test]
    fn every_message_is_harmless_whatever_it_holds() {
        let evil = "\u{1b}]0;x\u{7}".repeat(10_000);
        for error in [
            Error::Config { what: evil.clone(), problem: evil.clone() },
            Error::Mesh { name: evil.clone(), problem: evil.clone() },
            Error::Limit { what: evil, needed: 2, limit: 1, hint: "take less".into() },
        ] {
            let text = error.to_string();
            assert!(text.len() < 20_000 && !text.contains(char::is_control), "{text}");
        }
    }
}
