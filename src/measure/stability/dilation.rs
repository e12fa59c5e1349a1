//! Dilation maps (CAO §3.4 step 3, eq. (4); method.md §5): how many voxels a contextual update leaves stale, against the size of
//! the map, its recipe and the precision of its depths.
//!
//! A voxel is stale when its ambient factor changed, needs a value, and the map calls it untouched. What changed is decided by
//! the twins: V_AO of the clipped volume, fully computed, against V_PAO. Control: the published recipe, with 32-bit depths
//! and with half floats. Beside it what the authors' public program does instead, so that the trial is fair to them: half floats read bilinearly, a
//! radius that is rounded up in pixels and a voxel's diagonal longer, clip samples up to 1.025 voxels out. Maps are evaluated where a voxel changed, which is all that counts, so that the largest take seconds.

use super::{Chart, Effort, Finding, Ours, Quantity, Series, as_twin};
use crate::Result;
use crate::plot::short;
use cao::clip::peel::Peel;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, ClipCamera, Mode, Pose, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{AntiAliasing, Estimator, MapSettings, Setup, Support};
use cao_model::transfer::TransferFunction;
use cao_twin::cast::lao::lao_at;
use cao_twin::clip::classify::sample_positions;
use cao_twin::clip::dilate::{Cells, changed_radius};
use cao_twin::{Grid, each};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Pixels along an edge of the maps.
    pub resolutions: Vec<u32>,
    /// Poses of each mesh.
    pub poses: usize,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { edge: 40, resolutions: vec![64, 128, 256, 512, 1024, 2048], poses: 2 },
            Effort::Quick => Self { edge: 24, resolutions: vec![64, 256, 1024], poses: 1 },
        }
    }
}

/// Radius in voxels.
const RADIUS: f32 = 5.0;

/// Pixels along an edge of the maps of the authors' program.
const PROGRAM: u32 = 1024;

/// Layer pairs that these meshes need at most; more at the largest size are more than a device has to bind at once.
const PAIRS: u32 = 2;

/// Cells along an edge of the device's own dilation maps.
const DEVICE_CELLS: u32 = 128;

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let volume = builtin_box("engine", [plan.edge; 3], [1.0; 3])?;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let occlusion = Occlusion {
        rays: RaySet::R26,
        quadrature: Quadrature::Left,
        radius_mm: RADIUS,
        offset_mm: None,
        step_mm: None,
        ..Occlusion::paper(1.0)
    };
    let setup = Setup { occlusion, ..Setup::of(Method::Cao, 1.0) };
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR)?;
    renderer.update(&mut |_| ())?;
    let grid = Grid { dims: volume.dims, spacing: volume.spacing };
    let scene = Scene { grid, occlusion, full: renderer.read_opacity()? };
    let peel = Peel::new(gpu)?;

    let clips = clips(plan);
    let mut counts = Vec::new();
    let mut changed = 0;
    for (n, &resolution) in plan.resolutions.iter().enumerate() {
        let mut sum = [0_usize; 5];
        for (c, clip) in clips.iter().enumerate() {
            let maps =
                MapSettings { resolution, cells: DEVICE_CELLS, pairs: PAIRS, ..MapSettings::default() };
            renderer.set_setup(Setup { maps, ..setup })?;
            renderer.set_clips(std::slice::from_ref(clip))?;
            renderer.update(&mut |_| ())?;
            sum[4] += cao::verify::verify(&renderer, &mut |_| ())?.0.different as usize;
            let [literal, programmed, ours] =
                [&[Recipe::Single, Recipe::Half][..], &[Recipe::Programmed], &[Recipe::Conservative]]
                    .map(|recipes| scene.stale(gpu, &peel, clip, resolution, recipes));
            let (literal, programmed, ours) = (literal?, programmed?, ours?);
            let stale = literal.stale.iter().chain(&programmed.stale).chain(&ours.stale);
            for (sum, stale) in sum.iter_mut().zip(stale) {
                *sum += stale;
            }
            changed += ours.changed;
            let done = n as f64 + (c + 1) as f64 / clips.len() as f64;
            progress(done / plan.resolutions.len() as f64);
        }
        counts.push((f64::from(resolution), sum));
    }
    let per_case = changed as f64 / (plan.resolutions.len() * clips.len()) as f64;
    let curve = |which: usize| counts.iter().map(|(x, sum)| [*x, sum[which] as f64]).collect::<Vec<_>>();
    let single = Series::control("eq. (4) as printed, 32-bit depth", curve(0));
    let half = Series::control("eq. (4) as printed, 16-bit depth", curve(1));
    let programmed = Series::yardstick("as programmed by the authors", curve(2));
    let ours = Series::ours("conservative (ours)", curve(3));
    let device = Series::ours(format!("conservative (ours), on the device, {DEVICE_CELLS}² cells"), curve(4));
    let (first, last) = (plan.resolutions[0], plan.resolutions[plan.resolutions.len() - 1]);
    let holds = ours.largest() == 0.0 && device.largest() == 0.0;
    let always = single.points.iter().all(|point| point[1] > 0.0);
    let says = match holds {
        true => "ours leaves none at any size, in the twin and on the device".into(),
        false => format!("OURS LEAVES up to {}", short(ours.largest().max(device.largest()))),
    };
    let at = |series: &Series, x: u32| short(series.at(f64::from(x)));
    Ok(Finding {
        sentence: format!(
            "The published dilation map leaves voxels stale {}: {} at {first}², {} at {last}² with 32-bit depths ({} and {} with 16-bit) \
             in {} clips that change {} voxels each; as the authors programmed it {} and {}, and {} at {}², where they use it; {says}.",
            if always { "at every size" } else { "at some sizes" },
            at(&single, first),
            at(&single, last),
            at(&half, first),
            at(&half, last),
            clips.len(),
            short(per_case),
            at(&programmed, first),
            at(&programmed, last),
            at(&programmed, PROGRAM),
            programmed.nearest(f64::from(PROGRAM)),
        ),
        ours: Ours::holding(holds),
        control_fails: single.largest() > 0.0 && half.largest() > 0.0,
        setting: format!(
            "engine {}³, 26 rays, radius {RADIUS} voxels; sphere and torus meshes at {} poses each; sums over all clips",
            plan.edge, plan.poses
        ),
        charts: vec![Chart {
            title: "Voxels that a contextual update leaves stale".into(),
            x: Quantity::log("pixels along an edge of the dilation map"),
            y: Quantity::linear("stale voxels"),
            series: vec![half, single, programmed, ours, device],
        }],
    })
}

fn clips(plan: &Plan) -> Vec<Clip> {
    let edge = plan.edge as f32;
    let meshes = [TriangleMesh::sphere(3), TriangleMesh::torus(48, 24)].map(Arc::new);
    let pose = |n: usize| {
        let turn = n as f32;
        Pose {
            translate_mm: Vec3::new(0.11 - 0.09 * turn, -0.13, 0.07 + 0.06 * turn) * edge,
            rotate_deg: Vec3::new(25.0, 40.0 + 33.0 * turn, -15.0 + 70.0 * turn),
            scale: Vec3::new(0.25, 0.3, 0.22) * edge,
        }
    };
    let all = (0..plan.poses).flat_map(|n| meshes.iter().map(move |mesh| (n, mesh)));
    all.map(|(n, mesh)| Clip { pose: pose(n), ..Clip::remove(Shape::Mesh(mesh.clone())) }).collect()
}

#[derive(Clone, Copy, PartialEq)]
enum Recipe {
    Single,
    Half,
    Programmed,
    Conservative,
}

impl Recipe {
    /// How the scene that it belongs to samples cut voxels.
    fn samples(self) -> AntiAliasing {
        let support = if self == Self::Programmed { Support::Neighbours } else { Support::Voxel };
        match self {
            Self::Conservative => AntiAliasing::N32,
            _ => AntiAliasing { support, estimator: Estimator::Paper, ..AntiAliasing::N32 },
        }
    }

    /// Radius in mm of its map, and how much wider than the mesh the camera of its layers is, which the cut shares.
    fn radius(self, grid: &Grid, clip: &Clip, reach: f32) -> [f32; 2] {
        match self {
            // As the clips' twin has it: only these layers leave room for the dilation.
            Self::Single | Self::Half => [reach; 2],
            Self::Programmed => [reach + grid.diagonal() as f32; 2],
            Self::Conservative => {
                let radius = changed_radius(grid, reach, self.samples().support);
                let size = std::array::from_fn(|axis| grid.dims[axis] as f64 * grid.spacing[axis]);
                let half = 0.5 * Vec3::from_array(size.map(|c: f64| c as f32)).length();
                [radius + clip.rounding_mm(half, radius), 0.0]
            }
        }
    }
}

struct Scene {
    grid: Grid,
    occlusion: Occlusion,
    /// Opacity before clipping.
    full: Vec<f32>,
}

/// Of one clip.
struct Count {
    /// Voxels whose ambient factor it changed and that need one.
    changed: usize,
    /// Of these, what each recipe's map calls untouched.
    stale: Vec<usize>,
}

impl Scene {
    /// Recipes of one kind, which share samples, camera and with them the cut.
    fn stale(
        &self,
        gpu: &Gpu,
        peel: &Peel,
        clip: &Clip,
        resolution: u32,
        recipes: &[Recipe],
    ) -> Result<Count> {
        let Shape::Mesh(mesh) = &clip.shape else {
            return Ok(Count { changed: 0, stale: vec![0; recipes.len()] });
        };
        let grid = &self.grid;
        let (kind, reach) = (recipes[0], self.occlusion.reach(grid.min_spacing()));
        let [radius, margin] = kind.radius(grid, clip, reach);
        let camera = ClipCamera::around(mesh, clip.pose.scale, margin, resolution);
        let layers = as_twin(&peel.run(gpu, mesh, clip.pose.scale, camera, PAIRS)?);

        let positions = sample_positions(kind.samples());
        let to_rigid = clip.pose.rotation().transpose();
        // The n-th sample of a voxel in the mesh's rigid frame, as `Pose::to_rigid` has it.
        let sample = |voxel: [usize; 3], n: usize| {
            let index = std::array::from_fn(|axis| voxel[axis] as f64 + positions[n][axis]);
            let world = Vec3::from_array(grid.to_world(index).map(|c| c as f32));
            to_rigid * (world - clip.pose.translate_mm)
        };
        let seen = |voxel, of: Range<usize>| of.filter(|&n| !layers.inside(sample(voxel, n))).count() as f64;
        let counted = if kind.samples().estimator == Estimator::Interior { 9 } else { 0 };
        // Stage 4: the visible share of nine samples, of those that count where they disagree, and how many were tested.
        let shares: Vec<(f64, usize)> = each(grid.len(), |i| {
            let (voxel, all) = (grid.voxel(i), positions.len());
            let nine = seen(voxel, 0..9);
            match nine == 0.0 || nine == 9.0 {
                true => (nine / 9.0, 9),
                false => (seen(voxel, counted..all) / (all - counted) as f64, all),
            }
        });
        let clipped: Vec<f32> = shares
            .iter()
            .zip(&self.full)
            .map(|(&(share, _), &opacity)| (share * f64::from(opacity)) as f32)
            .collect();
        // Farther from the hidden region no footprint reaches it.
        let bound = mesh.bounds().0.abs().max(mesh.bounds().1.abs()).length() * clip.pose.scale.max_element();
        let far = bound + changed_radius(grid, reach, kind.samples().support);
        let found: Vec<Option<usize>> = each(grid.len(), |i| {
            let voxel = grid.voxel(i);
            let near = sample(voxel, 0).length() <= far;
            let needed = clipped[i] > 0.0 || grid.neighbours(voxel).any(|n| clipped[grid.index(n)] > 0.0);
            let visible = shares[i].0 > 0.0 || grid.neighbours(voxel).any(|n| shares[grid.index(n)].0 > 0.0);
            let differs = || {
                let value = |opacity: &[f32]| lao_at(grid, opacity, &self.occlusion, 1.0, voxel);
                value(&clipped) != value(&self.full)
            };
            (near && needed && visible && differs()).then_some(i)
        });
        let changed: Vec<usize> = found.into_iter().flatten().collect();
        let mut stale = Vec::new();
        for recipe in recipes {
            let cells = match recipe {
                Recipe::Conservative => Cells::conservative(&layers, Mode::Remove, radius, resolution)?,
                Recipe::Programmed => Cells::programmed(&layers, Mode::Remove, radius),
                single => Cells::literal(&layers, Mode::Remove, radius, *single == Recipe::Half),
            };
            let untouched = each(changed.len(), |n| {
                let i = changed[n];
                // The paper counts samples; the conservative radius covers the voxel around its centre.
                let tested = if kind == Recipe::Conservative { 1 } else { shares[i].1 };
                !(0..tested).any(|n| cells.dilated(sample(grid.voxel(i), n)))
            });
            stale.push(untouched.into_iter().filter(|&is| is).count());
        }
        Ok(Count { changed: changed.len(), stale })
    }
}
