//! Series: one setting varied while the others stay. All points of a series take turns, as the methods do.

use super::frames::{Configuration, Input};
use anyhow::Result;
use cao_cli::args::usage;
use cao_model::builtin::builtin_box;
use cao_model::occlusion::RaySet;
use std::ffi::OsStr;
use std::rc::Rc;

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Series {
    /// Edges of a built-in volume: a quarter, a half, three quarters, all.
    Size,
    /// The paper's sets.
    Rays,
    /// Radius: a quarter, a half, once, twice.
    Radius,
    /// Width and height of a view: a quarter, a half, three quarters, all.
    Resolution,
    /// 1, 2, 4.
    Views,
}

impl Series {
    const ALL: [Self; 5] = [Self::Size, Self::Rays, Self::Radius, Self::Resolution, Self::Views];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Size => "size",
            Self::Rays => "rays",
            Self::Radius => "radius",
            Self::Resolution => "resolution",
            Self::Views => "views",
        }
    }

    /// The series of this name.
    pub fn parse(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|series| series.name() == text);
        found.ok_or_else(|| format!("expected one of {}", Self::ALL.map(Self::name).join(", ")))
    }

    /// The values, each in words, and the configuration that differs from `base` in nothing else. `transfer` is what the user asked for.
    pub fn configurations(
        self,
        base: &Configuration,
        transfer: &OsStr,
    ) -> Result<Vec<(String, Configuration)>> {
        const UP_TO: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
        Ok(match self {
            Self::Size => {
                UP_TO.map(|share| resized(base, share, transfer)).into_iter().collect::<Result<_>>()?
            }
            Self::Rays => [RaySet::R6, RaySet::R14, RaySet::R26, RaySet::R54]
                .map(|rays| {
                    let mut c = base.clone();
                    c.setup.occlusion.rays = rays;
                    (rays.name().to_owned(), c)
                })
                .to_vec(),
            Self::Radius => [0.25, 0.5, 1.0, 2.0]
                .map(|factor| {
                    let mut c = base.clone();
                    c.setup.occlusion.radius_mm *= factor;
                    (format!("{} mm", c.setup.occlusion.radius_mm), c)
                })
                .to_vec(),
            Self::Resolution => UP_TO
                .map(|share| {
                    let size = base.size.map(|edge| ((f64::from(edge) * share).round() as u32).max(1));
                    (format!("{}x{}", size[0], size[1]), Configuration { size, ..base.clone() })
                })
                .to_vec(),
            Self::Views => {
                [1, 2, 4].map(|views| (views.to_string(), Configuration { views, ..base.clone() })).to_vec()
            }
        })
    }
}

/// The built-in volume with other dimensions, of the same spacing, and the radius in mm as it was.
fn resized(base: &Configuration, share: f64, transfer: &OsStr) -> Result<(String, Configuration)> {
    let name = &base.input.name;
    let Some(scene) = name.strip_prefix("builtin:").and_then(|rest| rest.split(':').next()) else {
        return Err(usage(format!(
            "--scale size: {name} has one size; give a built-in volume, builtin:NAME:SIZE"
        )));
    };
    let volume = &base.input.volume;
    let dims = volume.dims.map(|n| ((n as f64 * share).round() as usize).max(1));
    if dims == volume.dims {
        return Ok((in_words(dims), base.clone()));
    }
    let volume = builtin_box(scene, dims, volume.spacing)?;
    let transfer = cao_formats::transfer::load(transfer, volume.range())?;
    let [sx, sy, sz] = volume.spacing;
    let spacing = if volume.spacing == [1.0; 3] { String::new() } else { format!(":{sx},{sy},{sz}") };
    let name = format!("builtin:{scene}:{}{spacing}", in_words(dims));
    Ok((
        in_words(dims),
        Configuration {
            input: Rc::new(Input { name, volume, transfer, network: base.input.network.clone() }),
            ..base.clone()
        },
    ))
}

fn in_words([x, y, z]: [usize; 3]) -> String {
    format!("{x}x{y}x{z}")
}
