//! A scene on the device: what every method reads and none owns.

use crate::Result;
use crate::clip::clip_bricks::ClipBricks;
use crate::clip::clips::ClipSet;
use crate::clip::dilate::Dilate;
use crate::clip::peel::Peel;
use crate::clip::solid::{Solid, Solids};
use crate::drive::Part;
use crate::field::Field;
use crate::field::features::{Classes, FeatureSet};
use crate::field::occupancy::Occupancy;
use crate::field::transfer::TransferBuffer;
use crate::stages;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder, Timings};
use cao_model::clip::Clip;
use cao_model::feature::Features;
use cao_model::network::Network;
use cao_model::settings::{AntiAliasing, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use glam::Vec3;

/// Volume, transfer function, clips and settings.
pub struct Subject {
    /// The device.
    pub gpu: Gpu,
    /// The volume.
    pub field: Field,
    /// Which values it has: another number after each change of them.
    pub values: u64,
    /// Bricks that can have opacity, u32 each.
    pub occupancy: Buffer,
    /// Opacity and colour, as kernels read them.
    pub transfer_buffer: TransferBuffer,
    /// The features: which voxel is whose, and how each is shown.
    pub features: FeatureSet,
    /// The clips, as kernels read them.
    pub clip_set: ClipSet,
    /// What fills opacity beside what the volume has.
    pub solids: Solids,
    /// How V_AO is computed: by the last update that began.
    pub setup: Setup,
    /// How the next one is to compute it; the same unless an update spans frames.
    pub(crate) wanted: Setup,
    /// Reference length in mm of the opacities that V_AO is computed from, as of [`Self::setup`].
    pub(crate) ambient_mm: f32,
    /// The network of method `dvao`.
    pub network: Network,
    pub(crate) transfer: TransferFunction,
    pub(crate) clips: Vec<Clip>,
    classes: Classes,
    occupancy_kernel: Occupancy,
    /// What fills solids, and their shapes on the device, once there was one.
    solid_kernel: Option<(Solid, ClipSet)>,
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
            features: FeatureSet::new(gpu, &field, Features::NONE)?,
            clip_set: ClipSet::new(gpu)?,
            solids: Solids::none(gpu)?,
            ambient_mm: transfer.reference_mm(f64::from(field.min_spacing())),
            setup,
            wanted: setup,
            network: Network::small(),
            transfer,
            clips: Vec::new(),
            classes: Classes::new(gpu)?,
            values: 0,
            occupancy_kernel: Occupancy::new(gpu)?,
            solid_kernel: None,
            peel: Peel::new(gpu)?,
            dilate: Dilate::new(gpu)?,
            field,
        })
    }

    /// Whether V_AO has red, green and blue.
    pub fn coloured(&self) -> bool {
        self.setup.coloured()
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

    /// The set for the clips and the settings that are wanted, its maps dilated by `radius_mm` where it is a number.
    pub(crate) fn planned_clips(&self, radius_mm: Option<f32>) -> Result<ClipSet> {
        self.clip_set.planned(&self.gpu, &self.clips, radius_mm, self.half_diagonal(), self.wanted.maps)
    }

    /// Records what makes the maps of clip meshes that are not there.
    pub(crate) fn record_clip_maps(&mut self, rec: &mut Recorder) -> Result<()> {
        self.clip_set.record_maps(&self.gpu, rec, &self.peel, &self.dilate)
    }

    /// Makes them. Uses the device's queue only where there is one to make.
    pub(crate) fn make_clip_maps(&mut self) -> Result<Timings> {
        self.clip_set.make(&self.gpu, &self.peel, &self.dilate)
    }

    /// Solids of these shapes, which clips leave whole where they are `spared`. Uses the device's queue and waits for it.
    pub(crate) fn solids_of(&mut self, shapes: &[Clip], spared: bool) -> Result<Solids> {
        if shapes.is_empty() {
            return Solids::none(&self.gpu);
        }
        let (gpu, half_mm) = (&self.gpu, self.half_diagonal());
        // Kept from the first solid on: what moves is not peeled again, and nothing is compiled again.
        let (kernel, kept) = match &mut self.solid_kernel {
            Some(kept) => kept,
            none => none.insert((Solid::new(gpu)?, ClipSet::new(gpu)?)),
        };
        let mut set = kept.planned(gpu, shapes, None, half_mm, self.wanted.maps)?;
        set.make(gpu, &self.peel, &self.dilate)?;
        let solids = Solids::of(gpu, &self.field, spared)?;
        let mut rec = gpu.recorder("solids")?;
        set.record(&mut rec, shapes, half_mm)?;
        rec.discard(&solids.solid);
        rec.barrier(&[], &[Access::StorageWrite]);
        rec.stage(stages::SOLIDS)?;
        // As clips are sampled where nobody asks for more or less.
        kernel.record(&mut rec, &self.field, AntiAliasing::N32, &set, &solids)?;
        rec.end_stage()?;
        rec.submit_and_wait()?;
        *kept = set;
        Ok(solids)
    }

    /// What opacities before clipping come from: values, and the function that gives them opacity. With features the values are opacities
    /// already, each voxel's own.
    pub fn opacities(&self) -> (&Field, &TransferBuffer) {
        self.features.opacities().unwrap_or((&self.field, &self.transfer_buffer))
    }

    /// The transfer function's table, opacities after features, and the bricks that have any.
    pub(crate) fn classified(&self) -> Vec<Part<'_>> {
        let features = Part::short(stages::FEATURES, |rec| {
            let (field, buffer) = (&self.field, &self.transfer_buffer);
            buffer.record(rec, &self.transfer)?;
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::UniformRead]);
            self.features.record(rec, &self.classes, field, &self.transfer, buffer)
        });
        let occupancy = Part::short(stages::OCCUPANCY, |rec| {
            let (field, transfer) = self.opacities();
            self.occupancy_kernel.record(rec, field, transfer, &self.features, &self.occupancy)?;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
            Ok(())
        });
        vec![features, occupancy]
    }

    /// Records the clips at their poses, and what they do to each brick; `reach` as [`ClipBricks::record`] has it.
    pub(crate) fn record_clip_bricks(
        &self,
        rec: &mut Recorder,
        kernel: &ClipBricks,
        reach: f32,
        clip_bricks: &Buffer,
    ) -> Result<()> {
        self.clip_set.record(rec, &self.clips, self.half_diagonal())?;
        let support = self.setup.anti_aliasing.support;
        kernel.record(rec, &self.field, &self.clip_set, reach, support, clip_bricks)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        Ok(())
    }
}
