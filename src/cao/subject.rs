//! A scene on the device: what every method reads and none owns.

use crate::Result;
use crate::clip::clips::ClipSet;
use crate::clip::dilate::Dilate;
use crate::clip::peel::Peel;
use crate::drive::Part;
use crate::field::Field;
use crate::field::occupancy::Occupancy;
use crate::field::transfer::TransferBuffer;
use crate::stages;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder, Timings};
use cao_model::clip::Clip;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use glam::Vec3;

/// Volume, transfer function, clips and settings.
pub struct Subject {
    /// The device.
    pub gpu: Gpu,
    /// The volume.
    pub field: Field,
    /// Bricks that can have opacity, u32 each.
    pub occupancy: Buffer,
    /// Opacity and colour, as kernels read them.
    pub transfer_buffer: TransferBuffer,
    /// The clips, as kernels read them.
    pub clip_set: ClipSet,
    /// How occlusion is computed.
    pub setup: Setup,
    pub(crate) transfer: TransferFunction,
    pub(crate) clips: Vec<Clip>,
    occupancy_kernel: Occupancy,
    peel: Peel,
    dilate: Dilate,
}

impl Subject {
    /// Copies a volume to the device. Uses the device's queue and waits for it.
    pub(crate) fn new(gpu: &Gpu, volume: &Volume, transfer: TransferFunction, setup: Setup) -> Result<Self> {
        setup.check(volume.min_spacing())?;
        transfer.check()?;
        let field = Field::upload(gpu, volume)?;
        Ok(Self {
            gpu: gpu.clone(),
            occupancy: gpu.buffer("occupancy", 4 * u64::from(field.brick_count()), BufferUse::Device)?,
            transfer_buffer: TransferBuffer::new(gpu)?,
            clip_set: ClipSet::new(gpu)?,
            setup,
            transfer,
            clips: Vec::new(),
            occupancy_kernel: Occupancy::new(gpu)?,
            peel: Peel::new(gpu)?,
            dilate: Dilate::new(gpu)?,
            field,
        })
    }

    /// Reference length of the opacity in mm.
    pub fn reference_mm(&self) -> f32 {
        self.transfer.reference_mm(f64::from(self.field.min_spacing()))
    }

    /// Half the volume's diagonal in mm.
    fn half_diagonal(&self) -> f32 {
        let edge = |i: usize| self.field.dims[i] as f32 * self.field.spacing[i];
        0.5 * Vec3::new(edge(0), edge(1), edge(2)).length()
    }

    /// Makes the maps of clip meshes that are not there yet, dilated by `radius_mm`. Uses the device's queue only then.
    pub(crate) fn prepare_clips(&mut self, radius_mm: f32) -> Result<Timings> {
        let half_mm = self.half_diagonal();
        let Self { gpu, peel, dilate, clips, clip_set, setup, .. } = self;
        clip_set.prepare(gpu, peel, dilate, clips, radius_mm, half_mm, setup.maps)
    }

    /// Whether every clip mesh has its maps: not after making them failed.
    pub(crate) fn clips_are_prepared(&self) -> bool {
        self.clip_set.fits(&self.clips)
    }

    /// The transfer function's table, and the bricks that it gives opacity.
    pub(crate) fn occupancy(&self) -> Part<'_> {
        Part::short(stages::OCCUPANCY, |rec| {
            self.transfer_buffer.record(rec, &self.transfer)?;
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::UniformRead]);
            self.occupancy_kernel.record(rec, &self.field, &self.transfer_buffer, &self.occupancy)?;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
            Ok(())
        })
    }

    /// Records the clips at their poses.
    pub(crate) fn record_clips(&self, rec: &mut Recorder) -> Result<()> {
        self.clip_set.record(rec, &self.clips, self.half_diagonal())
    }
}
