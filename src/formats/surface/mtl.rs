//! Materials of OBJ files: `newmtl`, `Kd`, `d`, `Tr`, `map_Kd`, `map_d`; every other key is about light that is not computed here.
//!
//! Read by our own few lines: `tobj` panics on a colour of one number, and knows no lines to name in a refusal.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::texture::Textures;
use crate::{Error, Result, file};
use cao_model::error::quoted;
use cao_model::surface::{Material, Texture};

/// Longest library of materials.
const MAX_BYTES: u64 = 4 << 20;

/// Where opacity is below this there is no surface.
pub(super) const CUTOFF: f32 = 0.5;

/// What a library says of a material before its textures are read.
#[derive(Clone, Default)]
struct Entry {
    colour: Option<[f32; 3]>,
    alpha: Option<f32>,
    /// Texture of colours, and of opacities; each with its line.
    colours: Option<(usize, PathBuf)>,
    alphas: Option<(usize, PathBuf)>,
}

/// Materials by their names. Later ones of the same name count, as in other readers.
#[derive(Default)]
pub(super) struct Library {
    entries: HashMap<String, (PathBuf, Entry)>,
}

impl Library {
    /// Adds those of a file.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::File`] naming file, line and key.
    pub(super) fn add(&mut self, path: &Path) -> Result<()> {
        let bytes = file::read_bytes(path, MAX_BYTES)?;
        let text = String::from_utf8_lossy(&bytes);
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut current: Option<&mut Entry> = None;
        for (line, number) in text.lines().zip(1..) {
            let line = line.trim();
            let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            let rest = rest.trim();
            let wrong = |problem: String| Err(Error::file(path, &format!("line {number}: {key}"), problem));
            if key == "newmtl" {
                let entry = self.entries.entry(rest.to_owned()).insert_entry((path.into(), Entry::default()));
                current = Some(&mut entry.into_mut().1);
                continue;
            }
            if !["Kd", "d", "Tr", "map_Kd", "map_d"].contains(&key) {
                continue;
            }
            let Some(entry) = &mut current else {
                return wrong("stands before newmtl, which names its material".into());
            };
            match key {
                "Kd" => {
                    let parts: Option<Vec<f32>> =
                        rest.split_whitespace().map(|word| word.parse().ok()).collect();
                    entry.colour = Some(match parts.as_deref() {
                        Some(&[grey]) if share(grey) => [grey; 3],
                        Some(&[r, g, b]) if share(r) && share(g) && share(b) => [r, g, b],
                        _ => {
                            return wrong(format!(
                                "{}: expected one or three numbers from 0 to 1",
                                quoted(rest)
                            ));
                        }
                    });
                }
                "d" | "Tr" => match rest.parse() {
                    Ok(value) if share(value) => {
                        entry.alpha = Some(if key == "d" { value } else { 1.0 - value })
                    }
                    _ => return wrong(format!("{}: expected a number from 0 to 1", quoted(rest))),
                },
                _ => {
                    if rest.is_empty() || rest.starts_with('-') {
                        let problem =
                            "expected the name of a PNG file without options; bake them into the image";
                        return wrong(format!("{}: {problem}", quoted(rest)));
                    }
                    // Some programs write the separators of their own system.
                    let name = folder.join(rest.replace('\\', "/"));
                    let map = if key == "map_Kd" { &mut entry.colours } else { &mut entry.alphas };
                    *map = Some((number, name));
                }
            }
        }
        Ok(())
    }

    /// The material of this name, its textures read; `None` where no library has it.
    ///
    /// # Errors
    /// [`Error::File`] naming the library, the line of the texture, the material and the image.
    pub(super) fn material(&self, name: &str, textures: &mut Textures) -> Result<Option<Material>> {
        let Some((path, entry)) = self.entries.get(name) else { return Ok(None) };
        let mut read = |map: &Option<(usize, PathBuf)>, key: &str| {
            let Some((line, image)) = map else { return Ok(None) };
            textures.load(image).map(Some).map_err(|problem| {
                Error::file(
                    path,
                    &format!("line {line}: {key}"),
                    format!("material {}: {problem}", quoted(name)),
                )
            })
        };
        let (colours, alphas) = (read(&entry.colours, "map_Kd")?, read(&entry.alphas, "map_d")?);
        let alpha = entry.alpha.unwrap_or(1.0);
        let masked = alphas.is_some() || alpha < 1.0;
        let texture = match (colours, alphas) {
            (colours, None) => colours,
            (colours, Some(alphas)) => Some(masked_by(colours.as_deref(), &alphas).map_err(|problem| {
                let line = entry.alphas.as_ref().map_or(0, |(line, _)| *line);
                Error::file(
                    path,
                    &format!("line {line}: map_d"),
                    format!("material {}: {problem}", quoted(name)),
                )
            })?),
        };
        Ok(Some(Material {
            name: name.into(),
            // A texture's colours stand for it where it is left out.
            colour: entry.colour.unwrap_or(if texture.is_some() {
                [1.0; 3]
            } else {
                Material::default().colour
            }),
            alpha,
            texture,
            cutoff: masked.then_some(CUTOFF),
            two_sided: masked,
            spared: false,
            cap: None,
        }))
    }
}

fn share(value: f32) -> bool {
    (0.0..=1.0).contains(&value)
}

/// The colours of one image, white where there is none, with the opacities of another: its alpha where it has any, else its brightness.
fn masked_by(colours: Option<&Texture>, alphas: &Arc<Texture>) -> Result<Arc<Texture>, String> {
    if let Some(colours) = colours.filter(|colours| colours.size != alphas.size) {
        let ([x, y], [to_x, to_y]) = (alphas.size, colours.size);
        return Err(format!(
            "{} has {x}×{y} pixels and map_Kd {to_x}×{to_y}; scale one to the other",
            alphas.name
        ));
    }
    let has_alpha = alphas.texels.iter().any(|texel| texel[3] < 255);
    let alpha = |[r, g, b, a]: [u8; 4]| {
        if has_alpha { a } else { ((u32::from(r) + u32::from(g) + u32::from(b) + 1) / 3) as u8 }
    };
    let colour = |i: usize| colours.map_or([255; 4], |colours| colours.texels[i]);
    let texels = alphas.texels.iter().enumerate().map(|(i, texel)| {
        let [r, g, b, _] = colour(i);
        [r, g, b, alpha(*texel)]
    });
    Ok(Arc::new(Texture { name: alphas.name.clone(), size: alphas.size, texels: texels.collect() }))
}
