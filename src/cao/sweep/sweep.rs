//! Line sweep (method.md §4): the window of every voxel along one lattice direction by two scans,
//! `A_k(x) = S_k / (W − o/|v|)` with `(t, S) = head ∘ suffix ∘ prefix` of affine pairs, summed as
//! `V_AO(x) = 1 − Σ_k w_k (1 − A_k(x))`, equal to evaluating each window directly (its twin) up to rounding.
//!
//! A line and its reverse are walked together. In: `opacity` V_o (3D r16unorm, read as a storage image), `todo` and `solid` of
//! [`super::near`], the list of [`super::sweep_list`]. Out: `ambient` V_AO (3D r16unorm), only in bricks to do. Cost a voxel and line,
//! that is for two directions: two reads of V_o (for n pieces 4 to 8 more each), two segments, four compositions, one read and
//! write of V_AO; for R/8 segments one composition more in eight voxels. Eight segments that meet no brick with opacity are not
//! read, and a ray that nothing occludes writes nothing.
//!
//! A ray's contribution is a whole number of 65535ths ([`LatticeRays::parts`]), so V_AO is an exact sum in any order, and what
//! a ray contributed can be taken back ([`Pass::TakeBack`]) by walking it through the opacities as they were. Every pass runs the same
//! entry point of this one module: so full and partial updates agree bit for bit.
//!
//! Variants that were tried, and where the time goes: `benches/runs/2026-11-24-llvmpipe-sweep/`.

use crate::field::{BRICK, Field};
use cao_gpu::Result;
use cao_gpu::{Gpu, Pipeline, Recorder};
use cao_kernels::sweep as kernel;
use cao_model::lattice::{LatticeRay, LatticeRays};
use cao_model::occlusion::{Occlusion, Quadrature};

/// Segments of a chunk.
const CHUNK: u32 = kernel::CHUNK as u32;

/// One direction and its reverse as the kernels walk them.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    /// The lattice direction, its last component that is not 0 positive; the weight is that of each of the two.
    pub ray: LatticeRay,
    /// The same weight in 65535ths, see [`LatticeRays::parts`].
    pub parts: u32,
    /// Axis along which lines are walked: one of stride 1 where there is one, x last, so that lanes lie along x.
    pub axis: usize,
    /// Segments of a window, behind the first of a ray: W − 1, at least 1.
    pub window: u32,
    /// Segments of a ray, W.
    pub segments: u32,
    /// Pieces of a segment.
    pub pieces: u32,
    /// Length of a segment in mm.
    pub length_mm: f64,
    /// Tiles of lines across the walk.
    pub tiles: [u32; 2],
    /// Most runs that the list can hold for it.
    pub runs: u32,
}

impl Walk {
    /// Tiles in all layers.
    pub fn tile_count(&self) -> u32 {
        self.tiles[0] * self.tiles[1] * self.ray.step[self.axis].unsigned_abs()
    }
}

/// A sweep: its directions in the order of summation, each with its reverse, and its settings.
#[derive(Clone, Debug)]
pub struct SweepPlan {
    /// The directions.
    pub walks: Vec<Walk>,
    /// How far the weights are from integrating the sphere, see [`LatticeRays`].
    pub residual: f64,
    /// Start of the rays in mm.
    pub offset_mm: f64,
    /// How far in mm a change of opacity reaches.
    pub reach_mm: f64,
}

impl SweepPlan {
    /// The plan of these settings.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] for another quadrature than the segment rule and for an offset beyond the first segment,
    /// [`cao_model::Error::Limit`] for a radius of more segments than a block holds.
    pub fn new(dims: [u32; 3], spacing: [f64; 3], occlusion: &Occlusion) -> cao_model::Result<Self> {
        if occlusion.quadrature != Quadrature::Segment {
            return Err(cao_model::Error::Config {
                what: "quadrature".into(),
                problem: format!(
                    "a sweep integrates by the rule `segment`, not `{}`; choose that, or method lao or cao",
                    occlusion.quadrature.name()
                ),
            });
        }
        let smallest = spacing.into_iter().fold(f64::INFINITY, f64::min);
        let offset_mm = f64::from(occlusion.lattice_offset(smallest));
        let radius_mm = f64::from(occlusion.radius_mm);
        let rays = LatticeRays::new(occlusion.rays, spacing);
        if radius_mm == 0.0 {
            return Ok(Self { walks: Vec::new(), residual: rays.residual, offset_mm, reach_mm: 0.0 });
        }
        let mut walks = Vec::new();
        let mut reach_mm: f64 = 0.0;
        // Sets are symmetric: the other half are the reverses, of equal weight.
        let parts = rays.parts();
        for (ray, parts) in rays.rays.into_iter().zip(parts).filter(|(ray, _)| ray.forward()) {
            let length_mm = ray.length_mm(spacing);
            if offset_mm >= length_mm {
                return Err(cao_model::Error::Config {
                    what: "offset_mm".into(),
                    problem: format!(
                        "{offset_mm} mm; a sweep's rays start within their first segment, < {length_mm:.3} mm"
                    ),
                });
            }
            let segments = ray.segments(spacing, radius_mm);
            if segments - 1 > kernel::MOST {
                return Err(cao_model::Error::Limit {
                    what: format!("segments of a ray along {:?} for radius {radius_mm} mm", ray.step),
                    needed: segments.into(),
                    limit: u64::from(kernel::MOST) + 1,
                    hint: "make the radius smaller, or use method lao or cao".into(),
                });
            }
            let pieces = ray.pieces(spacing, f64::from(occlusion.lattice_step(smallest)));
            // The corners that samples between lattice points interpolate lie beside the ray.
            let beside = if pieces > 1 { spacing.iter().map(|s| s * s).sum::<f64>().sqrt() } else { 0.0 };
            reach_mm = reach_mm.max(f64::from(segments) * length_mm + beside);
            let axis = [2, 1, 0]
                .into_iter()
                .filter(|&a| ray.step[a] != 0)
                .min_by_key(|&a| ray.step[a].unsigned_abs())
                .unwrap_or(2);
            let window = (segments - 1).max(1);
            let across: [usize; 2] = [usize::from(axis == 0), if axis == 2 { 1 } else { 2 }];
            let tiles = [0, 1].map(|i| dims[across[i]].div_ceil(kernel::TILE[i]));
            let stride = ray.step[axis].unsigned_abs();
            // A run is `lag` chunks at least, between two is one, and the last begins at the latest behind the last with a voxel.
            let size = window.min(CHUNK);
            let (chunks, lag) = (dims[axis].div_ceil(stride).div_ceil(size), window / size + 1);
            let runs = tiles[0] * tiles[1] * stride * (chunks / (lag + 1) + 1);
            walks.push(Walk { ray, parts, axis, window, segments, pieces, length_mm, tiles, runs });
        }
        Ok(Self { walks, residual: rays.residual, offset_mm, reach_mm })
    }
}

/// What the kernel reads and writes, whichever of its entry points runs.
pub use kernel::MainBindings as Bindings;

/// What a sweep does with its rays' contributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// All rays of bricks to compute anew are summed.
    Anew,
    /// Rays that meet a change: what they contributed is taken back.
    TakeBack,
    /// Rays that meet a change: what they contribute now is added.
    Amend,
}

impl Pass {
    /// As the kernel has them; `first`: the direction begins the sum.
    fn flags(self, first: bool) -> u32 {
        match self {
            Self::Anew if first => kernel::FIRST,
            Self::Anew => 0,
            Self::Amend => kernel::AMEND,
            Self::TakeBack => kernel::AMEND | kernel::ADD,
        }
    }
}

/// The kernel `sweep`.
pub struct Sweep {
    pipeline: Pipeline,
    short: Pipeline,
    pieces: Pipeline,
}

impl Sweep {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let build = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { pipeline: build("main")?, short: build("short")?, pieces: build("pieces")? })
    }

    /// Adds direction `index` of a plan and its reverse. The first one begins the sum.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &SweepPlan,
        index: usize,
        pass: Pass,
        reference_mm: f32,
        b: Bindings,
    ) -> Result<()> {
        let walk = &plan.walks[index];
        let start = plan.offset_mm / walk.length_mm;
        let params = kernel::SweepParams {
            dims: field.dims,
            axis: walk.axis as u32,
            step: walk.ray.step,
            window: walk.window,
            bricks: field.bricks(),
            flags: pass.flags(index == 0),
            tiles: walk.tiles,
            list: index as u32,
            pieces: walk.pieces,
            depth: (walk.length_mm / f64::from(walk.pieces) / f64::from(reference_mm)) as f32,
            start: start as f32,
            far: (walk.segments - 1) as f32,
            advance: [0, 1, 2].map(|i| walk.ray.step[i] % field.dims[i] as i32),
            part: BRICK as i32 / walk.ray.step.map(i32::abs).into_iter().max().unwrap_or(1),
            share: (f64::from(walk.parts) / (f64::from(walk.segments) - start)) as f32,
        };
        let at = crate::sweep::sweep_list::HEAD_BYTES * index as u64;
        // By the plan alone, so that full and partial updates run the same code.
        let pipeline = match walk.pieces {
            2.. => &self.pieces,
            _ if walk.window < CHUNK => &self.short,
            _ => &self.pipeline,
        };
        rec.dispatch_indirect(pipeline, &b, bytemuck::bytes_of(&params), b.list, at)
    }
}
