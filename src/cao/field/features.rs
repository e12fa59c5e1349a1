//! Features on the device: which voxel is whose, how each is shown, and the opacities that this makes of the volume's
//! (`V_f(x) = min(s_k TF_o(V(x)), 1)`, `cao_model::feature`).
//!
//! What comes after reads V_f as a volume of its own, whose values are opacities ([`FeatureSet::opacities`]), so that voxels are classified
//! first and interpolated then.
//!
//! In: `volume`, `transfer`. Out: `index` f (3D r8uint, 0 none; a texel of 0 where there are no features), `table`, V_f (3D r32float). Memory:
//! 5 bytes a voxel with features, none without. Cost: one read of V and one write a voxel after an edit of values, opacities or features;
//! by intervals one more of each.

use crate::Result;
use crate::field::transfer::TransferBuffer;
use crate::field::{Field, volume_image};
use bytemuck::Zeroable;
use cao_gpu::{
    Access, Buffer, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Pipeline, Recorder,
};
use cao_kernels::features as kernel;
use cao_kernels::shared::features as shared;
use cao_model::feature::{Features, Voxels};
use cao_model::transfer::TransferFunction;

const _: () = assert!(shared::MOST_FEATURES as usize == Features::MOST);

/// The kernel `features`.
pub struct Classes {
    by_intervals: Pipeline,
    main: Pipeline,
}

impl Classes {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { by_intervals: pipeline("by_intervals")?, main: pipeline("main")? })
    }
}

/// The features of a volume in device memory.
pub struct FeatureSet {
    /// Bound as `feature_index`: the number of each voxel's feature.
    pub index: Image,
    /// Bound as `features`: how they are shown.
    pub table: Buffer,
    /// What they are.
    pub features: Features,
    /// V_f as a volume, and the function that says that its values are opacities; colours are of values.
    classified: Option<(Field, TransferBuffer)>,
}

impl FeatureSet {
    /// The features of a volume, which fit it ([`Features::check`]). Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field, features: Features) -> Result<Self> {
        let none = features.is_empty();
        let index = match none {
            true => gpu.image(
                "no features",
                &ImageDesc {
                    dims: [1; 3],
                    layers: 1,
                    format: Format::R8Uint,
                    kind: ImageKind::D3,
                    usage: ImageUse::SAMPLED,
                },
            )?,
            false => volume_image(gpu, "features", field, Format::R8Uint)?,
        };
        let mut rec = gpu.recorder("features")?;
        rec.discard(&index);
        let classified = match none {
            true => None,
            false => {
                let volume = volume_image(gpu, "opacity by feature", field, Format::R32Float)?;
                rec.discard(&volume);
                let classified = Field {
                    volume,
                    scale: 1.0,
                    bias: 0.0,
                    levels: 1.0,
                    dims: field.dims,
                    spacing: field.spacing,
                };
                Some((classified, TransferBuffer::new(gpu)?))
            }
        };
        let table = gpu.buffer("feature table", size_of::<shared::Features>() as u64, BufferUse::Device)?;
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.fill(&table, 0, table.bytes(), 0)?;
        rec.submit_and_wait()?;
        if let (false, Voxels::Labels(labels)) = (none, &features.voxels) {
            upload(gpu, &index, labels)?;
        }
        Ok(Self { index, table, features, classified })
    }

    /// Takes features of the same voxels ([`Features::same_voxels`]). They count from the next [`Self::record`] on.
    pub fn show(&mut self, features: Features) {
        self.features = features;
    }

    /// Whether which voxel is whose depends on values.
    pub fn follow_values(&self) -> bool {
        !self.features.is_empty() && matches!(self.features.voxels, Voxels::Intervals(_))
    }

    /// V_f as a volume and its transfer function, where there are features.
    pub fn opacities(&self) -> Option<(&Field, &TransferBuffer)> {
        self.classified.as_ref().map(|(field, transfer)| (field, transfer))
    }

    /// Makes V_f, and by intervals the index, of a volume under a transfer function, which is on the device too; nothing where there are no
    /// features. Visible to all shaders.
    pub fn record(
        &self,
        rec: &mut Recorder,
        classes: &Classes,
        field: &Field,
        function: &TransferFunction,
        transfer: &TransferBuffer,
    ) -> Result<()> {
        let Some((classified, opacities)) = &self.classified else { return Ok(()) };
        opacities
            .record(rec, &TransferFunction { opacity: vec![[0.0, 0.0], [1.0, 1.0]], ..function.clone() })?;
        self.record_table(rec, field)?;
        rec.barrier(
            &[Access::SampledRead, Access::StorageRead, Access::StorageWrite],
            &[Access::StorageWrite],
        );
        let Field { dims, levels, bias, .. } = *field;
        let slope = field.scale / levels;
        let params = kernel::FeaturesParams { dims, levels, slope, bias, pad: Default::default() };
        let push = bytemuck::bytes_of(&params);
        if let Voxels::Intervals(_) = self.features.voxels {
            let binds = kernel::ByIntervalsBindings {
                volume: &field.volume,
                features: &self.table,
                found: &self.index,
            };
            rec.dispatch_over(&classes.by_intervals, &binds, push, dims)?;
            rec.barrier(&[Access::StorageWrite], &[Access::SampledRead]);
        }
        let binds = kernel::MainBindings {
            volume: &field.volume,
            transfer: &transfer.buffer,
            features: &self.table,
            feature_index: &self.index,
            classified: &classified.volume,
        };
        rec.dispatch_over(&classes.main, &binds, push, dims)?;
        rec.barrier(&[Access::StorageWrite], &[Access::SampledRead]);
        Ok(())
    }

    /// Writes how features are shown and makes it visible to all shaders.
    pub fn record_table(&self, rec: &mut Recorder, field: &Field) -> Result<()> {
        rec.barrier(&[Access::UniformRead], &[Access::TransferWrite]);
        rec.update(&self.table, 0, bytemuck::bytes_of(&self.table(field)))?;
        rec.barrier(&[Access::TransferWrite], &[Access::UniformRead]);
        Ok(())
    }

    fn table(&self, field: &Field) -> shared::Features {
        let mut table = shared::Features::zeroed();
        table.count = self.features.list.len() as u32;
        table.any_spared = u32::from(self.features.any_spared());
        (table.scale, table.bias) = (field.scale, field.bias);
        // Voxels without a feature are as the transfer function has them.
        table.each[0].factor = 1.0;
        for (slot, feature) in table.each[1..].iter_mut().zip(&self.features.list) {
            slot.factor = feature.factor();
            slot.spared = u32::from(feature.spared);
            slot.colour = feature.colour.map_or([0.0; 4], |[r, g, b]| [r, g, b, 1.0]);
        }
        if let Voxels::Intervals(all) = &self.features.voxels {
            for (slot, interval) in table.each[1..].iter_mut().zip(all) {
                [slot.low, slot.high] = *interval;
            }
        }
        table
    }
}

/// Writes the number of every voxel's feature, whole slices at a time, at most 64 MiB of staging.
fn upload(gpu: &Gpu, index: &Image, labels: &[u8]) -> Result<()> {
    let [x, y, z] = index.desc().dims;
    let slice = x as usize * y as usize;
    let slices = ((64 << 20) / slice).clamp(1, z as usize);
    let staging = gpu.buffer("features staging", (slice * slices) as u64, BufferUse::Upload)?;
    for (at, part) in labels.chunks(slice * slices).enumerate() {
        staging.write(0, part)?;
        let mut rec = gpu.recorder("upload features")?;
        rec.barrier(&[Access::SampledRead], &[Access::TransferWrite]);
        let to = [0, 0, (at * slices) as u32];
        rec.copy_buffer_to_image(&staging, 0, index, to, [x, y, (part.len() / slice) as u32])?;
        rec.submit_and_wait()?;
    }
    Ok(())
}
