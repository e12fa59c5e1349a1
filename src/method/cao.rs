//! Contextual ambient occlusion (CAO §3): V_PAO once, then at each change of the clips only the voxels whose neighbourhood
//! changed. The list holds the bricks that changed now, and those that changed at the last update, which return to V_PAO;
//! V_AO is updated in place, and no other brick is touched.

use super::volumes::{Kernels, Settings, Volumes};
use crate::Result;
use crate::gpu::{Access, Recorder};
use crate::stage::bricks::Which;
use crate::stage::field::Field;
use crate::stage::lao::{Bindings, Work};

/// Records the update of V_AO from V_PAO, V_o and V_m.
pub fn record(
    rec: &mut Recorder,
    field: &Field,
    kernels: &Kernels,
    volumes: &Volumes,
    settings: &Settings,
) -> Result<()> {
    rec.stage("bricks")?;
    kernels.bricks.record(
        rec,
        field,
        Which::Changed,
        &volumes.opacity,
        &volumes.mask,
        &volumes.changed_before,
        &volumes.list,
    )?;
    rec.end_stage()?;

    rec.barrier(&[Access::SampledRead, Access::GraphicsRead, Access::TransferRead], &[Access::StorageWrite]);
    rec.stage("contextual")?;
    let bindings = Bindings {
        opacity: &volumes.opacity,
        list: &volumes.list,
        mask: &volumes.mask,
        precomputed: &volumes.precomputed,
        ambient: &volumes.ambient,
    };
    kernels.lao.record(
        rec,
        field,
        &settings.occlusion,
        settings.reference_mm,
        settings.scope,
        Work::ByMask,
        bindings,
    )?;
    rec.end_stage()?;
    rec.barrier(&[Access::StorageWrite], &[Access::SampledRead, Access::GraphicsRead, Access::TransferRead]);
    Ok(())
}
