//! An engine block cut by a plane along the voxels' own axes, which takes away what lies at larger x: what the trials of clip motion
//! and of cut faces look at.

use crate::Result;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::methods::Method;
use cao_model::occlusion::Occlusion;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, View};
use cao_model::volume::Volume;
use cao_twin::{Grid, trilinear};
use glam::Vec3;

/// Opacity from which a point belongs to the object's inside.
const SOLID: f64 = 0.3;

/// The cut volume.
pub struct PlaneCut {
    /// Holds it.
    pub renderer: Renderer,
    /// The volume itself.
    pub volume: Volume,
    /// Its opacity and colour.
    pub transfer: TransferFunction,
    /// Its shape.
    pub grid: Grid,
    /// (y, z) of points of the face inside the object, every half voxel, index coordinates.
    pub face: Vec<[f64; 2]>,
    /// Index coordinate x from which the face moves down.
    start: f64,
}

impl PlaneCut {
    /// An engine of `edge`³ voxels of 1 mm whose face is to move by up to `way` voxels. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, edge: usize, occlusion: Occlusion, way: usize) -> Result<Self> {
        let volume = builtin_box("engine", [edge; 3], [1.0; 3])?;
        let grid = Grid { dims: volume.dims, spacing: volume.spacing };
        let setup = Setup { occlusion, ..Setup::of(Method::Cao, 1.0) };
        let transfer = TransferFunction::preset("auto", volume.range())?;
        let mut renderer = Renderer::new(gpu, &volume, transfer.clone(), setup, COLOUR)?;
        renderer.update(&mut |_| ())?;
        let full = renderer.read_opacity()?;
        let start = (0.55 * edge as f64).floor();
        let inside = |at: [f64; 3]| trilinear(&grid, &full, at) > SOLID;
        // In the object over the whole way, and a voxel from its edges.
        let face = (0..4 * edge * edge)
            .map(|i| [i % (2 * edge), i / (2 * edge)].map(|c| c as f64 / 2.0))
            .filter(|&[y, z]| {
                let beside = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
                let on = |x: f64| beside.iter().all(|[dy, dz]| inside([x, y + dy, z + dz]));
                (0..=way).all(|w| on(start - w as f64))
            })
            .collect();
        Ok(Self { renderer, volume, transfer, grid, face, start })
    }

    /// The clip that puts the face `way` voxels from its start.
    pub fn clip(&self, way: f64) -> Clip {
        let x = self.grid.to_world([self.start - way, 0.0, 0.0])[0];
        let pose = Pose {
            translate_mm: Vec3::new(x as f32, 0.0, 0.0),
            rotate_deg: Vec3::new(0.0, 90.0, 0.0),
            ..Pose::default()
        };
        Clip { pose, ..Clip::remove(Shape::Plane) }
    }

    /// Moves the face there and brings the ambient volume up to date; returns its index coordinate x.
    pub fn place(&mut self, way: f64) -> Result<f64> {
        self.renderer.set_clips(&[self.clip(way)])?;
        self.renderer.update(&mut |_| ())?;
        Ok(self.start - way)
    }

    /// Two equal eyes on the side that the plane took away, which look straight at the face.
    pub fn views(&self) -> Result<[View; 2]> {
        let size = self.volume.size_mm();
        let rig = StereoRig { ipd_mm: 0.0, ..StereoRig::framing(size, 90.0, 0.0) };
        Ok(rig.views(1.0, 1.0, 20.0 * size[0] as f32)?)
    }
}
