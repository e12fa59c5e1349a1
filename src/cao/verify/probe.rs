//! Cast rays of other settings in a few bricks of a scene, and take their time: what a planner measures (measure.md §5).

use crate::cast::lao::{Bindings, Lao, Work};
use crate::drive::Take;
use crate::field::bricks::BrickList;
use crate::field::volume_image;
use crate::field::{BRICK, Field};
use crate::host::read_values;
use crate::renderer::Renderer;
use cao_gpu::Result;
use cao_gpu::{Access, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Phase, Stage};
use cao_model::occlusion::Occlusion;
use cao_model::settings::Scope;
use std::time::Instant;

/// Runs that a short time is the median of; of long ones the shorter of two counts.
const RUNS: usize = 3;

/// A dispatch of less than this many ms is made longer: a device that is not full takes as long for one brick as for all.
const LONG_ENOUGH_MS: f64 = 10.0;

/// Most times that a brick stands in a list to make it longer.
const MOST_REPEATS: usize = 64;

const PROBE: Stage = Stage::new("probe", Phase::Ambient);

/// Brings V_o up to date and lends it to trials of other rays; also returns it, x fastest. V_AO goes out of date: the next
/// update computes everything. Uses the device's queue and waits for it.
pub fn probe(renderer: &mut Renderer) -> crate::Result<(Probe<'_>, Vec<f32>)> {
    renderer.update_opacity()?;
    let (subject, opacity) = (renderer.subject(), renderer.ambient().fields().opacity);
    let values = read_values(&subject.gpu, opacity)?;
    let (scope, reference_mm) = (subject.setup.scope, subject.reference_mm());
    Ok((Probe::new(&subject.gpu, &subject.field, opacity, scope, reference_mm)?, values))
}

/// A scene to try settings on.
pub struct Probe<'a> {
    gpu: &'a Gpu,
    field: &'a Field,
    opacity: &'a Image,
    scope: Scope,
    reference_mm: f32,
    lao: Lao,
    /// Bound, and not read where everything listed is computed.
    mask: Image,
    ambient: Image,
}

impl<'a> Probe<'a> {
    /// For V_o as it is, opacity per `reference_mm`. Takes 4 bytes a voxel. Uses the device's queue and waits for it.
    pub fn new(
        gpu: &'a Gpu,
        field: &'a Field,
        opacity: &'a Image,
        scope: Scope,
        reference_mm: f32,
    ) -> Result<Self> {
        let one = ImageDesc {
            dims: [1; 3],
            layers: 1,
            format: Format::R8Uint,
            kind: ImageKind::D3,
            usage: ImageUse::SAMPLED,
        };
        let mask = gpu.image("no mask", &one)?;
        let ambient = volume_image(gpu, "probe ambient", field, Format::R32Float)?;
        let mut rec = gpu.recorder("probe volumes")?;
        rec.discard(&mask);
        rec.discard(&ambient);
        rec.submit_and_wait()?;
        Ok(Self { gpu, field, opacity, scope, reference_mm, lao: Lao::new(gpu)?, mask, ambient })
    }

    /// Reference length of the opacity in mm.
    pub fn reference_mm(&self) -> f32 {
        self.reference_mm
    }

    /// First voxel of a brick, and its voxels along x, y, z.
    pub fn brick(&self, brick: u32) -> ([u32; 3], [u32; 3]) {
        let [x, y, _] = self.field.bricks();
        let first = [brick % x, brick / x % y, brick / (x * y)].map(|c| c * BRICK);
        (first, std::array::from_fn(|i| BRICK.min(self.field.dims[i] - first[i])))
    }

    /// Ambient factors of these bricks, each x fastest, and the time in ms that a brick takes among many.
    /// Uses the device's queue and waits for it.
    pub fn run(&self, occlusion: &Occlusion, bricks: &[u32]) -> Result<(Vec<Vec<f32>>, f64)> {
        let mut rec = self.gpu.recorder("probe rays")?;
        self.lao.record_rays(&mut rec, occlusion)?;
        rec.submit_and_wait()?;
        let once = self.dispatches(occlusion, bricks, 1)?;
        if once >= LONG_ENOUGH_MS {
            let ms = once.min(self.dispatches(occlusion, bricks, 1)?);
            return Ok((self.read(bricks)?, ms / bricks.len() as f64));
        }
        let repeats = (LONG_ENOUGH_MS / once.max(1e-6)).ceil().clamp(1.0, MOST_REPEATS as f64) as usize;
        let ms = self.dispatches(occlusion, &bricks.repeat(repeats), RUNS)?;
        Ok((self.read(bricks)?, ms / (bricks.len() * repeats).max(1) as f64))
    }

    /// Median time in ms of some equal dispatches.
    fn dispatches(&self, occlusion: &Occlusion, bricks: &[u32], runs: usize) -> Result<f64> {
        if bricks.is_empty() {
            return Ok(0.0);
        }
        let list = BrickList::of(self.gpu, bricks)?;
        let bindings = Bindings {
            opacity: self.opacity,
            list: &list,
            mask: &self.mask,
            precomputed: self.opacity,
            ambient: &self.ambient,
        };
        let mut rec = self.gpu.recorder("probe")?;
        for _ in 0..runs {
            rec.barrier(
                &[Access::TransferWrite, Access::TransferRead, Access::StorageWrite],
                &[Access::StorageRead, Access::StorageWrite, Access::SampledRead],
            );
            rec.stage(PROBE)?;
            let (field, work, all) = (self.field, Work::Full, Take::These(0..bricks.len() as u32));
            let (reference_mm, scope) = (self.reference_mm, self.scope);
            self.lao.record(&mut rec, field, occlusion, reference_mm, scope, work, bindings, &all)?;
            rec.end_stage()?;
        }
        let start = Instant::now();
        let mut times: Vec<f64> = rec.submit_and_wait()?.into_iter().map(|timing| timing.ms).collect();
        times.sort_by(f64::total_cmp);
        // Queues without timestamps leave the program's clock.
        let by_clock = start.elapsed().as_secs_f64() * 1e3 / runs as f64;
        Ok(times.get(times.len() / 2).copied().unwrap_or(by_clock))
    }

    fn read(&self, bricks: &[u32]) -> Result<Vec<Vec<f32>>> {
        if bricks.is_empty() {
            return Ok(Vec::new());
        }
        let room = 4 * u64::from(BRICK.pow(3));
        let read_back =
            self.gpu.buffer("probe read-back", room * bricks.len() as u64, BufferUse::Readback)?;
        let mut rec = self.gpu.recorder("read probe")?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        for (i, &brick) in bricks.iter().enumerate() {
            let (first, size) = self.brick(brick);
            rec.copy_image_to_buffer(&self.ambient, 0, first, size, &read_back, room * i as u64)?;
        }
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        (0..bricks.len())
            .map(|i| {
                let bytes = 4 * u64::from(self.brick(bricks[i]).1.iter().product::<u32>());
                Ok(bytemuck::pod_collect_to_vec(&read_back.read(room * i as u64, bytes)?))
            })
            .collect()
    }
}
