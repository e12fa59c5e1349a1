//! The program `cao`: files in, pictures and ambient volumes out.

#![forbid(unsafe_code)]

mod args;
mod budget;
mod chart;
mod devices;
mod examples;
mod info;
mod meshes;
mod occlusion;
mod render;
mod stability;
mod verify;

use std::process::ExitCode;

fn main() -> ExitCode {
    let (cli, matches) = match cao_cli::parse::<args::Cli>() {
        Ok(parsed) => parsed,
        Err(code) => return code,
    };
    // The order of --clip and --clip-* tells which belong together.
    let of_command = matches.subcommand().map_or(&matches, |(_, command)| command);
    let outcome = match &cli.command {
        args::Command::Render(a) => render::run(&cli.global, a, of_command),
        args::Command::Occlusion(a) => occlusion::run(&cli.global, a, of_command),
        args::Command::Verify(a) => verify::run(&cli.global, a),
        args::Command::Chart(a) => chart::run(&cli.global, a),
        args::Command::Stability(a) => stability::run(&cli.global, a),
        args::Command::Examples(a) => examples::run(&cli.global, a),
        args::Command::Info(a) => info::run(&cli.global, a),
        args::Command::Devices => devices::run(&cli.global),
    };
    cao_cli::end("cao", outcome)
}
