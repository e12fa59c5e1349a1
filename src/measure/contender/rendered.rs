//! Contenders whose ambient values a [`Renderer`] computes: one setup, whose radius is the state's.

use super::{Ambient, Change, Contender, Entry, Setting, State, Subject};
use crate::Result;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao::stages;
use cao_gpu::Timings;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::settings::Setup;

/// A method at the setting that `setup` and `details` say.
pub fn entry(method: &'static str, setup: Setup, min_spacing: f64, details: &str, work: f64) -> Entry {
    Entry {
        method,
        setting: Setting::rays(&setup.occlusion, min_spacing, details),
        work,
        open: Box::new(move |subject, state| Ok(Box::new(Rendered::open(subject, setup, state)?))),
    }
}

struct Rendered<'a> {
    subject: Subject<'a>,
    renderer: Renderer,
    setup: Setup,
}

impl<'a> Rendered<'a> {
    fn open(subject: Subject<'a>, setup: Setup, state: &State) -> Result<Self> {
        let setup = with_radius(setup, state.radius_mm);
        let (transfer, volume) = (state.transfer.clone(), subject.volume);
        let mut renderer = Renderer::new(subject.gpu, volume, transfer, setup, COLOUR)?;
        renderer.set_clips(&state.clips)?;
        renderer.update(&mut |_| ())?;
        Ok(Self { subject, renderer, setup })
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
        if self.setup.method == Method::Lao {
            // Maps of what the clips affect, which the renderer keeps ready for another method; a full computation asks for none (CAO §4).
            timings.0.retain(|timing| timing.stage != stages::DILATE);
        }
        Ok(timings)
    }

    fn ambient(&self) -> Result<Ambient> {
        Ok(Ambient::Voxels(self.renderer.read_ambient()?))
    }

    fn draw(&self, look: &Look) -> Result<(StereoImage, Timings)> {
        Ok(self.renderer.draw(self.subject.views, look, self.subject.size)?)
    }
}
