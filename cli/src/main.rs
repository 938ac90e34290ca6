//! The program `airlight`: renders scenes, lists devices, tells what files hold, compares pictures, tries and
//! measures devices.
//!
//! Exit codes: 0 well; 1 failed while running; 2 bad usage or bad input; 3 a comparison fell short, or a device did
//! not pass the conformance suite.

mod bench;
mod compare;
mod conformance;
mod devices;
mod estimators;
mod failure;
mod frames;
mod info;
mod output;
mod precompute;
mod progress;
mod render;

use std::path::Path;
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
    /// Make the data that the estimator `transfer` relights a medium from.
    Precompute(precompute::Options),
    /// Compare two pictures.
    Compare(compare::Options),
    /// Compare the estimators that fit a scene: error against path tracing, time, memory, pictures.
    Estimators(estimators::Options),
    /// Hold devices to the conformance suite.
    Conformance(conformance::Options),
    /// Measure how fast each device is, in a few seconds.
    Bench(bench::Options),
}

fn main() -> ExitCode {
    quieten();
    let done = match Cli::parse().command {
        Command::Render(options) => render::run(&options),
        Command::Devices(options) => devices::run(&options),
        Command::Info(options) => info::run(&options),
        Command::Precompute(options) => precompute::run(&options),
        Command::Compare(options) => compare::run(&options),
        Command::Estimators(options) => estimators::run(&options),
        Command::Conformance(options) => conformance::run(&options),
        Command::Bench(options) => bench::run(&options),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::remark(&format!("error: {}", failure.message));
            ExitCode::from(failure.code)
        }
    }
}

/// Keeps Mesa from lines on standard error that begin with `error:` where nobody is logged in: its layer that orders
/// graphics cards looks for a Wayland desktop, and libwayland complains that there is none.
fn quieten() {
    let desktop = std::env::var_os("XDG_RUNTIME_DIR").is_some_and(|folder| Path::new(&folder).is_absolute());
    if !desktop && std::env::var_os("NODEVICE_SELECT").is_none() {
        #[allow(unsafe_code, reason = "no other thread runs yet that could read the environment")]
        // SAFETY: it is the first call of `main`, and the program has one thread.
        unsafe {
            std::env::set_var("NODEVICE_SELECT", "1");
        }
    }
}

/// What a command returns.
type Done = Result<(), Failure>;
