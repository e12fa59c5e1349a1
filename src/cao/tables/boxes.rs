//! Values from boxes of a summed-area table (docs/tables.md; `cao_twin::tables::boxes` has the equations): the mean of one box, after Díaz
//! et al. 2010, or shells of them, after Schlegel, Makhinya and Pajarola 2011.
//!
//! In: `opacity` V_o (3D r16unorm), for which voxels need a value; `table` of [`super::sums`]; the list of bricks. Out: `ambient` V_AO (3D
//! r16unorm) in the listed bricks, one write a voxel. Cost: 8 reads of the table a box.

use super::sums::{Counted, MOST_EXTINCTION};
use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::field::ratios;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::boxes as kernel;
use cao_model::occlusion::{Occlusion, Quadrature};
use cao_model::options::Options;
use cao_model::settings::Scope;

const _: () = assert!(kernel::MOST_SHELLS == Options::MOST_SHELLS);

/// The boxes of every voxel.
#[derive(Clone, Debug)]
pub struct BoxPlan {
    /// As the kernel reads them, the smallest first; none where there is no neighbourhood.
    pub shells: Vec<kernel::Shell>,
    /// What the table has to add up.
    pub counted: Counted,
    /// How far in voxels a change of opacity can change values: to the sides of the largest box, or to the neighbours that need one.
    pub reach: [u32; 3],
    rule: Quadrature,
    smallest_mm: f32,
}

impl BoxPlan {
    /// The boxes of these settings, which hold, at voxels of this spacing in mm: edges at whole smallest spacings, `shells` of them or as
    /// many as the radius has, and `half = round(edge / spacing)` voxels on each side of the centre.
    ///
    /// # Errors
    /// [`cao_model::Error::Limit`] for boxes whose sums leave fewer bits than [`Counted::FEWEST`].
    pub fn new(spacing: [f32; 3], occlusion: &Occlusion, shells: u32) -> cao_model::Result<Self> {
        let (rule, radius_mm) = (occlusion.quadrature, occlusion.radius_mm);
        let smallest_mm = spacing.into_iter().fold(f32::INFINITY, f32::min);
        let radius = f64::from(radius_mm) / f64::from(smallest_mm);
        // More are refused; u64 must hold their cube.
        let edge = radius.round().min(1e6) as u32;
        let count = if rule == Quadrature::Box { 1 } else { shells.min(edge) };
        // The k-th of n at round(k·edge / n).
        let edges = (1..=count).map(|k| (2 * k * edge + count) / (2 * count)).filter(|edge| *edge > 0);
        let half = |edge: u32| ratios(spacing).map(|ratio| (f64::from(edge) / ratio).round() as u32);
        let voxels = |half: [u32; 3]| half.iter().map(|h| u64::from(2 * h + 1)).product::<u64>();
        let extinction = rule == Quadrature::Published;
        let counted = Counted::of(voxels(half(edge)), extinction).ok_or_else(|| cao_model::Error::Limit {
            what: format!("voxels in a box of half-width {radius_mm} mm at {smallest_mm} mm a voxel"),
            needed: voxels(half(edge)),
            limit: 1 << (32 - Counted::FEWEST),
            hint: "make the radius smaller, 127 voxels where they are cubes, or use another method".into(),
        })?;
        let (mut boxes, mut inside, mut before) = (Vec::new(), 1, 0);
        for edge_of in edges {
            let here = voxels(half(edge_of));
            let (r, thickness) = (f64::from(edge_of), (edge_of - before) as f32);
            boxes.push(kernel::Shell {
                half: half(edge_of),
                // The mean of a box has its centre.
                added: if rule == Quadrature::Box { here } else { here - inside } as f32,
                thickness: if rule == Quadrature::Box { 1.0 } else { thickness },
                share: match rule {
                    Quadrature::Published => {
                        let part = f64::from(MOST_EXTINCTION) / f64::from(counted.levels());
                        (part / (radius * radius * r * r)) as f32
                    }
                    _ => (f64::from(thickness) / f64::from(edge)) as f32,
                },
                pad: Default::default(),
            });
            (inside, before) = (here, edge_of);
        }
        // What needs a value depends on a neighbour.
        let reach = half(edge).map(|voxels| voxels.max(1));
        Ok(Self { shells: boxes, counted, reach, rule, smallest_mm })
    }

    /// Reads of the table for a brick.
    pub fn brick_reads(&self) -> f64 {
        512.0 * 8.0 * self.shells.len().max(1) as f64
    }
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// Its sums.
    pub table: &'a Image,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

/// The kernel `boxes`, one pipeline a rule.
pub struct Boxes {
    whole: Pipeline,
    mean: Pipeline,
    end: Pipeline,
    published: Pipeline,
    shells: Buffer,
}

impl Boxes {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        let room = size_of::<kernel::Shell>() as u64 * u64::from(kernel::MOST_SHELLS);
        Ok(Self {
            whole: pipeline("whole")?,
            mean: pipeline("mean")?,
            end: pipeline("end")?,
            published: pipeline("published")?,
            shells: gpu.buffer("shells", room, BufferUse::Device)?,
        })
    }

    /// Writes the boxes of a plan; once after each change of the settings.
    pub fn record_shells(&self, rec: &mut Recorder, plan: &BoxPlan) -> Result<()> {
        rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
        if !plan.shells.is_empty() {
            rec.update(&self.shells, 0, bytemuck::cast_slice(&plan.shells))?;
        }
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
        Ok(())
    }

    /// Works on the list, or some of its bricks, with the boxes written last. `opacity` is per `reference_mm`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &BoxPlan,
        reference_mm: f32,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = kernel::BoxesParams {
            dims: field.dims,
            shells: plan.shells.len() as u32,
            bricks: field.bricks(),
            base: take.first(),
            levels: plan.counted.levels() as f32,
            unneeded: u32::from(scope == Scope::All),
            exponent: plan.smallest_mm / reference_mm,
            pad: Default::default(),
        };
        let binds = kernel::MeanBindings {
            opacity: b.opacity,
            table: b.table,
            shells: &self.shells,
            list: &b.list.buffer,
            ambient: b.ambient,
        };
        let pipeline = match plan.rule {
            Quadrature::Box => &self.whole,
            Quadrature::End => &self.end,
            Quadrature::Published => &self.published,
            _ => &self.mean,
        };
        take.dispatch(rec, pipeline, &binds, bytemuck::bytes_of(&params), &b.list.buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::RaySet;

    fn of(quadrature: Quadrature, radius_mm: f32) -> Occlusion {
        Occlusion { rays: RaySet::None, quadrature, radius_mm, ..Occlusion::paper(0.5) }
    }

    #[test]
    fn shells_end_at_the_radius_and_none_is_empty() {
        let edges = |radius_mm, shells| -> Vec<[u32; 3]> {
            let plan = BoxPlan::new([0.5, 0.5, 1.0], &of(Quadrature::Mean, radius_mm), shells).unwrap();
            assert!(plan.shells.iter().all(|shell| shell.added > 0.0 && shell.thickness > 0.0));
            let sum: f32 = plan.shells.iter().map(|shell| shell.share).sum();
            assert!(plan.shells.is_empty() || (sum - 1.0).abs() < 1e-6);
            plan.shells.iter().map(|shell| shell.half).collect()
        };
        assert_eq!(edges(4.0, 4), [[2, 2, 1], [4, 4, 2], [6, 6, 3], [8, 8, 4]]);
        assert_eq!(edges(1.5, 64), [[1, 1, 1], [2, 2, 1], [3, 3, 2]]);
        assert_eq!(edges(0.2, 16), [[0; 3]; 0]);
        // Five voxels in four shells: none has no thickness.
        assert_eq!(edges(2.5, 4).iter().map(|half| half[0]).collect::<Vec<_>>(), [1, 3, 4, 5]);
    }

    #[test]
    fn boxes_that_leave_too_few_bits_are_refused_with_what_is_allowed() {
        for rule in [Quadrature::Box, Quadrature::Mean, Quadrature::Published] {
            assert_eq!(BoxPlan::new([0.5; 3], &of(rule, 63.5), 16).unwrap().counted.bits, 8);
            let error = BoxPlan::new([0.5; 3], &of(rule, 64.0), 16).unwrap_err().to_string();
            assert!(
                error.contains("64 mm") && error.contains("16777216") && error.contains("127"),
                "{error}"
            );
        }
        // Long voxels have fewer in a box.
        assert!(BoxPlan::new([0.5, 0.5, 2.0], &of(Quadrature::Box, 90.0), 1).is_ok());
    }
}
