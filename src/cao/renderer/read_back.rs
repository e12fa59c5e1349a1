//! Pictures on the device's own queue, read back, whole or band by band.

use super::Renderer;
use super::drawing::Shot;
use crate::draw::band::{Band, Bands, PIXEL, afford};
use crate::draw::eyes::Views;
use crate::draw::picture::Picture;
use crate::drive::{Slice, add};
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder, Timing, Timings};
use cao_kernels::raycast::TILE;
use cao_model::look::Look;
use cao_model::memory;
use cao_model::view::View;
use std::time::Instant;

/// Rays of the first submission of a drawing on our own queue: some 40 ms of a software driver's two cores.
const FIRST_RAYS: u32 = 1 << 16;

/// The images of all views, left and right first, read back from the device.
#[derive(Clone, Debug)]
pub struct StereoImage<const VIEWS: usize = 2> {
    /// Width and height of one view in pixels.
    pub size: [u32; 2],
    /// Of each view: premultiplied linear RGBA, rows from the top.
    pub colour: [Vec<[f32; 4]>; VIEWS],
    /// Of each view: depth by its planes, that of the far one where nothing is drawn.
    pub depth: [Vec<f32>; VIEWS],
}

impl<const VIEWS: usize> StereoImage<VIEWS> {
    /// Nothing yet, with room for a picture of this size.
    fn with_room(size: [u32; 2]) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        Self {
            size,
            colour: std::array::from_fn(|_| Vec::with_capacity(pixels)),
            depth: std::array::from_fn(|_| Vec::with_capacity(pixels)),
        }
    }

    /// All of a picture that kernels have written, of as many views. Uses the device's queue and waits for it.
    pub(crate) fn read(gpu: &Gpu, picture: &Picture) -> Result<Self> {
        let [width, height] = picture.size();
        let bytes = PIXEL * u64::from(width) * u64::from(height) * VIEWS as u64;
        let read_back = gpu.buffer("image read-back", bytes, BufferUse::Readback)?;
        let mut rec = gpu.recorder("read picture")?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        record_read_back(&mut rec, picture, [width, height], &read_back)?;
        rec.submit_and_wait()?;
        let mut image = Self::with_room([width, height]);
        image.fill(Band::whole([width, height]), &read_back)?;
        Ok(image)
    }

    /// Takes in what `read_back` holds of a band: the colours of all views, then their depths.
    fn fill(&mut self, band: Band, read_back: &Buffer) -> Result<()> {
        self.size = [band.size[0], band.rows];
        let pixels = band.size[0] as usize * band.rows as usize;
        let mut at = 0;
        self.colour.iter_mut().for_each(|colour| colour.resize(pixels, [0.0; 4]));
        self.depth.iter_mut().for_each(|depth| depth.resize(pixels, 0.0));
        let colours = self.colour.iter_mut().map(|colour| bytemuck::cast_slice_mut(colour));
        let depths = self.depth.iter_mut().map(|depth| bytemuck::cast_slice_mut(depth));
        for into in colours.chain(depths) {
            read_back.read_into(at, into)?;
            at += into.len() as u64;
        }
        Ok(())
    }
}

impl Renderer {
    /// Draws both eyes, or any one to four views ([`View::MAX`]), on the device's own queue and reads them back. Refuses while the ambient
    /// volume is out of date, and a picture that the processor has no room for: 20 bytes a pixel and view. Who needs no whole picture in
    /// floats takes [`Self::draw_bands`].
    pub fn draw<const VIEWS: usize>(
        &self,
        views: &[View; VIEWS],
        look: &Look,
        size: [u32; 2],
    ) -> Result<(StereoImage<VIEWS>, Timings)> {
        let bands = Bands::new(&self.subject.gpu, size, VIEWS)?;
        let hint = "choose a smaller one, or take it band by band with draw_bands";
        afford(size, VIEWS, PIXEL, "memory", memory::available(), hint)?;
        let mut image = StereoImage::with_room(size);
        let timings = self.draw_bands(views, look, bands, &mut |_, band: &StereoImage<VIEWS>| {
            for view in 0..VIEWS {
                image.colour[view].extend_from_slice(&band.colour[view]);
                image.depth[view].extend_from_slice(&band.depth[view]);
            }
            Ok::<_, Error>(())
        })?;
        Ok((image, timings))
    }

    /// Draws the same and hands it over in bands of rows from the top as they come, each with the row of the picture that is its first, so
    /// that a picture of any size takes some 100 MiB: 32 of images on the device, as much for reading back, as much in floats. No bit of a
    /// pixel depends on the bands. No submission takes much longer than a tenth of a second, as far as that is known from those before it.
    ///
    /// # Errors
    /// As [`Self::draw`]; those of `take`, after which nothing more is drawn.
    pub fn draw_bands<const VIEWS: usize, E: From<Error>>(
        &self,
        views: &[View; VIEWS],
        look: &Look,
        bands: Bands,
        take: &mut dyn FnMut(u32, &StereoImage<VIEWS>) -> Result<(), E>,
    ) -> Result<Timings, E> {
        self.current()?;
        look.check().map_err(Error::from)?;
        if look.budget_ms.is_some() {
            let problem =
                "is for frames that a host records; draw with None, or use record_draw or record_picture";
            return Err(Error::refused("budget_ms", problem).into());
        }
        let Some(most) = bands.iter().next() else { return Ok(Timings::new()) };
        let mut drawing = Drawing::new(self, views, look, [bands.size[0], most.rows])?;
        let mut image = StereoImage::with_room([bands.size[0], most.rows]);
        for band in bands.iter() {
            drawing.band(band)?;
            image.fill(band, &drawing.read_back)?;
            take(band.first, &image)?;
        }
        Ok(drawing.timings)
    }
}

/// A drawing on our own queue.
struct Drawing<'a> {
    renderer: &'a Renderer,
    views: &'a [View],
    look: &'a Look,
    picture: Picture,
    read_back: Buffer,
    /// Tiles a submission.
    slice: Slice,
    timings: Timings,
}

impl<'a> Drawing<'a> {
    /// With bands of at most this size.
    fn new(renderer: &'a Renderer, views: &'a [View], look: &'a Look, size: [u32; 2]) -> Result<Self> {
        let gpu = &renderer.subject.gpu;
        let picture = Picture::new(gpu, size, views.len())?;
        let bytes = PIXEL * u64::from(size[0]) * u64::from(size[1]) * views.len() as u64;
        Ok(Self {
            renderer,
            views,
            look,
            picture,
            read_back: gpu.buffer("image read-back", bytes, BufferUse::Readback)?,
            slice: Slice::of(FIRST_RAYS / (TILE.pow(2) * views.len() as u32 * look.samples.max(1))),
            timings: Timings::new(),
        })
    }

    /// Draws a band and copies it to where it can be read: some tiles a submission, as many as take a tenth of a second.
    fn band(&mut self, band: Band) -> Result<()> {
        let mut done = 0;
        while done < band.tiles() {
            let tiles = self.slice.of_these(band.tiles() - done);
            let mut rec = self.renderer.subject.gpu.recorder("draw")?;
            let range = done..done + tiles;
            let shot = Shot {
                views: Views::Now(self.views),
                look: self.look,
                picture: &self.picture,
                targets: None,
                ended: false,
            };
            self.renderer.record_tiles(&mut rec, &shot, band, range)?;
            done += tiles;
            if done == band.tiles() {
                record_read_back(&mut rec, &self.picture, [band.size[0], band.rows], &self.read_back)?;
            }
            let start = Instant::now();
            for Timing { stage, ms } in rec.submit_and_wait()? {
                add(&mut self.timings, stage, ms);
            }
            self.slice.took(tiles, start.elapsed());
        }
        Ok(())
    }
}

/// The colours of all views, then their depths: a copy begins at a multiple of a texel.
fn record_read_back(rec: &mut Recorder, picture: &Picture, size: [u32; 2], to: &Buffer) -> Result<()> {
    let (extent, mut at) = ([size[0], size[1], 1], 0);
    for image in [&picture.colour, &picture.depth] {
        for view in 0..picture.views() as u32 {
            rec.copy_image_to_buffer(image, view, [0; 3], extent, to, at)?;
            at += u64::from(extent[0]) * u64::from(extent[1]) * image.desc().format.bytes();
        }
    }
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    Ok(())
}
