//! `image space`: ambient occlusion from what each eye's image shows, as renderers without data-space values have it: by a hemisphere of points
//! ([`Hemisphere`]) and by the three published methods of docs/image-space.md ([`FirstHits`]). Its time is that of both eyes' passes; the depth
//! images it takes are those of the frame, which is drawn anyway.
//!
//! It has values at what the eyes see only: its errors are at points of the surface in the left eye's image. Where it shades half
//! a sphere and the others shade all of it, twice their ambient factor is what it stands for, and so its values are halved.

use super::first_hits::FirstHits;
use super::hemisphere::Hemisphere;
use super::rendered::{change_to, with_radius};
use super::{Arena, Asked, Change, Contender, Entrant, HALF_SPHERE, Setting, State, Values};
use crate::Result;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_gpu::{Phase, Stage, Timings};
use cao_model::image_space::ImageMethod;
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::settings::Setup;

/// What all of them are timed as.
pub const IMAGE_SPACE: Stage = Stage::new("image space", Phase::Ambient);

/// Passes over a frame's depths.
pub trait Passes {
    /// Draws the frame, then shades both eyes. The time is that of the shading.
    fn shade(&mut self, arena: Arena, renderer: &Renderer, radius_mm: f32) -> Result<Timings>;

    /// What an eye's pixels have, as of the last shading.
    fn factors(&self, arena: Arena, eye: usize) -> Result<Vec<f32>>;
}

/// What shades.
#[derive(Clone, Copy)]
pub enum By {
    /// So many points of a hemisphere.
    Points(u32),
    /// The method of this place in [`ImageMethod::all`].
    Published(usize),
}

/// Numbers of points in the hemisphere, and the published methods; one of them for a first look.
pub fn entrants(name: &'static str, asked: &Asked) -> Vec<Entrant> {
    let samples: &[u32] = if asked.quick { &[32] } else { &[8, 32, 128] };
    let points = samples.iter().map(|&samples| {
        let details = Hemisphere::details();
        entrant(name, format!("{samples} samples"), details, By::Points(samples), HALF_SPHERE)
    });
    // Its radius comes with the state.
    let published = ImageMethod::all(1.0).into_iter().enumerate().map(|(n, method)| {
        // A flat wall has one half there already.
        let whole = matches!(method, ImageMethod::Crytek(_));
        let counts = if whole { 1.0 } else { HALF_SPHERE };
        let details = format!("first hits of both eyes{}", if whole { "" } else { "; halved" });
        entrant(name, method.title().into(), details, By::Published(n), counts)
    });
    points.chain(published.take(if asked.quick { 0 } else { usize::MAX })).collect()
}

fn entrant(name: &'static str, label: String, details: String, by: By, counts: f32) -> Entrant {
    Entrant {
        method: name,
        setting: Setting { label, quadrature: None, details },
        work: 0.5,
        has_values: true,
        open: Box::new(move |arena, state| Ok(Box::new(ImageSpace::open(arena, state, by, counts)?))),
    }
}

struct ImageSpace<'a> {
    arena: Arena<'a>,
    renderer: Renderer,
    setup: Setup,
    passes: Box<dyn Passes>,
    counts: f32,
    radius_mm: f32,
}

impl<'a> ImageSpace<'a> {
    fn open(arena: Arena<'a>, state: &State, by: By, counts: f32) -> Result<Self> {
        let Arena { gpu, volume, .. } = arena;
        let setup = with_radius(Setup::of(Method::Cao, volume.min_spacing()), 0.0);
        let mut renderer = Renderer::new(gpu, volume, state.transfer.clone(), setup, COLOUR)?;
        renderer.set_clips(&state.clips)?;
        let passes: Box<dyn Passes> = match by {
            By::Points(samples) => Box::new(Hemisphere::new(arena, samples)?),
            By::Published(n) => Box::new(FirstHits::new(arena, n)?),
        };
        let mut made = Self { arena, renderer, setup, passes, counts, radius_mm: state.radius_mm };
        made.shade()?;
        Ok(made)
    }

    fn shade(&mut self) -> Result<Timings> {
        self.renderer.update(&mut |_| ())?;
        self.passes.shade(self.arena, &self.renderer, self.radius_mm)
    }
}

impl Contender for ImageSpace<'_> {
    fn update(&mut self, change: Change, state: &State) -> Result<Timings> {
        let unoccluded = State { radius_mm: 0.0, ..state.clone() };
        change_to(&mut self.renderer, self.setup, change, &unoccluded)?;
        self.radius_mm = state.radius_mm;
        self.shade()
    }

    fn ambient(&self) -> Result<Values> {
        let counted = self.passes.factors(self.arena, 0)?.into_iter().map(|factor| self.counts * factor);
        Ok(Values::Pixels(counted.collect()))
    }

    fn draw(&self, look: &Look) -> Result<(StereoImage, Timings)> {
        let look = Look { shading: Shading::Phong, ..*look };
        let (mut image, timings) = self.renderer.draw(self.arena.views, &look, self.arena.size)?;
        for eye in 0..2 {
            // The picture's own gain, for what is that of data-space values.
            let factors = self.passes.factors(self.arena, eye)?;
            for (pixel, factor) in image.colour[eye].iter_mut().zip(factors) {
                let light = (look.gain * self.counts * factor).min(1.0);
                (pixel[0], pixel[1], pixel[2]) = (pixel[0] * light, pixel[1] * light, pixel[2] * light);
            }
        }
        Ok((image, timings))
    }
}
