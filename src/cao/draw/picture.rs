//! The images that a ray cast writes.

use crate::Result;
use crate::draw::band::{self, PIXEL};
use crate::draw::eyes::check_count;
use cao_gpu::{Format, Gpu, Image, ImageDesc, ImageKind, ImageUse};

/// Format of a picture's colour.
pub const COLOUR: Format = Format::Rgba32Float;
/// The same in half floats.
pub const HALF_COLOUR: Format = Format::Rgba16Float;
/// Format of its depth.
pub const DEPTH: Format = Format::R32Float;

/// One to four views of one size on the device, a layer each.
pub struct Picture {
    /// Premultiplied linear RGBA, [`COLOUR`] or [`HALF_COLOUR`].
    pub colour: Image,
    /// Depth by the view's planes, 0 … 1, [`DEPTH`]; that of its far plane where nothing is drawn.
    pub depth: Image,
}

impl Picture {
    /// Memory for a picture, 20 bytes a pixel and view; content undefined.
    ///
    /// # Errors
    /// [`cao_model::Error`] for no views or more than [`cao_model::view::View::MAX`], and for more than the device has, with both
    /// numbers; those of the device for what else it cannot hold.
    pub fn new(gpu: &Gpu, size: [u32; 2], views: usize) -> Result<Self> {
        Self::of(gpu, size, views, COLOUR, PIXEL)
    }

    /// The same with colours in half floats, 12 bytes a pixel and view: eleven bits of each component, as a host's own targets have.
    ///
    /// # Errors
    /// As [`Picture::new`].
    pub fn half(gpu: &Gpu, size: [u32; 2], views: usize) -> Result<Self> {
        Self::of(gpu, size, views, HALF_COLOUR, 12)
    }

    fn of(gpu: &Gpu, size: [u32; 2], views: usize, colour: Format, pixel: u64) -> Result<Self> {
        check_count(views)?;
        let hint = "choose a smaller one, half floats, or draw it in bands";
        band::afford(size, views, pixel, "device memory", Some(band::of_device(gpu)), hint)?;
        let image = |name, format| {
            let usage = ImageUse::STORAGE | ImageUse::SAMPLED;
            let (dims, layers) = ([size[0], size[1], 1], views as u32);
            gpu.image(name, &ImageDesc { dims, layers, format, kind: ImageKind::D2, usage })
        };
        Ok(Self { colour: image("picture's colour", colour)?, depth: image("picture's depth", DEPTH)? })
    }

    /// Width and height of a view in pixels.
    pub fn size(&self) -> [u32; 2] {
        let [width, height, _] = self.colour.desc().dims;
        [width, height]
    }

    /// How many views there is room for.
    pub fn views(&self) -> usize {
        self.colour.desc().layers as usize
    }
}
