//! Where views are drawn: a host's layers, images, or rectangles of one image.

use crate::{Error, Result};
use cao_gpu::Image;

/// A rectangle of one layer of an image.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// The image.
    pub image: &'a Image,
    /// Its layer.
    pub layer: u32,
    /// The pixel that is the rectangle's upper left one.
    pub at: [u32; 2],
}

/// Where one view goes, and what it goes in front of and behind.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// An attachment of any colour format.
    pub colour: Place<'a>,
    /// An attachment of any depth format that takes the depth at which a ray's opacity passes one half, by the view's planes
    /// ([`View::reversed`](cao_model::view::View::reversed)). Where it never does, what is there stays, or with [`Over::Nothing`]
    /// becomes that of nothing.
    pub depth: Option<Place<'a>>,
    /// Depth of what the host has drawn, by the view's planes; for use as [`ImageUse::SAMPLED`](cao_gpu::ImageUse::SAMPLED), of one sample
    /// a pixel. Rays end there.
    pub scene: Option<Place<'a>>,
}

/// What views are laid over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// Nothing: colours, premultiplied, and depths replace what is there.
    Nothing,
    /// What is there: `colour + (1 - alpha) · there`.
    Scene,
}

/// What the numbers of images mean whose format does not say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    /// Light, linear; what formats of sRGB need, and those of floats.
    Linear,
    /// Coded by sRGB's curve, in a format that is not of sRGB. What is laid over is then mixed in coded numbers, as most programs that do so
    /// expect; only formats of sRGB mix light.
    Srgb,
}

/// Where all views go.
#[derive(Clone, Copy)]
pub struct Targets<'a> {
    /// One a view.
    pub views: &'a [Target<'a>],
    /// Width and height of every view in pixels.
    pub size: [u32; 2],
    /// What they are laid over.
    pub over: Over,
    /// What the colour's numbers mean.
    pub coding: Coding,
}

impl<'a> Target<'a> {
    /// The first layers of two images, one a view, from their upper left corners.
    pub fn layers(colour: &'a Image, depth: &'a Image, views: usize) -> Vec<Self> {
        let place = |image, layer| Place { image, layer, at: [0; 2] };
        let target =
            |view| Self { colour: place(colour, view), depth: Some(place(depth, view)), scene: None };
        (0..views as u32).map(target).collect()
    }
}

impl<'a> Targets<'a> {
    /// Rectangles of this size that are replaced, by linear numbers.
    pub fn new(views: &'a [Target<'a>], size: [u32; 2]) -> Self {
        Self { views, size, over: Over::Nothing, coding: Coding::Linear }
    }

    /// Refuses targets that do not suit so many views, before anything is recorded.
    pub(crate) fn check(&self, views: usize) -> Result<()> {
        let refuse = |problem: String| Err(Error::refused("targets", problem));
        if self.views.len() != views {
            return refuse(format!("{} of them, for {views} views", self.views.len()));
        }
        let scenes = self.views.iter().filter(|target| target.scene.is_some()).count();
        if scenes != 0 && scenes != views {
            return refuse("some views have a scene's depth and some have none; give all or none".into());
        }
        let [width, height] = self.size;
        for (i, target) in self.views.iter().enumerate() {
            let places = [("colour", Some(target.colour)), ("depth", target.depth), ("scene", target.scene)];
            for (what, place) in places.into_iter().filter_map(|(what, place)| Some((what, place?))) {
                let ([x, y], image) = (place.at, place.image.desc());
                let fits = |at: u32, size: u32, of: u32| {
                    size > 0 && at.checked_add(size).is_some_and(|end| end <= of)
                };
                if !fits(x, width, image.dims[0])
                    || !fits(y, height, image.dims[1])
                    || place.layer >= image.layers
                {
                    return refuse(format!(
                        "{what} of view {i}: {width}×{height} pixels at {x}, {y} of layer {} are not inside image {} of {}×{} in {} layers",
                        place.layer,
                        place.image.name(),
                        image.dims[0],
                        image.dims[1],
                        image.layers
                    ));
                }
            }
        }
        Ok(())
    }
}
