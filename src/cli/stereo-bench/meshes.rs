//! The bars of ambient occlusion volumes of meshes (AOV §6): a level of 10⁵ triangles at 1280 × 720, one view; small and not judged on a software driver. Beside
//! them rays both ways, without a bar.

use super::bars::{Bar, RUNS, Row, Rows};
use anyhow::Result;
use cao::mesh::ambient::{ByRays, ByVolumes, PixelAmbient};
use cao::mesh::volumes::Volumes;
use cao::mesh_renderer::MeshRenderer;
use cao_gpu::{Gpu, Phase};
use cao_measure::chart::meshes::FACTORS;
use cao_model::look::Look;
use cao_model::scenes::BuiltScene;
use cao_model::surface::World;

/// Milliseconds of every pixel, and of one of 25.
const FULL_MS: f64 = 10.0;
const SPARSE_MS: f64 = 2.0;

/// Rays a pixel.
const RAYS: u32 = 64;

/// All of them.
pub fn bars(gpu: &Gpu, software: bool, rows: &mut Rows) -> Result<()> {
    let scene = BuiltScene::parse("level")?;
    let (detail, size) = if software { (1, [160, 90]) } else { (scene.detail, [1280, 720]) };
    let world = World::new(&(scene.make)(detail))?;
    let [left, _] = scene.eye.views(size[0] as f32 / size[1] as f32, 1.0, 1e5)?;
    type Make = fn(&Gpu) -> cao::Result<Box<dyn PixelAmbient>>;
    let (aov, rays) = (FACTORS[0] * scene.delta_mm, scene.delta_mm);
    // Drawn, as the paper has it, is there to be compared with.
    let mut ways: Vec<(String, Make, f32, Bar)> = vec![
        (
            "AOV, gathered".into(),
            |gpu| Ok(Box::new(ByVolumes::new(gpu, 1, false)?)),
            aov,
            Bar::AtMost(FULL_MS),
        ),
        ("AOV, drawn, static".into(), |gpu| Ok(Box::new(Volumes::new(gpu, true, false)?)), aov, Bar::None),
        ("AOV, drawn, dynamic".into(), |gpu| Ok(Box::new(Volumes::new(gpu, false, false)?)), aov, Bar::None),
        (
            "AOV, 1/25 5x5".into(),
            |gpu| Ok(Box::new(ByVolumes::new(gpu, 5, false)?)),
            aov,
            Bar::AtMost(SPARSE_MS),
        ),
        (format!("rays, {RAYS}, plain"), |gpu| Ok(Box::new(ByRays::walks(gpu, RAYS)?)), rays, Bar::None),
    ];
    if gpu.ray_queries() {
        let queries: Make = |gpu| Ok(Box::new(ByRays::queries(gpu, RAYS)?));
        ways.push((format!("rays, {RAYS}, ray queries"), queries, rays, Bar::None));
    }
    for (what, make, delta_mm, bar) in ways {
        let mut renderer = MeshRenderer::with(gpu, &world, make(gpu)?, delta_mm)?;
        let mut found = Vec::new();
        for _ in 0..RUNS + 1 {
            let (_, timings) = renderer.draw(&[left], &Look::default(), size, None, &mut |_| ())?;
            found.push(timings.of(Phase::Ambient));
        }
        // Its first compiles, and clocks rise.
        found.remove(0);
        rows.push(Row {
            place: format!("{}, {} triangles, {} x {}", scene.name, world.triangles.len(), size[0], size[1]),
            what,
            bar: if software { Bar::None } else { bar },
            unit: "ms",
            found,
            note: format!("δ {delta_mm} mm, left eye; what pixels show and their light are not counted"),
        })?;
    }
    Ok(())
}
