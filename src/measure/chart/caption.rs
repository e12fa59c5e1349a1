//! What one has to know to read the chart.

use super::{CLIP_VOXELS, Chart, OPACITY_FACTOR, Point, RADIUS_FACTOR, meshes};

impl Chart {
    /// Whether a point's contender is the one that stands for its method in tables and pictures.
    pub(super) fn featured(&self, point: &Point) -> bool {
        let mut shown = self.scenes.iter().flat_map(|scene| &scene.pictures);
        shown.any(|shown| shown.method == point.method && shown.setting == point.setting)
    }

    /// What one has to know to read the chart, line by line.
    pub fn caption(&self) -> Vec<String> {
        let mut lines = vec![format!("{}, {}.", self.device, self.driver)];
        for scene in &self.scenes {
            let [x, y, z] = scene.dims;
            let Some((_, truth)) = scene.references.first() else { continue };
            lines.push(format!(
                "{}: {x} x {y} x {z} voxels, radius {} mm, clip {}; errors at {} of {} voxels that show, or at {} points of the surface.",
                scene.name, scene.radius_mm, scene.clips, truth.computed, truth.counting, truth.surface
            ));
        }
        for scene in &self.scenes {
            lines.extend(scene.left_out.iter().map(|out| format!("{}: {out}", scene.name)));
        }
        let worst = self.scenes.iter().flat_map(|s| &s.references).map(|(_, t)| t.convergence);
        let reference = self.plan.reference;
        lines.push(format!(
            "Reference: {} directions, {} steps a voxel; doubling both moves it by {:.5} RMS at most. Medians of {} runs in one process, methods alternating; whiskers: quartiles.",
            reference.directions,
            reference.steps_per_voxel,
            worst.fold(0.0, f64::max),
            self.plan.runs
        ));
        lines.push(format!(
            "Changes: clip moved by {CLIP_VOXELS} voxel along each axis, opacities and radius times {OPACITY_FACTOR} and {RADIUS_FACTOR}, or all values new, and back again. Copying a new volume to the device is not counted."
        ));
        lines.push(format!(
            "Image space has values on the surface in the image only, {} x {} pixels an eye: its errors are at those points, against the reference there, and it",
            self.plan.size[0], self.plan.size[1]
        ));
        lines.push("competes for no front; its values are halved, for it shades half a sphere. It has to be done again whenever the head moves.".into());
        lines.extend(self.meshes.as_ref().map(meshes::Found::in_the_chart));
        lines
    }
}
