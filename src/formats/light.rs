//! `light` of a scene file's `[occlusion]`: ambient light by the direction that it comes from, in the frame's axes.
//!
//! ```toml
//! light = "sky"                                      # or "uniform", or as on the command line: "sky:0,0,1"
//! light = { up = [0, 0, 1] }                         # a sky above there
//! light = { sh = [[0.9, 0.9, 1], 0, [0.3, 0.2, 0]] } # harmonics 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y²: a number, or red, green, blue, of each
//! ```

use crate::toml_value::{number, shown};
use crate::{Error, Result};
use cao_model::light::{AmbientLight, HARMONICS};
use toml::Value;

/// The light that a value of the key says.
///
/// # Errors
/// [`cao_model::Error::Config`] naming the key, what was found and what would do.
pub(crate) fn read(value: &Value) -> Result<AmbientLight> {
    let problem = || {
        let expected = format!(
            "\"uniform\", \"sky\", {{ up = [x, y, z] }}, or {{ sh = [...] }} with at most {HARMONICS} coefficients, each a number or [r, g, b]"
        );
        Error::refused("occlusion.light", format!("{}: expected {expected}", shown(value)))
    };
    let three = |value: &Value| -> Option<[f64; 3]> {
        value.as_array()?.iter().map(number).collect::<Option<Vec<f64>>>()?.try_into().ok()
    };
    let under = |error: cao_model::Error| Error::from(error.under("occlusion"));
    let table = match value {
        Value::String(text) => return AmbientLight::parse(text).map_err(under),
        Value::Table(table) if table.len() == 1 => table,
        _ => return Err(problem()),
    };
    if let Some(up) = table.get("up") {
        return three(up).map(AmbientLight::Sky).ok_or_else(problem);
    }
    let coefficients = table.get("sh").and_then(Value::as_array).ok_or_else(problem)?;
    let each = |one: &Value| number(one).map(|grey| [grey; 3]).or_else(|| three(one));
    let coefficients: Vec<_> = coefficients.iter().map(each).collect::<Option<_>>().ok_or_else(problem)?;
    AmbientLight::harmonics(&coefficients).map_err(under)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<AmbientLight> {
        read(&text.parse::<toml::Table>().unwrap()["light"])
    }

    #[test]
    fn lights_are_read_and_what_is_none_is_refused_by_name() {
        let two = AmbientLight::harmonics(&[[1.0, 0.5, 0.0], [-1.0; 3]]).unwrap();
        for (text, light) in [
            ("light = \"uniform\"", AmbientLight::Uniform),
            ("light = \"sky\"", AmbientLight::SKY),
            ("light = { up = [0, 1, 0.5] }", AmbientLight::Sky([0.0, 1.0, 0.5])),
            ("light = { sh = [[1, 0.5, 0], -1] }", two),
        ] {
            assert_eq!(of(text).unwrap(), light, "{text}");
        }
        for (text, told) in [
            ("light = \"sun\"", "\"sun\"; expected uniform, sky"),
            ("light = 3", "3: expected \"uniform\", \"sky\", { up = [x, y, z] }"),
            ("light = { up = [0, 1] }", "{ up = [x, y, z] }"),
            ("light = { down = [0, 1, 0] }", "{ up = [x, y, z] }"),
            ("light = { up = [0, 1, 0], sh = [1] }", "{ up = [x, y, z] }"),
            ("light = { sh = [[1, 2]] }", "each a number or [r, g, b]"),
            ("light = { sh = [] }", "0 coefficients; expected 1 to 9"),
            ("light = { sh = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1] }", "10 coefficients; expected 1 to 9"),
        ] {
            let error = of(text).unwrap_err().to_string();
            assert!(error.starts_with("occlusion.light: ") && error.contains(told), "{error}");
        }
    }
}
