//! `airlight precompute`

use std::path::PathBuf;

use airlight::device::Bytes;
use airlight::exec::{Hooks, Precomputed, Progress, Renderer, Survey};
use airlight::scene::{AllEstimate, Precompute, TransferEstimate, TransferSource};
use airlight_formats::scene::SceneFile;
use airlight_formats::transfer;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::progress::Meter;
use crate::render::{assignment, warn};
use crate::{Done, devices, output};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The scene (.toml), whose medium and `estimate.all = { kind = "transfer", … }` say what is made. Without the latter all
    /// options of `transfer` are the ordinary ones.
    scene: PathBuf,
    /// The file to write; by default the scene's `estimate.all.file`, else `<scene>.transfer` in the current folder.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// auto, a backend (cpu, wgpu, opencl), an index (wgpu:1) or part of a name; see `airlight devices`.
    #[arg(long, value_name = "ID", default_value = "auto")]
    device: String,
    /// Put a value in place of the scene's: `estimate.all.cells=32`. May repeat.
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    /// Memory that matrices may take on the host, GiB; by default three quarters of what is free.
    #[arg(long, value_name = "GIB", value_parser = gibibytes)]
    memory: Option<u64>,
    /// Tell what it would take, and make nothing.
    #[arg(long)]
    survey: bool,
    /// Print JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

fn gibibytes(text: &str) -> Result<u64, String> {
    match text.parse::<f64>() {
        Ok(v) if v > 0.0 && v < 1e9 => Ok((v * f64::from(1u32 << 30)) as u64),
        _ => Err("a number of GiB above 0 is needed".into()),
    }
}

pub(crate) fn run(options: &Options) -> Done {
    let mut file = SceneFile::open(&options.scene, &options.set)?.without_transfer();
    let loaded = file.frame(file.first_frame())?;
    let mut making = match &loaded.scene.estimate.all {
        Some(AllEstimate::Transfer(TransferEstimate { source: TransferSource::Making(making), .. })) => *making,
        _ => Precompute::default(),
    };
    making.memory = options.memory;
    let stem = options.scene.file_stem().unwrap_or(options.scene.as_os_str());
    let beside = || PathBuf::from(stem).with_extension("transfer");
    let path = options.output.clone().or(loaded.transfer_file).unwrap_or_else(beside);
    let airlight::Chosen { device, passed_over } = airlight::choose(&options.device)?;
    let mut warnings = Vec::new();
    warn(passed_over, &mut warnings);
    warn(loaded.warnings, &mut warnings);
    let info = device.info().clone();
    let mut renderer = Renderer::new(device);
    let meter = std::cell::RefCell::new(Meter::new());
    let mut show = |progress: Progress| meter.borrow_mut().show(progress.stage, progress.done);
    let mut hooks = Hooks { progress: Some(&mut show), cancel: None };
    let survey = renderer.survey_transfer(&loaded.scene, &making, &mut hooks)?;
    if options.survey {
        return match options.json {
            true => output::json(&json!({ "device": devices::device(&info), "survey": survey_value(&survey) })),
            false => output::line(&told(&survey)),
        };
    }
    if !options.json {
        output::remark(&told(&survey));
    }
    let made = renderer.precompute(&loaded.scene, &making, &mut hooks)?;
    meter.borrow_mut().clear();
    if made.flown.truncated > 0 {
        let Precomputed { flown, .. } = &made;
        let share = flown.truncated as f64 / flown.photons as f64;
        warn(
            vec![format!(
                "{} of {} photons ({share:.1e}) were not followed to their end",
                flown.truncated, flown.photons
            )],
            &mut warnings,
        );
    }
    transfer::write(&path, &made.transfer).map_err(Failure::output)?;
    let bytes = std::fs::metadata(&path).map_or(0, |m| m.len());
    if options.json {
        return output::json(&json!({
            "version": env!("CARGO_PKG_VERSION"),
            "device": devices::device(&info),
            "output": path.display().to_string(),
            "bytes": bytes,
            "survey": survey_value(&survey),
            "photons": made.flown.photons,
            "truncated": made.flown.truncated,
            "residual": made.residual,
            "loss": losses(&made),
            "seconds": {
                "transport": made.transport.as_secs_f64(),
                "compression": made.compression.as_secs_f64(),
            },
            "warnings": warnings,
        }));
    }
    let lost: Vec<_> = losses(&made).iter().map(|loss| format!("{:.2} %", 100.0 * loss)).collect();
    output::line(&format!(
        "{} ({}; {:.1} s to carry light, {:.1} s to compress with a loss of {}, on {} {})",
        path.display(),
        Bytes(bytes),
        made.transport.as_secs_f64(),
        made.compression.as_secs_f64(),
        lost.join(", "),
        info.id(),
        info.name
    ))
}

/// What compression loses of each channel's matrices, relative L2.
fn losses(made: &Precomputed) -> Vec<f32> {
    made.transfer.channels().iter().map(|channel| channel.loss).collect()
}

/// What it takes, in a line.
fn told(survey: &Survey) -> String {
    let Survey { cells: [x, y, z], rows, functions, bands, channels, batches, bytes } = survey;
    format!(
        "{} of {x} × {y} × {z} cells matter; {functions} functions, {bands} bands, {channels} channels: light is carried \
         {batches} times, and the host needs up to {}",
        rows.len(),
        Bytes(*bytes)
    )
}

fn survey_value(survey: &Survey) -> Value {
    json!({
        "cells": survey.cells,
        "rows": survey.rows.len(),
        "functions": survey.functions,
        "bands": survey.bands,
        "channels": survey.channels,
        "batches": survey.batches,
        "host_bytes": survey.bytes,
    })
}
