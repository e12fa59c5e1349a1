//! Values of TOML files as users write them.

use crate::{Error, Result};
use cao_model::error::{quoted, shown as cut};
use cao_model::transfer::{from_hex, to_linear};
use toml::Value;

/// What the TOML reader found wrong with `text`, and where, in one line.
pub(crate) fn in_line(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().lines().map(str::trim).collect::<Vec<_>>().join(" ");
    match error.span() {
        None => message,
        Some(span) => {
            let before = text.get(..span.start).unwrap_or(text);
            let line = before.matches('\n').count() + 1;
            let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
            format!("TOML parse error at line {line}, column {column}: {message}")
        }
    }
}

/// Characters of a value in a message.
const MOST_SHOWN: usize = 90;

/// A value as the user wrote it, or near enough to find it.
pub(crate) fn shown(value: &Value) -> String {
    // Of a list nobody reads more than fits.
    let some = |entries: &[Value]| entries.iter().take(MOST_SHOWN).map(shown).collect::<Vec<_>>().join(", ");
    match value {
        Value::String(text) => quoted(text).to_string(),
        Value::Integer(number) => number.to_string(),
        Value::Float(number) => number.to_string(),
        Value::Boolean(truth) => truth.to_string(),
        Value::Datetime(moment) => moment.to_string(),
        Value::Array(entries) => cut(&format!("[{}]", some(entries)), MOST_SHOWN),
        Value::Table(_) => "a table".into(),
    }
}

/// TOML tells 1 from 1.0; a user does not.
pub(crate) fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

/// `"#rrggbb"` or `[r, g, b]`, sRGB, to linear components.
pub(crate) fn parse_colour(key: &str, value: &Value) -> Result<[f32; 3]> {
    let expected = || {
        Error::refused(
            key,
            format!("{}: expected \"#rrggbb\" or [r, g, b] with numbers from 0 to 1", shown(value)),
        )
    };
    match value {
        Value::String(text) => {
            let digits =
                text.strip_prefix('#').filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()));
            let rgb = digits.and_then(|d| u32::from_str_radix(d, 16).ok()).ok_or_else(expected)?;
            Ok(from_hex(rgb))
        }
        Value::Array(three) if three.len() == 3 => {
            let mut linear = [0.0; 3];
            for (out, component) in linear.iter_mut().zip(three) {
                let srgb = number(component).filter(|c| (0.0..=1.0).contains(c)).ok_or_else(expected)?;
                *out = to_linear(srgb);
            }
            Ok(linear)
        }
        _ => Err(expected()),
    }
}
