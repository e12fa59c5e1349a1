//! The tables `[[mesh]]` and `[mesh_occlusion]` of the scene file.
//!
//! ```
//! let scene = cao_formats::Scene::from_toml(
//!     r##"
//!     [[mesh]]                         # none, or up to 64; without `volume` a scene of meshes alone
//!     builtin = "colonnade"            # fence house trees relief level suburb; or instead: file = "implant.obj", .gltf, .glb
//!     detail = 2                       # of a built-in: how finely it is divided, 1 to 16; default: as in charts
//!     translate_mm = [0, 0, 40]
//!     rotate_deg = [0, 0, 90]          # about the fixed axes x, then y, then z
//!     scale = 0.5                      # or one number an axis: [1, 1, 2]
//!     colour = "#c8b090"               # instead of the file's own; masks stay
//!     solid = true                     # whether the volume's opacity knows it, which it then darkens; closed meshes only; default: false
//!     spared = true                    # whether clips leave it whole; default: false
//!     ## cap = "#c03030"                # of a closed mesh: where clips cut it open, its cut is drawn in this colour; true: in its own; default: false, its backs are seen
//!     two_sided = true                 # whether backs are surfaces, too; default: as the file has it, docs/formats.md
//!
//!     [mesh_occlusion]                 # without [[mesh]]: crytek, volumetric, hbao of what the volume's picture shows first, in place of [occlusion]
//!     method = "aov"                   # aov rays crytek volumetric hbao
//!     delta_mm = 60                    # how far obscurance reaches; default: a tenth of the half diagonal of all meshes
//!     sparse = 5                       # of aov: every fifth pixel in each direction is computed; 1 3 5 15
//!     clamp = true                     # of aov: corners of volumes at most 2 delta from the triangle's, as printed; default: false
//!     ## rays = 256                     # of rays: rays of a pixel
//!     ## samples = 16                   # of volumetric, hbao: texels that are read around a pixel, 1 to 1024
//!     "##,
//!     std::path::Path::new("."),
//! )?;
//! assert_eq!(scene.meshes[0].instances()?.len(), 33);
//! # Ok::<(), cao_formats::Error>(())
//! ```

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use toml::Value;

use crate::keys::{existing, length, pose};
use crate::toml_value::{parse_colour, shown};
use crate::{Error, Result, surface};
use cao_model::clip::Pose;
use cao_model::pixel_occlusion::{PixelMethod, PixelOcclusion};
use cao_model::scenes::BuiltScene;
use cao_model::surface::{Instance, Material, Surface, Texture};

/// Most tables `[[mesh]]` of a scene.
pub const MOST_MESHES: usize = 64;

/// A mesh of a scene: where it comes from, where it stands, and what is not as its file has it.
#[derive(Clone, Debug)]
pub struct MeshSource {
    /// What.
    pub from: MeshFrom,
    /// Where, in the scene's frame; in front of the poses that the file's own instances have.
    pub pose: Pose,
    /// Linear r, g, b of all its materials; `None`: their own.
    pub colour: Option<[f32; 3]>,
    /// Whether all its materials have two sides; `None`: as each says.
    pub two_sided: Option<bool>,
    /// Whether clips leave it whole.
    pub spared: bool,
    /// Whether the surface is drawn where clips cut it open.
    pub cap: Cap,
    /// Whether it fills the volume's opacity.
    pub solid: bool,
}

/// What is drawn where clips cut a mesh open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cap {
    /// Its backs.
    None,
    /// The cut, in the mesh's own colour: that of its first material, without textures.
    Own,
    /// The cut, in a linear r, g, b.
    Colour([f32; 3]),
}

/// Where a mesh comes from.
#[derive(Clone, Debug)]
pub enum MeshFrom {
    /// A file that [`surface::load`] reads.
    File(PathBuf),
    /// A built-in scene and its detail.
    Builtin(&'static BuiltScene, u32),
}

impl MeshSource {
    /// The surfaces, read or made, at their places.
    ///
    /// # Errors
    /// As [`surface::load`].
    pub fn instances(&self) -> Result<Vec<Instance>> {
        let instances = match &self.from {
            MeshFrom::File(path) => surface::load(path)?,
            MeshFrom::Builtin(scene, detail) => (scene.make)(*detail),
        };
        let changed = |surface: &Arc<Surface>| match (self.colour, self.two_sided, self.spared, self.cap) {
            (None, None, false, Cap::None) => surface.clone(),
            _ => {
                let mut materials: Vec<Material> =
                    surface.materials.iter().map(|m| self.changed(m)).collect();
                let cap = match self.cap {
                    Cap::None => None,
                    Cap::Own => materials.first().map(|material| material.colour),
                    Cap::Colour(colour) => Some(colour),
                };
                materials.iter_mut().for_each(|material| material.cap = cap);
                Arc::new(Surface { materials, ..(**surface).clone() })
            }
        };
        // Surfaces that several instances share stay shared.
        let mut known: Vec<(Arc<Surface>, Arc<Surface>)> = Vec::new();
        let mut all = Vec::new();
        for Instance { surface, pose } in instances {
            let found = known.iter().find(|(old, _)| Arc::ptr_eq(old, &surface)).map(|(_, new)| new.clone());
            let new = found.unwrap_or_else(|| {
                let new = changed(&surface);
                known.push((surface, new.clone()));
                new
            });
            all.push(surface::moved(Instance { surface: new, pose }, &self.pose));
        }
        Ok(all)
    }

    /// A material with what the scene says instead.
    fn changed(&self, material: &Material) -> Material {
        let mut changed = material.clone();
        changed.spared = self.spared;
        changed.two_sided = self.two_sided.unwrap_or(changed.two_sided);
        if let Some(colour) = self.colour {
            changed.colour = colour;
            // Of a texture its mask is left, if it is one.
            changed.texture = changed.texture.filter(|_| changed.cutoff.is_some()).map(|texture| {
                let white = |[.., alpha]: &[u8; 4]| [255, 255, 255, *alpha];
                let texels = texture.texels.iter().map(white).collect();
                Arc::new(Texture { texels, ..(*texture).clone() })
            });
        }
        changed
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshFile {
    file: Option<PathBuf>,
    builtin: Option<String>,
    detail: Option<i64>,
    translate_mm: Option<[f64; 3]>,
    rotate_deg: Option<[f64; 3]>,
    scale: Option<Value>,
    colour: Option<Value>,
    two_sided: Option<bool>,
    #[serde(default)]
    spared: bool,
    cap: Option<Value>,
    #[serde(default)]
    solid: bool,
}

impl MeshFile {
    pub(crate) fn read(self, key: &str, base: &Path) -> Result<MeshSource> {
        let of = |name: &str| format!("{key}.{name}");
        let from = match (&self.file, &self.builtin) {
            (Some(path), None) => MeshFrom::File(existing(&of("file"), base, path)?),
            (None, Some(name)) => {
                let scene =
                    BuiltScene::parse(name).map_err(|error| Error::from(error).renamed(&of("builtin")))?;
                let most = BuiltScene::MOST_DETAIL;
                let detail = match self.detail {
                    None => scene.detail,
                    Some(detail) if (1..=i64::from(most)).contains(&detail) => detail as u32,
                    Some(detail) => {
                        return Err(Error::refused(&of("detail"), format!("{detail}: expected 1 to {most}")));
                    }
                };
                MeshFrom::Builtin(scene, detail)
            }
            _ => return Err(Error::refused(key, "expected either file or builtin")),
        };
        if self.detail.is_some() && self.builtin.is_none() {
            return Err(Error::refused(&of("detail"), "has no effect without builtin"));
        }
        let cap = match &self.cap {
            None | Some(Value::Boolean(false)) => Cap::None,
            Some(Value::Boolean(true)) => Cap::Own,
            Some(colour) => {
                let read = parse_colour(&of("cap"), colour);
                let problem = || {
                    format!(
                        "{}: expected true, false, \"#rrggbb\" or [r, g, b] with numbers from 0 to 1",
                        shown(colour)
                    )
                };
                Cap::Colour(read.map_err(|_| Error::refused(&of("cap"), problem()))?)
            }
        };
        if self.spared && cap != Cap::None {
            return Err(Error::refused(
                &of("cap"),
                "has no effect with spared, which clips do not cut; take one of both away",
            ));
        }
        Ok(MeshSource {
            from,
            pose: pose(key, self.translate_mm, self.rotate_deg, self.scale.as_ref())?,
            colour: self.colour.map(|colour| parse_colour(&of("colour"), &colour)).transpose()?,
            two_sided: self.two_sided,
            spared: self.spared,
            cap,
            solid: self.solid,
        })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshOcclusionFile {
    method: Option<String>,
    delta_mm: Option<f64>,
    rays: Option<i64>,
    sparse: Option<i64>,
    samples: Option<i64>,
    #[serde(default)]
    clamp: bool,
}

impl MeshOcclusionFile {
    pub(crate) fn read(self) -> Result<PixelOcclusion> {
        let section = "mesh_occlusion";
        let method = self.method.as_deref().map(PixelMethod::parse).transpose();
        let usual = method
            .map_err(|error| error.under(section))?
            .map_or(PixelOcclusion::default(), PixelOcclusion::of);
        length("mesh_occlusion.delta_mm", self.delta_mm, false)?;
        let count = |name: &str, given: Option<i64>, usual: u32| match given {
            None => Ok(usual),
            // What is beyond u32 is beyond every limit.
            Some(count) => u32::try_from(count).map_err(|_| {
                Error::refused(&format!("{section}.{name}"), format!("{count}: expected a number from 1"))
            }),
        };
        let settings = PixelOcclusion {
            delta_mm: self.delta_mm.map(|mm| mm as f32),
            rays: count("rays", self.rays, usual.rays)?,
            sparse: count("sparse", self.sparse, usual.sparse)?,
            samples: count("samples", self.samples, usual.samples)?,
            clamp: self.clamp,
            ..usual
        };
        settings.check().map_err(|error| error.under(section))?;
        Ok(settings)
    }
}
