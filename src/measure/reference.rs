//! The truth that methods are measured against (measure.md §1), with its own error: everything is computed once more at
//! twice the resolution, on a sample, and the change is stated.
//!
//! * [`ambient`]: the integral that ambient occlusion stands for, at the voxels that count;
//! * [`literal`]: what the paper's sum converges to with ever more rays;
//! * [`image()`]: the picture with ambient occlusion evaluated at every sample of its rays instead of read from a volume.

use super::error::{Errors, counting, errors};
use super::random::Random;
use crate::kernels::reference::{Points, Reference as Kernel, upload_clearance};
use crate::{Error, Result};
use cao::drive::in_parts;
use cao::field::Field;
use cao::gpu;
use cao_gpu::Gpu;
use cao_model::light::AmbientLight;
use cao_model::occlusion::Integral;
use cao_model::values::Values;
use cao_model::view::View;
use cao_model::volume::Volume;
use cao_twin::Grid;
use cao_twin::draw::raycast::{Frame, Image, ambient_positions, raycast_lit};

const REFERENCE: gpu::Stage = gpu::Stage::new("reference", gpu::Phase::Ambient);

/// How well a reference is to converge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Directions from each point.
    pub directions: u32,
    /// Samples along the smallest spacing.
    pub steps_per_voxel: u32,
    /// Most voxels to compute; where more count, a stratified sample of them.
    pub max_voxels: usize,
    /// Where light comes from; of one colour.
    pub light: AmbientLight,
}

impl Plan {
    /// measure.md §1: at least 1000 directions, steps of an eighth of a voxel, every voxel that counts.
    pub const FULL: Self =
        Self { directions: 1000, steps_per_voxel: 8, max_voxels: usize::MAX, light: AmbientLight::Uniform };
    /// For a first look: some thousand voxels at a quarter of the directions and twice the step.
    pub const QUICK: Self = Self { directions: 256, steps_per_voxel: 4, max_voxels: 4000, ..Self::FULL };
}

/// Voxels, or pixels, that are computed once more at twice the resolution.
const CHECKED: usize = 1000;

/// Converged ambient values of a volume.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Ambient value of each voxel, x fastest; NaN where not computed.
    pub ambient: Vec<f32>,
    /// Voxels that were computed: those that count ([`counting`]), or a sample of them.
    pub counts: Vec<bool>,
    /// Voxels that count, computed or not.
    pub counting: usize,
    /// What was computed.
    pub integral: Integral,
    /// Change at a sample of the computed voxels when directions are doubled, and steps too unless they are the method's.
    pub convergence: Errors,
    /// Time of the device in ms.
    pub device_ms: f64,
}

/// The ambient reference of an opacity volume after clipping (as `Renderer::read_opacity` has it), opacity per
/// `reference_mm`. `progress` hears the share done. Uses the device's queue and waits for it.
#[expect(clippy::too_many_arguments, reason = "volume, lengths and settings, each named once")]
pub fn ambient(
    gpu: &Gpu,
    grid: &Grid,
    opacity: &[f32],
    radius_mm: f64,
    offset_mm: f64,
    reference_mm: f64,
    plan: &Plan,
    progress: &mut dyn FnMut(f64),
) -> Result<Reference> {
    let integral = integral(radius_mm, offset_mm, grid, plan)?;
    volume(gpu, grid, opacity, integral, reference_mm, plan, progress)
}

/// The literal reference: CAO eq. (2) and (3) at steps of the smallest spacing, with the plan's directions. As [`ambient`]
/// otherwise.
pub fn literal(
    gpu: &Gpu,
    grid: &Grid,
    opacity: &[f32],
    radius_mm: f64,
    reference_mm: f64,
    plan: &Plan,
    progress: &mut dyn FnMut(f64),
) -> Result<Reference> {
    let literal = Integral::literal(radius_mm, plan.directions, grid.min_spacing());
    let integral = Integral { light: plan.light, ..literal };
    check("radius_mm", radius_mm, 0.0)?;
    volume(gpu, grid, opacity, integral, reference_mm, plan, progress)
}

/// Ambient reference at voxels in several places, each list of voxels (indices into `opacity`) in a box of the volume of its own,
/// so that the cost does not depend on the volume's size; in the order given. No convergence is measured. As [`ambient`] otherwise.
#[expect(clippy::too_many_arguments, reason = "volume, lengths and settings, each named once")]
pub fn ambient_in(
    gpu: &Gpu,
    grid: &Grid,
    opacity: &[f32],
    places: &[Vec<usize>],
    radius_mm: f64,
    offset_mm: f64,
    reference_mm: f64,
    plan: &Plan,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Vec<f32>>> {
    let integral = integral(radius_mm, offset_mm, grid, plan)?;
    let kernel = Kernel::new(gpu)?;
    let mut found = Vec::new();
    for (i, voxels) in places.iter().enumerate() {
        let at: Vec<[usize; 3]> = voxels.iter().map(|v| grid.voxel(*v)).collect();
        // All that a ray interpolates.
        let reach = |axis: usize| (radius_mm / grid.spacing[axis]).ceil() as usize + 1;
        let low: [usize; 3] =
            std::array::from_fn(|a| at.iter().map(|v| v[a]).min().unwrap_or(0).saturating_sub(reach(a)));
        let high: [usize; 3] = std::array::from_fn(|a| {
            (at.iter().map(|v| v[a]).max().unwrap_or(0) + reach(a) + 1).min(grid.dims[a])
        });
        let part = Grid { dims: std::array::from_fn(|a| high[a] - low[a]), ..*grid };
        let mut values = Vec::with_capacity(part.len());
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                let row = grid.index([low[0], y, z]);
                values.extend_from_slice(&opacity[row..row + part.dims[0]]);
            }
        }
        let positions: Vec<[f64; 3]> =
            at.iter().map(|v| std::array::from_fn(|a| (v[a] - low[a]) as f64)).collect();
        let scene = Scene::new(gpu, &kernel, &part, &values)?;
        found.push(scene.evaluate(&positions, &integral, reference_mm, &mut |_| ())?.0);
        progress((i + 1) as f64 / places.len() as f64);
    }
    Ok(found)
}

/// The ambient reference at points of the volume, in index coordinates, rather than at its voxels; no voxels are left out and none is
/// computed twice. As [`ambient`] otherwise.
#[expect(clippy::too_many_arguments, reason = "volume, lengths and settings, each named once")]
pub fn ambient_at(
    gpu: &Gpu,
    grid: &Grid,
    opacity: &[f32],
    points: &[[f64; 3]],
    radius_mm: f64,
    offset_mm: f64,
    reference_mm: f64,
    plan: &Plan,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<f32>> {
    let integral = integral(radius_mm, offset_mm, grid, plan)?;
    let kernel = Kernel::new(gpu)?;
    let scene = Scene::new(gpu, &kernel, grid, opacity)?;
    Ok(scene.evaluate(points, &integral, reference_mm, progress)?.0)
}

/// Any integral at voxels of volumes, one after the other, of opacity per `reference_mm`: for who needs thousands, and their error not.
pub struct Evaluator<'a> {
    gpu: &'a Gpu,
    kernel: Kernel,
}

impl<'a> Evaluator<'a> {
    /// Builds the pipeline.
    pub fn new(gpu: &'a Gpu) -> Result<Self> {
        Ok(Self { gpu, kernel: Kernel::new(gpu)? })
    }

    /// Values of these voxels (indices into `opacity`), in their order. Uses the device's queue and waits for it.
    pub fn evaluate(
        &self,
        grid: &Grid,
        opacity: &[f32],
        voxels: impl Iterator<Item = usize>,
        integral: &Integral,
        reference_mm: f64,
    ) -> Result<Vec<f32>> {
        let at: Vec<[f64; 3]> = voxels.map(|i| grid.voxel(i).map(|c| c as f64)).collect();
        let scene = Scene::new(self.gpu, &self.kernel, grid, opacity)?;
        Ok(scene.evaluate(&at, integral, reference_mm, &mut |_| ())?.0)
    }
}

/// The ambient integral of these lengths.
fn integral(radius_mm: f64, offset_mm: f64, grid: &Grid, plan: &Plan) -> Result<Integral> {
    check("radius_mm", radius_mm, 0.0)?;
    check("offset_mm", offset_mm, 0.0)?;
    check("steps_per_voxel", plan.steps_per_voxel.into(), 1.0)?;
    let smallest = grid.min_spacing();
    let ambient = Integral::ambient(radius_mm, offset_mm, plan.steps_per_voxel, plan.directions, smallest);
    Ok(Integral { light: plan.light, ..ambient })
}

fn check(what: &str, value: f64, least: f64) -> Result<()> {
    if value.is_finite() && value >= least {
        return Ok(());
    }
    Err(Error::refused(what, format!("{value}; expected a finite number of at least {least}")))
}

fn volume(
    gpu: &Gpu,
    grid: &Grid,
    opacity: &[f32],
    integral: Integral,
    reference_mm: f64,
    plan: &Plan,
    progress: &mut dyn FnMut(f64),
) -> Result<Reference> {
    let kernel = Kernel::new(gpu)?;
    let scene = Scene::new(gpu, &kernel, grid, opacity)?;
    let counts = counting(grid, opacity);
    let all: Vec<usize> = (0..grid.len()).filter(|i| counts[*i]).collect();
    let computed = sample(&all, plan.max_voxels);
    let checked = sample(&computed, CHECKED);
    let centres = |voxels: &[usize]| -> Vec<[f64; 3]> {
        voxels.iter().map(|i| grid.voxel(*i).map(|c| c as f64)).collect()
    };
    let doubled = integral.doubled();
    let share = share(&integral, computed.len(), &doubled, checked.len());
    let (values, ms) =
        scene.evaluate(&centres(&computed), &integral, reference_mm, &mut |part| progress(share * part))?;
    let (finer, finer_ms) = scene.evaluate(&centres(&checked), &doubled, reference_mm, &mut |part| {
        progress(share + (1.0 - share) * part);
    })?;

    let mut ambient = vec![f32::NAN; grid.len()];
    let mut counts = vec![false; grid.len()];
    for (&voxel, value) in computed.iter().zip(values) {
        ambient[voxel] = value;
        counts[voxel] = true;
    }
    let coarser: Vec<f32> = checked.iter().map(|i| ambient[*i]).collect();
    let convergence = errors(&coarser, &finer, &vec![true; finer.len()]);
    Ok(Reference { ambient, counts, counting: all.len(), integral, convergence, device_ms: ms + finer_ms })
}

/// Part of the work that the first of two evaluations is.
fn share(first: &Integral, first_points: usize, second: &Integral, second_points: usize) -> f64 {
    let work = |i: &Integral, points: usize| {
        f64::from(i.directions) * f64::from(i.samples.max(1)) * points.max(1) as f64
    };
    1.0 / (1.0 + work(second, second_points) / work(first, first_points))
}

/// All of them, or `most`: one at random from each of as many equal runs. The same each time.
fn sample(all: &[usize], most: usize) -> Vec<usize> {
    if all.len() <= most {
        return all.to_vec();
    }
    let mut random = Random::new(1);
    let run = |i: usize| i * all.len() / most;
    (0..most).map(|i| all[run(i) + random.below((run(i + 1) - run(i)) as u64) as usize]).collect()
}

/// A picture whose every sample has its own ambient factor.
#[derive(Clone, Debug)]
pub struct ImageReference {
    /// The picture.
    pub image: Image,
    /// Pixels that show anything.
    pub covered: usize,
    /// Points at which the ambient factor was evaluated.
    pub points: usize,
    /// Change of the colours (premultiplied linear red, green, blue) of a sample of those pixels when directions are doubled and the steps of
    /// both kinds of rays halved.
    pub convergence: Errors,
    /// Time of the device in ms.
    pub device_ms: f64,
}

/// The image reference: the ray cast of [`cao_twin::draw::raycast`] with the plan's steps on the smallest spacing, the ambient
/// factor of each of its samples evaluated by the ambient integral of `opacity`, V_o, around the very point that the sample shows. For small images: every sample of
/// every ray costs what a voxel costs. The frame's own `ambient` only says where the air of a surface is, and its `step_mm` is not used. Uses the device's queue and waits for it.
#[expect(clippy::too_many_arguments, reason = "scene, lengths and settings, each named once")]
pub fn image(
    gpu: &Gpu,
    frame: &Frame,
    opacity: &[f32],
    view: &View,
    size: [usize; 2],
    radius_mm: f64,
    offset_mm: f64,
    plan: &Plan,
    progress: &mut dyn FnMut(f64),
) -> Result<ImageReference> {
    let kernel = Kernel::new(gpu)?;
    let scene = Scene::new(gpu, &kernel, &frame.grid, opacity)?;
    let smallest = frame.grid.min_spacing();
    let integral = integral(radius_mm, offset_mm, &frame.grid, plan)?;
    let fine = Frame { step_mm: smallest / f64::from(plan.steps_per_voxel), ..*frame };
    let finer = Frame { step_mm: 0.5 * fine.step_mm, ..fine };
    let pixels: Vec<usize> = (0..size[0] * size[1]).collect();
    let positions = ambient_positions(&fine, view, size, &pixels);
    let covered: Vec<usize> = pixels.iter().copied().filter(|i| !positions[*i].is_empty()).collect();
    let checked = sample(&covered, CHECKED_PIXELS);
    let finer_positions = ambient_positions(&finer, view, size, &checked);
    let count = |positions: &[Vec<[f64; 3]>]| positions.iter().map(Vec::len).sum::<usize>();
    let (points, finer_points) = (count(&positions), count(&finer_positions));

    let doubled = integral.doubled();
    let share = share(&integral, points, &doubled, finer_points);
    let mut lit =
        |frame: &Frame, pixels: &[usize], positions: &[Vec<[f64; 3]>], integral, from: f64, part: f64| {
            let (values, ms) =
                scene.evaluate(&positions.concat(), integral, frame.reference_mm, &mut |done| {
                    progress(from + part * done);
                })?;
            let mut values = values.into_iter().map(f64::from);
            let by_pixel: Vec<Vec<f64>> =
                positions.iter().map(|p| values.by_ref().take(p.len()).collect()).collect();
            Ok::<_, Error>((raycast_lit(frame, view, size, pixels, &by_pixel), ms))
        };
    let (image, ms) = lit(&fine, &pixels, &positions, &integral, 0.0, share)?;
    let (finer, finer_ms) = lit(&finer, &checked, &finer_positions, &doubled, share, 1.0 - share)?;
    let flat = |colours: &mut dyn Iterator<Item = [f32; 4]>| -> Vec<f32> {
        colours.flat_map(|[r, g, b, _]| [r, g, b]).collect()
    };
    let coarse = flat(&mut checked.iter().map(|i| image.colour[*i]));
    let fine = flat(&mut finer.colour.into_iter());
    let convergence = errors(&coarse, &fine, &vec![true; fine.len()]);
    Ok(ImageReference { image, covered: covered.len(), points, convergence, device_ms: ms + finer_ms })
}

/// Pixels of an image reference that are computed once more at twice the resolution, which costs eight times as much each.
const CHECKED_PIXELS: usize = 64;

/// Most samples of a ray: at thousands of directions, more keep a device busy with one point for longer than its driver waits.
const MAX_SAMPLES: u32 = 1 << 16;

/// An opacity volume on the device, with the rim that the kernel asks for.
struct Scene<'a> {
    gpu: &'a Gpu,
    kernel: &'a Kernel,
    field: Field,
    clearance: gpu::Image,
}

impl<'a> Scene<'a> {
    fn new(gpu: &'a Gpu, kernel: &'a Kernel, grid: &Grid, opacity: &[f32]) -> Result<Self> {
        if opacity.len() != grid.len() || !opacity.iter().all(|a| (0.0..=1.0).contains(a)) {
            return Err(Error::refused(
                "opacity of a reference",
                format!(
                    "{} values; expected one from 0 to 1 for each of {} voxels",
                    opacity.len(),
                    grid.len()
                ),
            ));
        }
        let rimmed = Grid { dims: grid.dims.map(|d| d + 2), ..*grid };
        let mut values = vec![0.0; rimmed.len()];
        for (row, chunk) in opacity.chunks(grid.dims[0]).enumerate() {
            let (y, z) = (row % grid.dims[1], row / grid.dims[1]);
            let first = rimmed.index([1, y + 1, z + 1]);
            values[first..first + chunk.len()].copy_from_slice(chunk);
        }
        let volume = Volume::new(rimmed.dims, rimmed.spacing, Values::F32(values))?;
        let Values::F32(values) = &volume.values else { unreachable!("made above") };
        let field = Field::upload(gpu, &volume)?;
        let clearance = upload_clearance(gpu, &field, values)?;
        Ok(Self { gpu, kernel, field, clearance })
    }

    /// Ambient value at each position (index coordinates inside the volume) and the device's time in ms.
    fn evaluate(
        &self,
        positions: &[[f64; 3]],
        integral: &Integral,
        reference_mm: f64,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Vec<f32>, f64)> {
        check("reference_mm", reference_mm, f64::MIN_POSITIVE)?;
        if integral.samples > MAX_SAMPLES {
            return Err(cao_model::Error::Limit {
                what: "samples of a reference's ray".into(),
                needed: integral.samples.into(),
                limit: MAX_SAMPLES.into(),
                hint: "make the radius smaller or take fewer steps a voxel".into(),
            }
            .into());
        }
        if positions.is_empty() {
            return Ok((Vec::new(), 0.0));
        }
        let points = Points::upload(self.gpu, positions, integral)?;
        // The first part is small enough for any device.
        let samples = f64::from(integral.directions) * f64::from(integral.samples.max(1));
        let first = (4e6 / samples).clamp(1.0, 1e6) as u32;
        let (field, clearance) = (&self.field, &self.clearance);
        let mut record = |rec: &mut gpu::Recorder, items: std::ops::Range<u32>| {
            let (base, now) = (items.start, items.len() as u32);
            Ok(self.kernel.record(rec, field, clearance, integral, reference_mm, &points, base, now)?)
        };
        let ms = in_parts(self.gpu, REFERENCE, points.count, first, &mut record, progress)?;
        Ok((points.read(self.gpu)?, ms))
    }
}
