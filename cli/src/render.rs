//! `airlight render`

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use airlight::Renderer;
use airlight::device::DeviceInfo;
use airlight::exec::{Hooks, Progress, Rendered};
use airlight::scene::{EnvironmentEstimate, LightsEstimate, Scene};
use airlight_formats::image::{ToneMap, check_ending, write_film};
use airlight_formats::scene::{LoadedScene, load_scene};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::progress::Meter;
use crate::{Done, devices, info, output};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The scene, a .toml file.
    scene: PathBuf,
    /// Where to write; the ending says the format (.exr, .png). May repeat. Without it, the scene's name with .exr and
    /// with .png in the current folder.
    #[arg(short, long = "output", value_name = "FILE")]
    output: Vec<PathBuf>,
    /// auto, a backend (cpu), an index (cpu:0) or part of a device's name.
    #[arg(long, value_name = "ID", default_value = "auto")]
    device: String,
    /// Size of the picture in pixels, instead of the scene's.
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Sub-pixel positions per pixel, instead of the scene's.
    #[arg(long, value_name = "N")]
    samples: Option<u32>,
    /// Exposure of .png in photographic stops: radiance is multiplied by 2^STOPS before tone mapping.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = stops)]
    exposure: f32,
    /// Put a value in place of the scene's, by dotted key: light.0.intensity=2. May repeat.
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    /// Print what was done as JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let (w, h) = text.split_once(['x', 'X']).ok_or("a size is written as 640x480")?;
    let side = |s: &str| s.parse::<u32>().map_err(|_| format!("\"{s}\" is not a number of pixels"));
    Ok((side(w)?, side(h)?))
}

/// 2^±128 already leaves what f32 holds.
fn stops(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(v) if v.abs() <= 128.0 => Ok(v),
        _ => Err("a number of stops from -128 to 128 is needed".into()),
    }
}

fn assignment(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("an assignment is written as key=value")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

pub(crate) fn run(options: &Options) -> Done {
    let begin = Instant::now();
    if options.scene.is_dir() {
        let what = format!("{}: is a folder; give the name of a scene, a .toml file", options.scene.display());
        return Err(Failure::input(what));
    }
    let outputs = outputs(options)?;
    let LoadedScene { scene, mut warnings, .. } = load(options)?;
    let airlight::Chosen { device, passed_over } = airlight::choose(&options.device)?;
    warnings.extend(passed_over);
    warnings.iter().for_each(|w| output::remark(&format!("warning: {w}")));
    let mut renderer = Renderer::new(device);
    let loaded = begin.elapsed();

    let mut meter = Meter::new();
    let mut show = |progress: Progress| meter.show(progress.stage, progress.done);
    let hooks = &mut Hooks { progress: Some(&mut show), cancel: None };
    let rendered = renderer.render_with(&scene, hooks)?;
    drop(meter);
    let rendering = begin.elapsed() - loaded;

    let info = renderer.device().info().clone();
    // Writing takes memory again: what the device held makes room.
    drop(renderer);
    let metadata = metadata(&scene, &info, &rendered, rendering, options);
    let tone = ToneMap { exposure: options.exposure, ..ToneMap::default() };
    for path in &outputs {
        write_film(path, &rendered.film, &metadata, tone).map_err(Failure::output)?;
    }
    let writing = begin.elapsed() - loaded - rendering;
    if options.json {
        let seconds =
            json!({ "load": loaded.as_secs_f64(), "render": rendering.as_secs_f64(), "write": writing.as_secs_f64() });
        return output::json(&report(&scene, &info, &rendered, &outputs, &warnings, seconds));
    }
    let names: Vec<_> = outputs.iter().map(|p| p.display().to_string()).collect();
    let (w, h) = (scene.camera.width, scene.camera.height);
    output::line(&format!(
        "{} ({w} × {h}, {:.2} s to load, {:.2} s to render on {} {})",
        names.join(", "),
        loaded.as_secs_f64(),
        rendering.as_secs_f64(),
        info.id(),
        info.name
    ))
}

/// The scene, with the options put in place of what it says.
fn load(options: &Options) -> Result<LoadedScene, Failure> {
    let mut overrides = options.set.clone();
    if let Some((w, h)) = options.size {
        overrides.push(("camera.size".into(), format!("[{w}, {h}]")));
    }
    if let Some(samples) = options.samples {
        overrides.push(("camera.samples".into(), samples.to_string()));
    }
    Ok(load_scene(&options.scene, &overrides)?)
}

/// Where to write, checked before the work and not after it.
fn outputs(options: &Options) -> Result<Vec<PathBuf>, Failure> {
    let mut outputs = options.output.clone();
    if outputs.is_empty() {
        let stem = options.scene.file_stem().unwrap_or(options.scene.as_os_str());
        outputs = ["exr", "png"].map(|ending| Path::new(stem).with_added_extension(ending)).to_vec();
    }
    for path in &outputs {
        check_ending(path)?;
        if path.is_dir() {
            return Err(Failure::input(format!("{}: is a folder; give the name of a file", path.display())));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            let what = format!("{}: the folder {} does not exist", path.display(), folder.display());
            return Err(Failure::input(what));
        }
    }
    Ok(outputs)
}

/// The estimators in words.
fn estimators(scene: &Scene) -> Vec<String> {
    let environment = scene.estimate.environment.as_ref().map(|e| match e {
        EnvironmentEstimate::Records(r) => format!("environment: records {r:?}"),
    });
    let lights = scene.estimate.lights.as_ref().map(|l| match l {
        LightsEstimate::Opacity(o) => format!("lights: opacity {o:?}"),
        LightsEstimate::Direct(d) => format!("lights: direct {d:?}"),
    });
    environment.into_iter().chain(lights).collect()
}

/// What is written into the picture: device, estimators, version, settings, timing.
fn metadata(
    scene: &Scene,
    info: &DeviceInfo,
    rendered: &Rendered,
    time: Duration,
    options: &Options,
) -> Vec<(String, String)> {
    let stages: Vec<_> =
        rendered.report.stages.iter().map(|s| format!("{} {:.3} s", s.stage, s.time.as_secs_f64())).collect();
    let settings: Vec<_> = options.set.iter().map(|(k, v)| format!("{k}={v}")).collect();
    [
        ("airlight.version", env!("CARGO_PKG_VERSION").to_owned()),
        ("airlight.device", format!("{} {}", info.id(), info.name)),
        ("airlight.scene", options.scene.display().to_string()),
        ("airlight.estimators", estimators(scene).join("; ")),
        ("airlight.settings", settings.join("; ")),
        ("airlight.samples", scene.camera.samples.to_string()),
        ("airlight.step", scene.quality.step.to_string()),
        ("airlight.steps", scene.quality.steps.map_or_else(|| "by step".to_owned(), |steps| steps.to_string())),
        ("airlight.jitter", info::jitter(scene.quality.jitter).to_owned()),
        ("airlight.scale", scene.quality.scale.to_string()),
        ("airlight.temporal", scene.quality.temporal.to_string()),
        ("airlight.seconds", format!("{:.3}", time.as_secs_f64())),
        ("airlight.stages", stages.join("; ")),
    ]
    .into_iter()
    .map(|(k, v)| (k.to_owned(), v))
    .collect()
}

fn report(
    scene: &Scene,
    info: &DeviceInfo,
    rendered: &Rendered,
    outputs: &[PathBuf],
    warnings: &[String],
    seconds: Value,
) -> Value {
    let report = &rendered.report;
    let stages: Vec<_> = report
        .stages
        .iter()
        .map(|s| json!({ "stage": s.stage, "ran": s.ran, "seconds": s.time.as_secs_f64() }))
        .collect();
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "device": devices::device(info),
        "size": [scene.camera.width, scene.camera.height],
        "samples": scene.camera.samples,
        "estimators": estimators(scene),
        "outputs": outputs.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
        "warnings": warnings,
        "seconds": seconds,
        "stages": stages,
        "device_bytes": report.bytes,
    })
}
