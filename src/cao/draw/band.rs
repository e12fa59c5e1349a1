//! Bands: a picture of any height, some rows at a time, so that what it takes of memory does not grow with it.

use crate::Result;
use cao_gpu::{DeviceKind, Gpu};
use cao_kernels::raycast::TILE;
use cao_model::memory;

/// Most that the images of a band take, bytes: a headset's eyes are six bands, and with as much for reading back a picture of any size
/// takes 64 MiB of the device.
const MOST: u64 = 32 << 20;

/// Bytes of a pixel: four floats of colour and one of depth.
pub const PIXEL: u64 = 20;

/// Rows of a view that a picture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    /// Width and height of the whole view in pixels.
    pub size: [u32; 2],
    /// The row that is the picture's first.
    pub first: u32,
    /// How many there are.
    pub rows: u32,
}

impl Band {
    /// All rows.
    pub fn whole(size: [u32; 2]) -> Self {
        Self { size, first: 0, rows: size[1] }
    }

    /// Tiles, one a workgroup and view.
    pub fn tiles(&self) -> u32 {
        self.size[0].div_ceil(TILE) * self.rows.div_ceil(TILE)
    }
}

/// How a picture is parted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bands {
    /// Width and height of a view in pixels.
    pub size: [u32; 2],
    /// Rows that are drawn and handed over at once, but for the last band, which has what is left.
    pub rows: u32,
}

impl Bands {
    /// Bands of at most 32 MiB, whole tiles high.
    ///
    /// # Errors
    /// A size of nothing, and a width that the device's images cannot have, with the number that they can.
    pub fn new(gpu: &Gpu, size: [u32; 2], views: usize) -> Result<Self> {
        let [width, height] = size;
        if size.contains(&0) {
            let problem = format!("{width} x {height}; expected at least 1 x 1 pixels");
            return Err(crate::Error::refused("image size", problem));
        }
        let limit = gpu.info().max_image_2d;
        if width > limit {
            return Err(cao_model::Error::Limit {
                what: format!("image of {width} x {height}: pixels across"),
                needed: width.into(),
                limit: limit.into(),
                hint: format!(
                    "choose a narrower one, or a device that can hold it ({} cannot)",
                    gpu.info().name
                ),
            }
            .into());
        }
        let fit = MOST / (PIXEL * u64::from(width) * views.max(1) as u64) / u64::from(TILE);
        Ok(Self { size, rows: height.min(TILE * fit.clamp(1, u64::from(u32::MAX / TILE)) as u32) })
    }

    /// The bands from the top.
    pub fn iter(self) -> impl Iterator<Item = Band> {
        let Self { size, rows } = self;
        let band = move |first| Band { size, first, rows: rows.max(1).min(size[1] - first) };
        (0..size[1]).step_by(rows.max(1) as usize).map(band)
    }
}

/// Refuses what is more than there is, bytes of `place`, before anything is done for it.
pub(crate) fn afford(
    [width, height]: [u32; 2],
    views: usize,
    pixel: u64,
    place: &str,
    there: Option<u64>,
    hint: &str,
) -> Result<()> {
    let needed = u64::from(width) * u64::from(height) * views as u64;
    let needed = needed.saturating_mul(pixel);
    match there {
        Some(limit) if needed > limit => Err(cao_model::Error::Limit {
            what: format!("picture of {width} x {height} pixels and {views} views: bytes of {place}"),
            needed,
            limit,
            hint: hint.into(),
        }
        .into()),
        _ => Ok(()),
    }
}

/// What a device has for images, bytes; of what it shares with the processor no more than is free.
pub(crate) fn of_device(gpu: &Gpu) -> u64 {
    let info = gpu.info();
    match info.kind {
        DeviceKind::Cpu | DeviceKind::Integrated => {
            memory::available().map_or(info.device_memory, |free| free.min(info.device_memory))
        }
        _ => info.device_memory,
    }
}
