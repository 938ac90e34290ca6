//! `airlight render`

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use airlight::Renderer;
use airlight::device::DeviceInfo;
use airlight::exec::{Hooks, Progress, Rendered, Solved};
use airlight::scene::{AllEstimate, EnvironmentEstimate, LightsEstimate, ScatteringEstimate, Scene};
use airlight_formats::image::{ToneMap, write_film};
use airlight_formats::scene::{LoadedScene, SceneFile};
use serde_json::{Map, Value, json};

use crate::failure::Failure;
use crate::progress::Meter;
use crate::{Done, devices, frames, info, output};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The scene, a .toml file.
    scene: PathBuf,
    /// Where to write; the ending says the format (.exr, .png), and a run of # in the name is the number of the frame,
    /// filled with zeros. May repeat. Without it, the scene's name with .exr and with .png in the current folder.
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
    /// Seconds after which a picture of estimate.all = "path" gets no more samples, instead of the scene's.
    #[arg(long, value_name = "S", value_parser = seconds)]
    time_limit: Option<f64>,
    /// Render these frames, A to B or a single one, each to files of its own: out.####.exr. Without it, the first frame of
    /// the scene's [animation], or frame 0.
    #[arg(long, value_name = "A-B", value_parser = frames::parse)]
    frames: Option<RangeInclusive<u32>>,
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

pub(crate) fn size(text: &str) -> Result<(u32, u32), String> {
    let (w, h) = text.split_once(['x', 'X']).ok_or("a size is written as 640x480")?;
    let side = |s: &str| s.parse::<u32>().map_err(|_| format!("\"{s}\" is not a number of pixels"));
    Ok((side(w)?, side(h)?))
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() && v > 0.0 => Ok(v),
        _ => Err("a number of seconds above 0 is needed".into()),
    }
}

/// 2^±128 already leaves what f32 holds.
fn stops(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(v) if v.abs() <= 128.0 => Ok(v),
        _ => Err("a number of stops from -128 to 128 is needed".into()),
    }
}

pub(crate) fn assignment(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("an assignment is written as key=value")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

/// A frame that was rendered.
struct Picture<'a> {
    frame: u32,
    scene: &'a Scene,
    info: &'a DeviceInfo,
    rendered: &'a Rendered,
    outputs: &'a [PathBuf],
    /// Time to load and to render.
    loading: Duration,
    rendering: Duration,
}

pub(crate) fn run(options: &Options) -> Done {
    let mut begin = Instant::now();
    if options.scene.is_dir() {
        let what = format!("{}: is a folder; give the name of a scene, a .toml file", options.scene.display());
        return Err(Failure::input(what));
    }
    let mut file = SceneFile::open(&options.scene, &overrides(options))?;
    let (sequence, first) = (options.frames.is_some(), file.first_frame());
    let frames = options.frames.clone().unwrap_or(first..=first);
    let stem = options.scene.file_stem().unwrap_or(options.scene.as_os_str());
    let outputs = frames::outputs(&options.output, Path::new(stem), frames.clone(), sequence)?;
    if sequence {
        file.check(frames.clone())?;
    }
    // A scene that cannot be read is told before a device is opened.
    let mut first = Some(file.frame(*frames.start())?);
    let airlight::Chosen { device, passed_over } = airlight::choose(&options.device)?;
    let mut warnings = Vec::new();
    warn(passed_over, &mut warnings);
    let info = device.info().clone();
    let mut renderer = Some(Renderer::new(device));

    let tone = ToneMap { exposure: options.exposure, ..ToneMap::default() };
    let (mut meter, mut reports, mut common) = (Meter::new(), Vec::new(), Map::new());
    let count = outputs.len();
    for ((frame, outputs), number) in frames.zip(&outputs).zip(1..) {
        let told = |failure: Failure| if sequence { failure.within(&format!("frame {frame}")) } else { failure };
        let LoadedScene { mut scene, warnings: more, .. } = first.take().map_or_else(|| file.frame(frame), Ok)?;
        warn(more, &mut warnings);
        limit_time(options, &mut scene)?;
        let loading = begin.elapsed();
        let mut show = |progress: Progress| match sequence {
            true => meter.show(format_args!("frame {frame}, {number} of {count}: {}", progress.stage), progress.done),
            false => meter.show(progress.stage, progress.done),
        };
        let hooks = &mut Hooks { progress: Some(&mut show), cancel: None };
        let Some(on) = &mut renderer else { unreachable!("the renderer is there until the last frame") };
        let rendered = on.render_with(&scene, hooks).map_err(|e| told(e.into()))?;
        if number == count {
            // Writing takes memory again: what the device held makes room.
            renderer = None;
        }
        let rendering = begin.elapsed() - loading;
        let picture = Picture { frame, scene: &scene, info: &info, rendered: &rendered, outputs, loading, rendering };
        meter.clear();
        warn(unsolved(&rendered), &mut warnings);
        let metadata = picture.metadata(options);
        for path in outputs {
            write_film(path, &rendered.film, &metadata, tone).map_err(|e| told(Failure::output(e)))?;
        }
        if !options.json {
            picture.tell()?;
        } else {
            if reports.is_empty() {
                common = picture.common();
            }
            reports.push(picture.report(begin.elapsed() - loading - rendering));
        }
        begin = Instant::now();
    }
    if !options.json {
        return Ok(());
    }
    common.insert("warnings".into(), json!(warnings));
    match reports.pop() {
        Some(Value::Object(only)) if !sequence => common.extend(only),
        last => {
            reports.extend(last);
            common.insert("frames".into(), reports.into());
        }
    }
    output::json(&common.into())
}

/// Puts the limit of time in place of the scene's.
fn limit_time(options: &Options, scene: &mut Scene) -> Done {
    match (options.time_limit, &mut scene.estimate.all) {
        (None, _) => Ok(()),
        (limit, Some(AllEstimate::Path(path))) => {
            path.time_limit = limit;
            Ok(())
        }
        (Some(_), None | Some(AllEstimate::Transfer(_))) => {
            let what = "--time-limit: only estimate.all = \"path\" adds samples until it is told to stop";
            Err(Failure::input(format!("{}: {what}", options.scene.display())))
        }
    }
}

/// That scattering did not converge.
fn unsolved(rendered: &Rendered) -> Vec<String> {
    let left = rendered.report.solved.iter().filter(|solved| !solved.converged);
    left.map(|solved| {
        format!(
            "scattering has not converged: the last of {} sweeps still changed {:.1e} of the light; a larger \
             estimate.scattering.tolerance asks for less",
            solved.sweeps, solved.residual
        )
    })
    .collect()
}

/// Says each warning once.
pub(crate) fn warn(new: Vec<String>, said: &mut Vec<String>) {
    for warning in new {
        if !said.contains(&warning) {
            output::remark(&format!("warning: {warning}"));
            said.push(warning);
        }
    }
}

/// What is put in place of what the scene says.
fn overrides(options: &Options) -> Vec<(String, String)> {
    let mut overrides = options.set.clone();
    if let Some((w, h)) = options.size {
        overrides.push(("camera.size".into(), format!("[{w}, {h}]")));
    }
    if let Some(samples) = options.samples {
        overrides.push(("camera.samples".into(), samples.to_string()));
    }
    overrides
}

/// The estimators in words.
fn estimators(scene: &Scene) -> Vec<String> {
    let environment = scene.estimate.environment.as_ref().map(|e| match e {
        EnvironmentEstimate::Records(r) => format!("environment: records {r:?}"),
    });
    let lights = scene.estimate.lights.as_ref().map(|l| match l {
        LightsEstimate::Opacity(o) => format!("lights: opacity {o:?}"),
        LightsEstimate::Direct(d) => format!("lights: direct {d:?}"),
        LightsEstimate::Local(l) => format!("lights: local {l:?}"),
    });
    let scattering = scene.estimate.scattering.as_ref().map(|s| match s {
        ScatteringEstimate::Sweeps(s) => format!("scattering: sweeps {s:?}"),
    });
    let all = scene.estimate.all.as_ref().map(|a| match a {
        AllEstimate::Path(p) => format!("all: path {p:?}"),
        AllEstimate::Transfer(t) => format!("all: transfer {t:?}"),
    });
    environment.into_iter().chain(lights).chain(scattering).chain(all).collect()
}

/// How far scattering was carried.
fn solved(solved: &Solved) -> Value {
    json!({ "sweeps": solved.sweeps, "residual": solved.residual, "converged": solved.converged })
}

impl Picture<'_> {
    /// A line for people.
    fn tell(&self) -> Done {
        let names: Vec<_> = self.outputs.iter().map(|p| p.display().to_string()).collect();
        output::line(&format!(
            "{} ({} × {}, {:.2} s to load, {:.2} s to render on {} {})",
            names.join(", "),
            self.scene.camera.width,
            self.scene.camera.height,
            self.loading.as_secs_f64(),
            self.rendering.as_secs_f64(),
            self.info.id(),
            self.info.name
        ))
    }

    /// What is written into the picture: device, estimators, version, settings, timing.
    fn metadata(&self, options: &Options) -> Vec<(String, String)> {
        let Self { scene, info, .. } = self;
        let stages = self.rendered.report.stages.iter();
        let stages: Vec<_> = stages.map(|s| format!("{} {:.3} s", s.stage, s.time.as_secs_f64())).collect();
        let paths = self.rendered.report.paths;
        let paths = paths
            .map(|p| [("airlight.path.samples", p.samples.to_string()), ("airlight.path.noise", p.noise.to_string())]);
        let settings: Vec<_> = options.set.iter().map(|(k, v)| format!("{k}={v}")).collect();
        let scattering = self.rendered.report.solved.first().map_or_else(String::new, |s| {
            let how = if s.converged { "converged" } else { "not converged" };
            format!("{} sweeps, residual {:.1e}, {how}", s.sweeps, s.residual)
        });
        [
            ("airlight.version", env!("CARGO_PKG_VERSION").to_owned()),
            ("airlight.device", format!("{} {}", info.id(), info.name)),
            ("airlight.scene", options.scene.display().to_string()),
            ("airlight.frame", self.frame.to_string()),
            ("airlight.estimators", estimators(scene).join("; ")),
            ("airlight.settings", settings.join("; ")),
            ("airlight.scattering", scattering),
            ("airlight.samples", scene.camera.samples.to_string()),
            ("airlight.step", scene.quality.step.to_string()),
            ("airlight.steps", scene.quality.steps.map_or_else(|| "by step".to_owned(), |steps| steps.to_string())),
            ("airlight.jitter", info::jitter(scene.quality.jitter).to_owned()),
            ("airlight.scale", scene.quality.scale.to_string()),
            ("airlight.density", info::precision(scene.quality.density).to_owned()),
            ("airlight.temporal", scene.quality.temporal.to_string()),
            ("airlight.seconds", format!("{:.3}", self.rendering.as_secs_f64())),
            ("airlight.stages", stages.join("; ")),
        ]
        .into_iter()
        .chain(paths.into_iter().flatten())
        .map(|(k, v)| (k.to_owned(), v))
        .collect()
    }

    /// What a report says once for all frames, by the first.
    fn common(&self) -> Map<String, Value> {
        let Self { scene, info, .. } = self;
        [
            ("version", json!(env!("CARGO_PKG_VERSION"))),
            ("device", devices::device(info)),
            ("size", json!([scene.camera.width, scene.camera.height])),
            ("samples", json!(scene.camera.samples)),
            ("estimators", json!(estimators(scene))),
        ]
        .into_iter()
        .map(|(k, v)| (k.to_owned(), v))
        .collect()
    }

    /// What a report says of each frame.
    fn report(&self, writing: Duration) -> Value {
        let report = &self.rendered.report;
        let stages: Vec<_> = report
            .stages
            .iter()
            .map(|s| json!({ "stage": s.stage, "ran": s.ran, "seconds": s.time.as_secs_f64() }))
            .collect();
        json!({
            "frame": self.frame,
            "outputs": self.outputs.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
            "seconds": {
                "load": self.loading.as_secs_f64(),
                "render": self.rendering.as_secs_f64(),
                "write": writing.as_secs_f64(),
            },
            "uploads": report.uploads,
            "stages": stages,
            "device_bytes": report.bytes,
            "scattering": report.solved.first().map(solved),
            "paths": report.paths.map(|p| json!({ "samples": p.samples, "noise": output::number(p.noise) })),
        })
    }
}
