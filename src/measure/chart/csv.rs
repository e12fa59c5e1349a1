//! Every run as a line of comma-separated values (RFC 4180): what was changed, each stage's time, the errors.

use super::{Chart, Point, SceneChart};
use cao_gpu::Stage;
use std::fmt::Write as _;

/// The whole table, its first line the names of the columns. Times in ms, lengths in mm; a stage that a method does not have
/// is empty.
pub fn runs(chart: &Chart) -> String {
    let stages = stages(chart);
    let mut text = String::from("scene,dims,radius_mm,change,method,setting,details,run,");
    stages.iter().for_each(|stage| text += &format!("{}_ms,", stage.name.replace(' ', "_")));
    text += "total_ms,ratio,errors_at,points,rmse,max,bias,rmse_shape,ssim3d\r\n";
    for scene in &chart.scenes {
        for point in &scene.points {
            lines(&mut text, scene, point, &stages);
        }
    }
    text
}

/// Every run of every way to draw, its first line the names of the columns.
pub fn pictures(chart: &Chart) -> String {
    let mut text = String::from(
        "scene,dims,width,height,setting,step_voxels,samples,filter,scale,run,raycast_ms,ratio,flip,rmse_levels\r\n",
    );
    let [width, height] = chart.plan.pictures;
    for scene in &chart.scenes {
        let [x, y, z] = scene.dims;
        for drawn in &scene.looks.drawn {
            let (setting, look) = (&drawn.setting, &drawn.setting.look);
            for (n, [ms, ratio]) in drawn.runs.iter().enumerate() {
                // Writing to a string cannot fail.
                let _ = write!(
                    text,
                    "{},{x}x{y}x{z},{width},{height},{},{},{},{},{},{},{ms},{ratio},{},{}\r\n",
                    quoted(&scene.name),
                    quoted(&setting.name()),
                    setting.step_voxels,
                    look.samples,
                    look.filter.name(),
                    setting.scale,
                    n + 1,
                    drawn.error.flip,
                    drawn.error.levels
                );
            }
        }
    }
    text
}

/// All stages, in the order in which they first appear.
fn stages(chart: &Chart) -> Vec<Stage> {
    let mut stages: Vec<Stage> = Vec::new();
    let points = chart.scenes.iter().flat_map(|scene| &scene.points);
    for timing in points.flat_map(|point| &point.runs).flat_map(|run| &run.stages) {
        if !stages.contains(&timing.stage) {
            stages.push(timing.stage);
        }
    }
    stages
}

fn lines(text: &mut String, scene: &SceneChart, point: &Point, stages: &[Stage]) {
    let [x, y, z] = scene.dims;
    let e = &point.errors;
    let ssim = point.ssim_3d.map_or(String::new(), |ssim| ssim.to_string());
    let at = if point.on_surface { "surface" } else { "voxels" };
    for (n, run) in point.runs.iter().enumerate() {
        let head = [
            quoted(&scene.name),
            format!("{x}x{y}x{z}"),
            scene.radius_mm.to_string(),
            quoted(point.change.name()),
            quoted(point.method),
            quoted(&point.setting.name()),
            quoted(&point.setting.details),
            (n + 1).to_string(),
        ];
        *text += &head.join(",");
        for stage in stages {
            let parts = run.stages.iter().filter(|t| t.stage == *stage).map(|t| t.ms);
            let ms = parts.reduce(|a, b| a + b);
            *text += &ms.map_or(",".into(), |ms| format!(",{ms}"));
        }
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            ",{},{},{at},{},{},{},{},{},{ssim}\r\n",
            run.total_ms, run.ratio, e.count, e.rmse, e.max, e.bias, point.shape.rmse
        );
    }
}

/// A field, in quotes where it needs them.
fn quoted(field: &str) -> String {
    match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field.into(),
    }
}
