//! `cao devices`: what can be rendered on.

use crate::args::Global;
use anyhow::Result;
use cao_cli::output::Out;
use cao_gpu::Gpu;
use std::process::ExitCode;

pub fn run(global: &Global) -> Result<ExitCode> {
    let mut out = Out::new(global);
    let devices = Gpu::list()?;
    for (i, device) in devices.iter().enumerate() {
        let [major, minor, patch] = device.api_version;
        out.line(format!("{i}  {} ({}), Vulkan {major}.{minor}.{patch}", device.name, device.driver));
        for lacking in &device.missing {
            out.line(format!("   cannot be used: {lacking}"));
        }
    }
    let json = devices.iter().enumerate().map(|(index, d)| {
        serde_json::json!({
            "index": index,
            "name": d.name,
            "driver": d.driver,
            "api_version": d.api_version,
            "usable": d.missing.is_empty(),
            "missing": d.missing,
        })
    });
    out.json(serde_json::json!({ "devices": json.collect::<Vec<_>>() }));
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}
