//! No ambient occlusion: the paper's "solid colour" (CAO §4), 1 everywhere at no cost, what any method must beat; and Phong's light from one side, which
//! has no ambient values at all and is there for its pictures.

use super::rendered::{change_to, with_radius};
use super::{Arena, Asked, Change, Contender, Entrant, Setting, State, Values};
use crate::Result;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_gpu::Timings;
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::settings::Setup;

/// The one setting of solid colour.
pub fn entrants(name: &'static str, _: &Asked) -> Vec<Entrant> {
    vec![entrant(name)]
}

/// Solid colour.
pub fn entrant(name: &'static str) -> Entrant {
    lit(name, Shading::None, "ambient factor 1")
}

/// The one setting of Phong's light.
pub fn phong(name: &'static str, _: &Asked) -> Vec<Entrant> {
    vec![Entrant { has_values: false, ..lit(name, Shading::Phong, "ambient, diffuse and specular light") }]
}

fn lit(name: &'static str, shading: Shading, details: &str) -> Entrant {
    Entrant {
        method: name,
        setting: Setting { label: "-".into(), quadrature: None, details: details.into() },
        work: 0.0,
        has_values: true,
        open: Box::new(move |arena, state| Ok(Box::new(Solid::open(arena, shading, state)?))),
    }
}

struct Solid<'a> {
    arena: Arena<'a>,
    renderer: Renderer,
    setup: Setup,
    shading: Shading,
}

impl<'a> Solid<'a> {
    fn open(arena: Arena<'a>, shading: Shading, state: &State) -> Result<Self> {
        // Without a neighbourhood nothing is occluded.
        let setup = with_radius(Setup::of(Method::Cao, arena.volume.min_spacing()), 0.0);
        let (transfer, volume) = (state.transfer.clone(), arena.volume);
        let mut renderer = Renderer::new(arena.gpu, volume, transfer, setup, COLOUR)?;
        renderer.set_clips(&state.clips)?;
        renderer.update(&mut |_| ())?;
        Ok(Self { arena, renderer, setup, shading })
    }
}

impl Contender for Solid<'_> {
    fn update(&mut self, change: Change, state: &State) -> Result<Timings> {
        let state = State { radius_mm: 0.0, ..state.clone() };
        change_to(&mut self.renderer, self.setup, change, &state)?;
        // What this brings up to date is the picture's opacity; there are no ambient values that could be late.
        self.renderer.update(&mut |_| ())?;
        Ok(Timings::new())
    }

    fn ambient(&self) -> Result<Values> {
        Ok(Values::Voxels(vec![1.0; self.arena.volume.len()]))
    }

    fn draw(&self, look: &Look) -> Result<(StereoImage, Timings)> {
        let look = Look { shading: self.shading, ..*look };
        Ok(self.renderer.draw(self.arena.views, &look, self.arena.size)?)
    }
}
