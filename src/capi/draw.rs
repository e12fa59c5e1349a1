//! What is drawn: eyes, looks, and where to.

use crate::edge::{one_of, read, read_all, sized, versioned};
use crate::error::{CaoResult, Result, guard, refuse};
use crate::handle::get;
use crate::image::CaoImage;
use cao::renderer::{Coding, Over, Place, Target, Targets};
use cao_gpu::Image;
use cao_model::look::{Look, Shading};
use cao_model::view::{Tangents, View};
use glam::{Quat, Vec3};
use std::sync::Arc;

/// An eye, as OpenXR gives it, in mm in the volume's frame.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoView {
    /// sizeof(CaoView).
    pub size: u32,
    /// 1: depth is 1 at near_mm and 0 at far_mm; 0: the other way round.
    pub reversed: u32,
    /// The eye.
    pub position_mm: [f32; 3],
    /// x, y, z, w of a unit quaternion, from the eye's frame to the volume's; eyes look along -z, y is up.
    pub orientation: [f32; 4],
    /// Tangents of the angles to the left edge, usually negative,
    pub tan_left: f32,
    /// the right one,
    pub tan_right: f32,
    /// the upper one,
    pub tan_up: f32,
    /// and the lower one, usually negative.
    pub tan_down: f32,
    /// Nothing nearer is drawn.
    pub near_mm: f32,
    /// Nothing farther is drawn; may be infinite.
    pub far_mm: f32,
}
versioned!(CaoView);

/// Which parts of the light are shown.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoShading {
    /// The transfer function's colours alone.
    None = 0,
    /// Ambient, diffuse and specular light.
    Phong = 1,
    /// Colours times the ambient factor.
    Ao = 2,
    /// Light and the ambient factor; the default.
    PhongAo = 3,
}

const SHADINGS: [Shading; 4] = [Shading::None, Shading::Phong, Shading::Ao, Shading::PhongAo];

/// How it looks. cao_look_default fills it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoLook {
    /// sizeof(CaoLook).
    pub size: u32,
    /// A CaoShading.
    pub shading: u32,
    /// Light from everywhere, 0.4.
    pub ambient: f32,
    /// Light that depends on the surface's direction, 0.65.
    pub diffuse: f32,
    /// Reflected light, 0.15,
    pub specular: f32,
    /// and its exponent, 24.
    pub shininess: f32,
    /// Direction towards the light, from the first eye.
    pub light: [f32; 3],
    /// The ambient factor is shown times this, 2.
    pub gain: f32,
    /// Distance between samples in mm; 0: a quarter of the smallest spacing.
    pub step_mm: f32,
    /// Rays a pixel, 1.
    pub samples: u32,
    /// Whether surfaces are lit from behind as from the front: 0 or 1.
    pub two_sided: u32,
}
versioned!(CaoLook);

/// A rectangle of a layer.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoPlace {
    /// An image that is acquired; 0 for none.
    pub image: CaoImage,
    /// Its layer.
    pub layer: u32,
    /// The left column,
    pub x: u32,
    /// the upper row.
    pub y: u32,
    /// 0.
    pub reserved: u32,
}

/// Where a view goes.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoTarget {
    /// sizeof(CaoTarget).
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Colours, premultiplied.
    pub colour: CaoPlace,
    /// Depth where opacity passes a half; or none.
    pub depth: CaoPlace,
    /// Depth of what the host drew, at which rays end; or none, for all views.
    pub scene: CaoPlace,
}
versioned!(CaoTarget);

/// What views are laid over.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoOver {
    /// Nothing: they replace what is there.
    Nothing = 0,
    /// What is there: colour + (1 - alpha) · there.
    Scene = 1,
}

const OVERS: [Over; 2] = [Over::Nothing, Over::Scene];

/// What numbers of colours mean whose format does not say it.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoCoding {
    /// Light, linear.
    Linear = 0,
    /// Coded by sRGB's curve.
    Srgb = 1,
}

const CODINGS: [Coding; 2] = [Coding::Linear, Coding::Srgb];

/// A drawing.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoDraw {
    /// sizeof(CaoDraw).
    pub size: u32,
    /// 1 … 4.
    pub view_count: u32,
    /// As many; the first is the left eye.
    pub views: *const CaoView,
    /// As many.
    pub targets: *const CaoTarget,
    /// NULL is the default.
    pub look: *const CaoLook,
    /// Pixels of every view.
    pub width: u32,
    /// Pixels of every view.
    pub height: u32,
    /// A CaoOver.
    pub over: u32,
    /// A CaoCoding.
    pub coding: u32,
}
versioned!(CaoDraw);

/// A rectangle whose image is alive.
struct Held {
    image: Arc<Image>,
    layer: u32,
    at: [u32; 2],
}

impl Held {
    fn of(place: CaoPlace) -> Result<Self> {
        Ok(Self { image: get(place.image)?, layer: place.layer, at: [place.x, place.y] })
    }

    fn optional(place: CaoPlace) -> Result<Option<Self>> {
        if place.image.id == 0 { Ok(None) } else { Self::of(place).map(Some) }
    }

    fn place(&self) -> Place<'_> {
        Place { image: &self.image, layer: self.layer, at: self.at }
    }
}

/// A drawing, checked.
pub(crate) struct Drawing {
    pub views: Vec<View>,
    pub look: Look,
    /// Colour, depth, scene.
    targets: Vec<(Held, Option<Held>, Option<Held>)>,
    size: [u32; 2],
    over: Over,
    coding: Coding,
}

impl Drawing {
    /// # Safety
    /// The pointers are as the header asks.
    pub unsafe fn of(draw: &CaoDraw) -> Result<Self> {
        let count = draw.view_count;
        if count == 0 {
            return refuse(CaoResult::BadValue, format!("CaoDraw.view_count: 0; expected 1 … {}", View::MAX));
        }
        // SAFETY: the caller's promise.
        let views = unsafe { read_all(draw.views, count, View::MAX) }?;
        // SAFETY: as above.
        let targets = unsafe { read_all(draw.targets, count, View::MAX) }?;
        let held = |target: &CaoTarget| {
            Ok((Held::of(target.colour)?, Held::optional(target.depth)?, Held::optional(target.scene)?))
        };
        Ok(Self {
            views: views.iter().map(view).collect(),
            look: match draw.look.is_null() {
                true => Look::default(),
                // SAFETY: as above.
                false => look(&unsafe { read(draw.look) }?)?,
            },
            targets: targets.iter().map(held).collect::<Result<_>>()?,
            size: [draw.width, draw.height],
            over: one_of("CaoDraw.over", draw.over, &OVERS)?,
            coding: one_of("CaoDraw.coding", draw.coding, &CODINGS)?,
        })
    }

    /// Hands them over as the renderer has them.
    pub fn with_targets<R>(&self, with: impl FnOnce(&Targets) -> R) -> R {
        let views: Vec<_> = self
            .targets
            .iter()
            .map(|(colour, depth, scene)| Target {
                colour: colour.place(),
                depth: depth.as_ref().map(Held::place),
                scene: scene.as_ref().map(Held::place),
            })
            .collect();
        with(&Targets { views: &views, size: self.size, over: self.over, coding: self.coding })
    }
}

fn view(given: &CaoView) -> View {
    View {
        position: Vec3::from_array(given.position_mm),
        orientation: Quat::from_array(given.orientation),
        tan: Tangents {
            left: given.tan_left,
            right: given.tan_right,
            up: given.tan_up,
            down: given.tan_down,
        },
        near_mm: given.near_mm,
        far_mm: given.far_mm,
        reversed: given.reversed != 0,
    }
}

fn look(given: &CaoLook) -> Result<Look> {
    Ok(Look {
        shading: one_of("CaoLook.shading", given.shading, &SHADINGS)?,
        ambient: given.ambient,
        diffuse: given.diffuse,
        specular: given.specular,
        shininess: given.shininess,
        two_sided: given.two_sided != 0,
        light: Vec3::from_array(given.light),
        gain: given.gain,
        step_mm: (given.step_mm != 0.0).then_some(given.step_mm),
        samples: given.samples,
        ..Look::default()
    })
}

/// Fills in the default look. Set its size before.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_look_default(look: *mut CaoLook) -> CaoResult {
    guard(|| {
        // SAFETY: the header asks for it.
        unsafe { sized(look) }?;
        let of = Look::default();
        let filled = CaoLook {
            size: size_of::<CaoLook>() as u32,
            shading: CaoShading::PhongAo as u32,
            ambient: of.ambient,
            diffuse: of.diffuse,
            specular: of.specular,
            shininess: of.shininess,
            light: of.light.to_array(),
            gain: of.gain,
            step_mm: 0.0,
            samples: of.samples,
            two_sided: of.two_sided.into(),
        };
        // SAFETY: its size is ours, and it is the host's to be written.
        unsafe { look.write(filled) };
        Ok(())
    })
}
