//! `airlight estimators`

use std::path::PathBuf;
use std::time::{Duration, Instant};

use airlight::Renderer;
use airlight::device::{Bytes, DeviceInfo};
use airlight::exec::{Hooks, Progress, Rendered};
use airlight::glam::DVec3;
use airlight::metric::{Difference, block_means, difference};
use airlight::scene::{
    AllEstimate, Content, Direct, EnvironmentEstimate, Estimate, Film, LightsEstimate, Opacity, Orders, Path, Quality,
    Records, ScatteringEstimate, Scene, Scheme, Shadow, Solver, Sweeps, TransferEstimate, TransferSource,
};
use airlight_conformance::{Sheet, SheetEntry, rgb, write_sheet};
use airlight_formats::scene::SceneFile;
use serde_json::{Value, json};

use crate::bench::time;
use crate::compare::{TONE_MAP, flips};
use crate::failure::Failure;
use crate::output::{number, short, triple};
use crate::progress::Meter;
use crate::{Done, devices, output, render};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The scene, a .toml file.
    scene: PathBuf,
    /// auto, a backend (cpu), an index (cpu:0) or part of a device's name. May repeat; without it, every device that
    /// there is. The first renders the truth.
    #[arg(long, value_name = "ID")]
    device: Vec<String>,
    /// Write the table, the pictures and their differences from the truth into one HTML file.
    #[arg(short, long = "output", value_name = "SHEET.html")]
    output: Option<PathBuf>,
    /// Size of the pictures in pixels, instead of the scene's.
    #[arg(long, value_name = "WxH", value_parser = render::size)]
    size: Option<(u32, u32)>,
    /// Paths per pixel of the truth.
    #[arg(long, value_name = "N", default_value_t = Path::default().samples)]
    samples: u32,
    /// Seconds after which the truth begins no more paths.
    #[arg(long, value_name = "S")]
    time_limit: Option<f64>,
    /// Put a value in place of the scene's, by dotted key: light.0.intensity=2. May repeat.
    #[arg(long, value_name = "KEY=VALUE", value_parser = render::assignment)]
    set: Vec<(String, String)>,
    /// Print JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

/// Frames that are timed, and the time after which no more are begun.
const FRAMES: u32 = 5;
const PATIENCE: Duration = Duration::from_secs(10);

/// Pixels along a side of a block.
const BLOCK: usize = 8;

/// By how much of its distance from the target the eye moves from frame to frame.
const STRIDE: f64 = 1e-3;

/// A choice of estimators, in words.
struct Choice {
    environment: String,
    lights: String,
    scattering: String,
    estimate: Estimate,
}

/// A choice on a device.
struct Row<'a> {
    device: &'a DeviceInfo,
    choice: &'a Choice,
    measured: Result<Measured, String>,
}

struct Measured {
    film: Film,
    prepare: Duration,
    /// Median of the frames, and their number.
    frame: Duration,
    frames: usize,
    bytes: u64,
    difference: Difference,
    /// Relative L2 of the means over blocks of [`BLOCK`] pixels a side, in which most of the truth's noise is gone.
    blocks: f64,
    flip: f64,
}

pub(crate) fn run(options: &Options) -> Done {
    let html = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("html"));
    if let Some(path) = options.output.as_ref().filter(|path| !html(path)) {
        return Err(Failure::input(format!("{}: the sheet is written as .html", path.display())));
    }
    let mut overrides = options.set.clone();
    if let Some((w, h)) = options.size {
        overrides.push(("camera.size".into(), format!("[{w}, {h}]")));
    }
    let mut file = SceneFile::open(&options.scene, &overrides)?;
    let loaded = file.frame(file.first_frame())?;
    let mut warnings = Vec::new();
    render::warn(loaded.warnings, &mut warnings);
    let scene = lit_alike(loaded.scene);
    let truth = truth(&scene, options);
    truth.validate().map_err(Failure::input)?;
    let (choices, left_out) = choices(&scene);
    let mut absent = Vec::new();
    let subjects = devices::subjects(&options.device, &mut absent)?;
    let Some(first) = subjects.first() else { return Err(Failure::input("there is no device to render on")) };

    let mut meter = Meter::new();
    let begin = Instant::now();
    let expected = rendered(&first.id(), &truth, "truth", &mut meter)?;
    let seconds = begin.elapsed();
    let size = [scene.camera.width, scene.camera.height];
    let pixels: Vec<[f32; 3]> = rgb(&expected.film).collect();
    let mut rows = Vec::new();
    for device in &subjects {
        for choice in &choices {
            let what = format!("{}, {}", device.id(), choice.name());
            let scene = Scene { estimate: choice.estimate.clone(), ..scene.clone() };
            let measured = measure(&device.id(), &scene, &pixels, &what, &mut meter).map_err(|f| f.message);
            rows.push(Row { device, choice, measured });
        }
    }
    meter.clear();
    let told = Told { options, truth: &truth, device: first, expected: &expected, seconds };
    if let Some(path) = &options.output {
        write_sheet(path, &told.sheet(size, pixels, &rows, &left_out)).map_err(Failure::output)?;
    }
    if options.json {
        let devices: Vec<_> = subjects.iter().map(devices::device).collect();
        let not_fitting = left_out.iter().map(|(name, why)| json!({ "estimators": name, "reason": why }));
        let not_fitting: Vec<_> = not_fitting.collect();
        output::json(&json!({
            "version": env!("CARGO_PKG_VERSION"),
            "scene": options.scene.display().to_string(),
            "size": size,
            "devices": devices,
            "truth": told.truth_values(),
            "flip_tone_map": TONE_MAP,
            "entries": rows.iter().map(Row::values).collect::<Vec<_>>(),
            "left_out": not_fitting,
            "absent": absent,
            "warnings": warnings,
        }))?;
    } else {
        told.table(&rows, &left_out).iter().try_for_each(|line| output::line(line))?;
    }
    let faults: Vec<_> = rows.iter().filter_map(Row::fault).collect();
    if faults.is_empty() { Ok(()) } else { Err(Failure::running(faults.join("; "))) }
}

/// The scene without light that its estimators leave out: the truth knows no such choice.
fn lit_alike(mut scene: Scene) -> Scene {
    if scene.estimate.all.is_none() {
        scene.environment = scene.environment.filter(|_| scene.estimate.environment.is_some());
        if scene.estimate.lights.is_none() {
            scene.lights.clear();
        }
    }
    scene
}

/// The orders of scattering that the scene's own estimators bring; none where they bring all.
fn orders(scene: &Scene) -> Option<u32> {
    match &scene.estimate.all {
        Some(AllEstimate::Path(path)) => path.max_depth,
        Some(AllEstimate::Transfer(TransferEstimate { source: TransferSource::Making(making), .. })) => {
            match making.orders {
                Orders::Converged { .. } => None,
                Orders::Count(n) => Some(n),
            }
        }
        // A file does not say; all, unless its maker was told otherwise.
        Some(AllEstimate::Transfer(_)) => None,
        None => match &scene.estimate.scattering {
            Some(ScatteringEstimate::Sweeps(Sweeps { orders: Orders::Converged { .. }, .. })) => None,
            Some(ScatteringEstimate::Sweeps(Sweeps { orders: Orders::Count(n), .. })) => Some(*n),
            None => Some(1),
        },
    }
}

/// The scene as its truth is rendered: by path tracing, of as many orders as the scene's own estimators bring.
fn truth(scene: &Scene, options: &Options) -> Scene {
    let path = Path { samples: options.samples, max_depth: orders(scene), time_limit: options.time_limit, noise: None };
    let estimate = Estimate { all: Some(AllEstimate::Path(path)), ..Estimate::none() };
    let quality = Quality { scale: 1, temporal: false, ..scene.quality };
    Scene { estimate, quality, ..scene.clone() }
}

/// Every estimator in its turn, beside the scene's own of the other light; and what does not fit, with the reason.
fn choices(scene: &Scene) -> (Vec<Choice>, Vec<(String, String)>) {
    let own = match scene.estimate.all {
        Some(_) => Estimate::default(),
        None => scene.estimate.clone(),
    };
    let mut environments = vec![own.environment.clone()];
    if let Some(EnvironmentEstimate::Records(records)) = &own.environment {
        for content in [Content::Radiance, Content::Transmittance, Content::Phase] {
            // Sweeps do not know the eye.
            let solvers: &[Solver] =
                if content == Content::Phase { &[Solver::March] } else { &[Solver::Sweep, Solver::March] };
            for &solver in solvers {
                environments.push(Some(EnvironmentEstimate::Records(Records { content, solver, ..records.clone() })));
            }
        }
    }
    let mut lights = vec![own.lights.clone()];
    let lit = Scene { estimate: own.clone(), ..scene.clone() };
    if let Some(own) = own.lights.filter(|_| !lit.lit().lights.is_empty()) {
        let surface_shadow = own.surface_shadow();
        lights.push(Some(LightsEstimate::Opacity(Opacity { surface_shadow, ..Opacity::default() })));
        for shadow in [Shadow::March, Shadow::Propagated, Shadow::None] {
            lights.push(Some(LightsEstimate::Direct(Direct { shadow, surface_shadow })));
        }
    }
    let mut scatterings = vec![own.scattering.clone()];
    if let Some(ScatteringEstimate::Sweeps(sweeps)) = own.scattering {
        for directions in [48, 192] {
            scatterings.push(Some(ScatteringEstimate::Sweeps(Sweeps { directions, ..sweeps })));
        }
        // What single scattering lacks.
        scatterings.push(None);
    }
    let mut estimates: Vec<Estimate> = Vec::new();
    let of = |environment: &Option<EnvironmentEstimate>, lights: &Option<LightsEstimate>| Estimate {
        environment: environment.clone(),
        lights: lights.clone(),
        scattering: scatterings[0].clone(),
        all: None,
    };
    let each_light = lights.iter().map(|light| of(&environments[0], light));
    let each_environment = environments.iter().map(|environment| of(environment, &lights[0]));
    let each_scattering = scatterings
        .iter()
        .map(|scattering| Estimate { scattering: scattering.clone(), ..of(&environments[0], &lights[0]) });
    let transfer = match &scene.estimate.all {
        Some(all @ AllEstimate::Transfer(_)) => Some(Estimate { all: Some(all.clone()), ..Estimate::none() }),
        _ => None,
    };
    for estimate in transfer.into_iter().chain(each_light).chain(each_environment).chain(each_scattering) {
        if !estimates.contains(&estimate) {
            estimates.push(estimate);
        }
    }
    let (mut choices, mut left_out) = (Vec::new(), Vec::new());
    for estimate in estimates {
        let choice = Choice::new(estimate);
        let with = Scene { estimate: choice.estimate.clone(), ..scene.clone() };
        match with.validate() {
            Ok(()) => choices.push(choice),
            Err(why) => left_out.push((choice.name(), why.to_string())),
        }
    }
    (choices, left_out)
}

impl Choice {
    fn new(estimate: Estimate) -> Self {
        if let Some(all) = &estimate.all {
            let [environment, lights, scattering] = [(); 3].map(|()| all.name().to_owned());
            return Self { environment, lights, scattering, estimate };
        }
        let environment = match &estimate.environment {
            Some(EnvironmentEstimate::Records(records)) => {
                format!("records, {:?}, {:?}", records.content, records.solver).to_lowercase()
            }
            None => "none".into(),
        };
        let lights = match &estimate.lights {
            Some(LightsEstimate::Opacity(opacity)) => match opacity.scheme {
                Scheme::ShortCharacteristics => "opacity".into(),
                other => format!("opacity, {other:?}").to_lowercase(),
            },
            Some(LightsEstimate::Direct(direct)) => format!("direct, {:?}", direct.shadow).to_lowercase(),
            Some(LightsEstimate::Local(_)) => "local".into(),
            None => "none".into(),
        };
        let scattering = match &estimate.scattering {
            Some(ScatteringEstimate::Sweeps(sweeps)) => format!("sweeps, {} directions", sweeps.directions),
            None => "none".into(),
        };
        Self { environment, lights, scattering, estimate }
    }

    fn name(&self) -> String {
        format!("{} + {} + {}", self.environment, self.lights, self.scattering)
    }
}

/// A picture by a device of its own.
fn rendered(id: &str, scene: &Scene, what: &str, meter: &mut Meter) -> Result<Rendered, Failure> {
    Ok(render_on(&mut Renderer::new(airlight::open(id)?), scene, what, meter)?)
}

fn render_on(
    renderer: &mut Renderer,
    scene: &Scene,
    what: &str,
    meter: &mut Meter,
) -> Result<Rendered, airlight::exec::RenderError> {
    let mut show = |progress: Progress| meter.show(format_args!("{what}: {}", progress.stage), progress.done);
    renderer.render_with(scene, &mut Hooks { progress: Some(&mut show), cancel: None })
}

/// Renders the scene from the start, then frames of an eye that moves.
fn measure(id: &str, scene: &Scene, truth: &[[f32; 3]], what: &str, meter: &mut Meter) -> Result<Measured, Failure> {
    let begin = Instant::now();
    let mut renderer = Renderer::new(airlight::open(id)?);
    let Rendered { film, report } = render_on(&mut renderer, scene, what, meter)?;
    let prepare = begin.elapsed();
    let mut scene = scene.clone();
    let camera = scene.camera;
    let [_, right, _] = camera.axes();
    let stride: DVec3 = right * (STRIDE * camera.origin.distance(camera.target));
    let mut times = Vec::new();
    let begin = Instant::now();
    for k in 1..=FRAMES {
        scene.camera.origin = camera.origin + f64::from(k) * stride;
        let begin_frame = Instant::now();
        render_on(&mut renderer, &scene, what, meter)?;
        times.push(begin_frame.elapsed());
        if begin.elapsed() >= PATIENCE {
            break;
        }
    }
    times.sort();
    let found: Vec<[f32; 3]> = rgb(&film).collect();
    let blocks = |picture: &[[f32; 3]]| block_means(picture, film.width as usize, BLOCK);
    let (_, flip) = flips(&found, truth, [film.width, film.height]);
    Ok(Measured {
        prepare,
        frame: times[times.len() / 2],
        frames: times.len(),
        bytes: report.bytes,
        difference: difference(&found, truth),
        blocks: difference(&blocks(&found), &blocks(truth)).relative_l2,
        flip,
        film,
    })
}

impl Row<'_> {
    fn name(&self) -> String {
        format!("{} on {}", self.choice.name(), self.device.id())
    }

    fn fault(&self) -> Option<String> {
        Some(format!("{}: {}", self.name(), self.measured.as_ref().err()?))
    }

    /// Texts for [`COLUMNS`].
    fn cells(&self) -> Vec<String> {
        let Choice { environment, lights, scattering, .. } = self.choice;
        let mut cells = vec![self.device.id(), environment.clone(), lights.clone(), scattering.clone()];
        match &self.measured {
            Ok(m) => {
                let mean_ratio = m.difference.mean_ratio.map(|v| (v * 1e4).round() / 1e4);
                let percent = |v: f64| format!("{} %", short((v * 1e5).round() / 1e3));
                cells.extend([
                    percent(m.difference.relative_l2),
                    percent(m.blocks),
                    triple(mean_ratio),
                    short((m.flip * 1e5).round() / 1e5),
                    time(m.prepare),
                    time(m.frame),
                    Bytes(m.bytes).to_string(),
                ]);
            }
            Err(fault) => cells.push(format!("failed: {fault}")),
        }
        cells
    }

    fn values(&self) -> Value {
        let mut value = json!({
            "device": self.device.id(),
            "environment": self.choice.environment,
            "lights": self.choice.lights,
            "scattering": self.choice.scattering,
            "options": format!("{:?}", self.choice.estimate),
            "fault": self.measured.as_ref().err(),
        });
        if let Ok(m) = &self.measured {
            value["relative_l2"] = number(m.difference.relative_l2);
            value["relative_l2_of_blocks"] = number(m.blocks);
            value["max_abs"] = number(m.difference.max_abs);
            value["mean_ratio"] = json!(m.difference.mean_ratio.map(number));
            value["flip"] = number(m.flip);
            value["seconds"] = json!({
                "prepare": m.prepare.as_secs_f64(),
                "frame": m.frame.as_secs_f64(),
                "frames": m.frames,
            });
            value["device_bytes"] = json!(m.bytes);
        }
        value
    }
}

/// Columns of the table.
const COLUMNS: [&str; 11] = [
    "device",
    "environment",
    "lights",
    "scattering",
    "relative L2",
    "of blocks",
    "mean ratio",
    "FLIP",
    "prepare",
    "frame",
    "memory",
];

/// What the times and errors are.
const NOTE: &str = "Errors of linear RGB against the truth; blocks are means of 8 × 8 pixels, with less of its noise. \
                    Prepare: from opening the device to the first picture. Frame: the median of pictures of an eye \
                    that moves a little from one to the next. Memory: what the plan holds on the device.";

/// What is said of a comparison.
struct Told<'a> {
    options: &'a Options,
    truth: &'a Scene,
    device: &'a DeviceInfo,
    expected: &'a Rendered,
    seconds: Duration,
}

impl Told<'_> {
    fn truth_values(&self) -> Value {
        let paths = self.expected.report.paths;
        json!({
            "estimator": "path",
            "device": self.device.id(),
            "max_depth": orders(self.truth),
            "samples": paths.map(|p| p.samples),
            "noise": paths.map(|p| number(p.noise)),
            "seconds": self.seconds.as_secs_f64(),
        })
    }

    fn truth_in_words(&self) -> String {
        let orders = orders(self.truth).map_or("all orders".to_owned(), |n| match n {
            1 => "single scattering".into(),
            n => format!("{n} orders"),
        });
        let paths = self.expected.report.paths.map_or(String::new(), |paths| {
            format!(
                ", {} paths a pixel, noise {} % (relative L2)",
                paths.samples,
                short((paths.noise * 1e4).round() / 1e2)
            )
        });
        format!("truth: path, {orders}{paths}, {} on {}", time(self.seconds), self.device.id())
    }

    fn table(&self, rows: &[Row<'_>], left_out: &[(String, String)]) -> Vec<String> {
        let mut lines = vec![self.truth_in_words(), String::new()];
        let mut cells = vec![COLUMNS.map(str::to_owned).to_vec()];
        cells.extend(rows.iter().map(Row::cells));
        let width = |column: usize| {
            let lengths = cells.iter().filter(|row| row.len() == COLUMNS.len()).map(|row| row[column].chars().count());
            lengths.max().unwrap_or(0)
        };
        let widths: Vec<_> = (0..COLUMNS.len()).map(width).collect();
        for row in &cells {
            let padded = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}  "));
            lines.push(padded.collect::<String>().trim_end().to_owned());
        }
        lines.push(String::new());
        lines.extend(left_out.iter().map(|(name, why)| format!("left out: {name}: {why}")));
        lines.push(NOTE.to_owned());
        lines
    }

    fn sheet(&self, size: [u32; 2], truth: Vec<[f32; 3]>, rows: &[Row<'_>], left_out: &[(String, String)]) -> Sheet {
        let mut about =
            vec![format!("airlight {}, {}.", env!("CARGO_PKG_VERSION"), self.truth_in_words()), NOTE.to_owned()];
        about.push(format!("FLIP: {TONE_MAP}."));
        about.extend(left_out.iter().map(|(name, why)| format!("Left out: {name}: {why}")));
        let entry = |row: &Row<'_>| SheetEntry {
            name: row.name(),
            cells: row.cells(),
            found: row.measured.as_ref().ok().map(|m| rgb(&m.film).collect()),
        };
        Sheet {
            title: format!("Estimators of {}", self.options.scene.display()),
            about,
            columns: COLUMNS.to_vec(),
            size,
            truth,
            entries: rows.iter().map(entry).collect(),
        }
    }
}
