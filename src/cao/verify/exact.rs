//! Is V_AO what a full computation gives?

use super::compare::{Compare, Difference};
use crate::Result;
use crate::renderer::Renderer;
use cao_gpu::Timings;

/// Recomputes the ambient volume in full, beside the current one, and compares the two bit by bit on every voxel that has
/// a value. Also returns the time of the full recomputation. Refuses while the ambient volume is out of date. Uses the device's queue
/// and waits for it.
pub fn verify(renderer: &Renderer, progress: &mut dyn FnMut(f64)) -> Result<(Difference, Timings)> {
    renderer.complete()?;
    let expected = renderer.unoccluded()?;
    let (subject, ambient) = (renderer.subject(), renderer.ambient());
    let (full, timings) = ambient.recompute(subject, &expected, progress)?;
    let fields = ambient.fields();
    let difference = Compare::new(&subject.gpu)?.run(
        &subject.gpu,
        &subject.field,
        subject.setup.scope,
        &full.list,
        fields.opacity,
        full.recomputed,
        &expected,
        fields.ambient,
    )?;
    Ok((difference, timings))
}
