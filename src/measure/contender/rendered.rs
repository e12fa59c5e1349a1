//! Contenders whose ambient values a [`Renderer`] computes: one setup, whose radius is the state's.

use super::{Arena, Change, Contender, Entrant, Setting, State, Values};
use crate::Result;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao::stages;
use cao_gpu::Timings;
use cao_model::look::Look;
use cao_model::settings::Setup;

/// One whose renderer has this setup, and whose values count so much.
pub fn entrant(name: &'static str, setup: Setup, setting: Setting, work: f64, counts: f32) -> Entrant {
    Entrant {
        method: name,
        setting,
        work,
        has_values: true,
        open: Box::new(move |arena, state| Ok(Box::new(Rendered::open(arena, setup, counts, state)?))),
    }
}

struct Rendered<'a> {
    arena: Arena<'a>,
    renderer: Renderer,
    setup: Setup,
    counts: f32,
}

impl<'a> Rendered<'a> {
    fn open(arena: Arena<'a>, setup: Setup, counts: f32, state: &State) -> Result<Self> {
        let setup = with_radius(setup, state.radius_mm);
        let (transfer, volume) = (state.transfer.clone(), arena.volume);
        let mut renderer = Renderer::new(arena.gpu, volume, transfer, setup, COLOUR)?;
        renderer.set_clips(&state.clips)?;
        renderer.update(&mut |_| ())?;
        Ok(Self { arena, renderer, setup, counts })
    }
}

/// The same setup with another radius.
pub fn with_radius(mut setup: Setup, radius_mm: f32) -> Setup {
    setup.occlusion.radius_mm = radius_mm;
    setup
}

/// Tells a renderer what changed.
pub fn change_to(renderer: &mut Renderer, setup: Setup, change: Change, state: &State) -> Result<()> {
    match change {
        Change::Volume => renderer.invalidate(),
        Change::Clip => renderer.set_clips(&state.clips)?,
        Change::Transfer => renderer.set_transfer(state.transfer.clone())?,
        Change::Radius => renderer.set_setup(with_radius(setup, state.radius_mm))?,
    }
    Ok(())
}

impl Contender for Rendered<'_> {
    fn update(&mut self, change: Change, state: &State) -> Result<Timings> {
        change_to(&mut self.renderer, self.setup, change, state)?;
        let mut timings = self.renderer.update(&mut |_| ())?;
        if !self.setup.method.entry().contextual {
            // Maps of what the clips affect, which the renderer keeps ready for a contextual method; a full computation asks for none (CAO §4).
            timings.0.retain(|timing| timing.stage != stages::DILATE);
        }
        Ok(timings)
    }

    fn ambient(&self) -> Result<Values> {
        let mut values = self.renderer.read_ambient()?;
        if self.counts != 1.0 {
            values.iter_mut().for_each(|value| *value *= self.counts);
        }
        Ok(Values::Voxels(values))
    }

    fn draw(&self, look: &Look) -> Result<(StereoImage, Timings)> {
        let look = Look { gain: look.gain * self.counts, ..*look };
        Ok(self.renderer.draw(self.arena.views, &look, self.arena.size)?)
    }
}
