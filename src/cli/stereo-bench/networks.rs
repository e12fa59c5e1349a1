//! The bars of method `dvao`: what its networks take for a grid of 128³ voxels, time and memory; small and not judged on a software driver.

use super::args::Cli;
use super::bars::{Bar, RUNS, Row, Rows};
use anyhow::Result;
use cao::renderer::{COLOUR, Renderer};
use cao_cli::output::open_gpu;
use cao_gpu::Phase;
use cao_measure::random::Random;
use cao_model::methods::Method;
use cao_model::network::{Network, Shape, half_bits};
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;

/// Weights of no use, of the size that keeps activations near 1.
fn random(shape: Shape) -> Result<Network> {
    let mut random = Random::new(1);
    let mut weights = Vec::with_capacity(shape.weights());
    for layer in shape.layers() {
        let most = (27.0 * layer.inputs as f32).sqrt().recip();
        weights.extend((0..layer.weights()).map(|_| half_bits(random.between(-most, most))));
    }
    Ok(Network::new(shape, weights.into())?)
}

/// All of them.
pub fn bars(cli: &Cli, software: bool, rows: &mut Rows) -> Result<()> {
    let edge = if software { 32 } else { 128 };
    let mut nets = vec![("the network built in", Network::small(), 15.0)];
    if !software {
        nets.push(("the published shape, random weights", random(Shape::PUBLISHED)?, 60.0));
    }
    let volume = cao_formats::open(format!("builtin:engine:{edge}"))?;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    for (what, network, most_ms) in nets {
        // A device of its own, whose memory nothing else takes.
        let gpu = open_gpu(&cli.global)?;
        // A voxel of the grid is one of the volume.
        let mut setup = Setup::of(Method::Deep, volume.min_spacing());
        setup.occlusion.radius_mm = network.shape().radius() * volume.min_spacing() as f32;
        let first = Setup::new(volume.min_spacing());
        let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), first, COLOUR)?;
        let weights = network.weights().len();
        renderer.set_network(network)?;
        renderer.set_setup(setup)?;
        let mut found = Vec::new();
        for _ in 0..RUNS + 1 {
            renderer.invalidate();
            found.push(renderer.update(&mut |_| ())?.of(Phase::Ambient));
        }
        // Its first compiles, and clocks rise.
        found.remove(0);
        let mib = gpu.memory_peak() as f64 / f64::from(1 << 20);
        let bar = |most: f64| if software { Bar::None } else { Bar::AtMost(most) };
        let place = format!("dvao, grid of {edge}³, {what}");
        let note = format!("{weights} weights; an update after any edit");
        rows.push(Row {
            place: place.clone(),
            what: "update".into(),
            bar: bar(most_ms),
            unit: "ms",
            found,
            note,
        })?;
        let note = "peak, with a volume of the grid's size and its picture's".into();
        let found = vec![mib];
        rows.push(Row { place, what: "device memory".into(), bar: bar(1536.0), unit: "MiB", found, note })?;
    }
    Ok(())
}
