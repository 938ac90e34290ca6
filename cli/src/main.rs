//! The program `airlight`: renders scenes, lists devices, tells what files hold, compares pictures.
//!
//! Exit codes: 0 well; 1 failed while running; 2 bad usage or bad input; 3 a comparison fell short, or a device failed the
//! conformance suite.

mod compare;
mod conformance;
mod devices;
mod failure;
mod info;
mod output;
mod progress;
mod render;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;

/// Light and render participating media (clouds, smoke, fog, CT volumes) on any device.
#[derive(Parser)]
#[command(name = "airlight", version, propagate_version = true, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene to .exr and .png.
    Render(render::Options),
    /// List every device, its limits, and why a backend has none.
    Devices(devices::Options),
    /// Tell what a scene, a volume or an environment holds.
    Info(info::Options),
    /// Compare two pictures.
    Compare(compare::Options),
    /// Hold devices to the conformance suite.
    Conformance(conformance::Options),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Render(options) => render::run(&options),
        Command::Devices(options) => devices::run(&options),
        Command::Info(options) => info::run(&options),
        Command::Compare(options) => compare::run(&options),
        Command::Conformance(options) => conformance::run(&options),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::remark(&format!("error: {}", failure.message));
            ExitCode::from(failure.code)
        }
    }
}

/// What a command returns.
type Done = Result<(), Failure>;
