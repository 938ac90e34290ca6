//! `[estimate]` and `[quality]`.

use airlight_core::basis::Window;
use airlight_core::scene::{
    AllEstimate, Content, Direct, Elimination, EnvironmentEstimate, Estimate, ExtractSun, Interpolation, Jitter,
    LightsEstimate, Local, Material, Opacity, Orders, Path, Precision, Quality, RecordBasis, Records,
    ScatteringEstimate, Scheme, Shadow, Solver, SurfaceShadow, Sweeps,
};

use super::error::Fault;
use super::table::{Field, Table};
use super::transfer::{self, TRANSFER};

const NONE: (&str, &[&str]) = ("none", &[]);
const RECORDS: (&str, &[&str]) = (
    "records",
    &[
        "cells",
        "bands",
        "basis",
        "directions",
        "content",
        "interpolation",
        "elimination",
        "solver",
        "extract_sun",
        "window",
    ],
);
const OPACITY: (&str, &[&str]) = ("opacity", &["cells", "scheme", "surface_shadow"]);
const DIRECT: (&str, &[&str]) = ("direct", &["shadow", "surface_shadow"]);
const LOCAL: (&str, &[&str]) = ("local", &["ambient", "diffuse", "specular", "shininess"]);
const SWEEPS: (&str, &[&str]) = ("sweeps", &["cells", "bands", "directions", "orders", "tolerance"]);
const PATH: (&str, &[&str]) = ("path", &["samples", "max_depth", "time_limit", "noise"]);

/// Without `[estimate]`, and for a key that it leaves out: the defaults. `"none"` leaves that light out.
/// A transfer that lies in a file is to be read.
pub(super) fn estimate<'a>(root: &Table<'a>) -> Result<(Estimate, Option<transfer::Plan<'a>>), Fault> {
    let mut estimate = Estimate::default();
    let Some(field) = root.get("estimate") else { return Ok((estimate, None)) };
    let table = field.table(&["environment", "lights", "scattering", "all"])?;
    if let Some(all) = table.wanted("all") {
        for key in ["environment", "lights", "scattering"] {
            if let Some(field) = table.wanted(key) {
                return Err(field.error(format!(
                    "estimate.all brings all light; estimate.{key} would bring a part of it twice; give one of them"
                )));
            }
        }
        let (kind, options) = all.kinds(None, &[PATH, TRANSFER])?;
        if kind == "path" {
            return Ok((Estimate { all: Some(AllEstimate::Path(path(&options)?)), ..Estimate::none() }, None));
        }
        let (transfer, file) = transfer::parse(options)?;
        return Ok((Estimate { all: Some(AllEstimate::Transfer(transfer)), ..Estimate::none() }, file));
    }
    if let Some(field) = table.get("environment") {
        estimate.environment = environment(&field)?;
    }
    if let Some(field) = table.get("lights") {
        estimate.lights = lights(&field)?;
    }
    if let Some(field) = table.get("scattering") {
        estimate.scattering = scattering(&field)?;
    }
    Ok((estimate, None))
}

fn scattering(field: &Field<'_>) -> Result<Option<ScatteringEstimate>, Fault> {
    if field.is_none() {
        return Ok(None);
    }
    let (kind, table) = field.kinds(Some("sweeps"), &[SWEEPS, NONE])?;
    if kind == "none" {
        return Ok(None);
    }
    let default = Sweeps::default();
    let orders = orders(&table, "estimate.scattering")?;
    Ok(Some(ScatteringEstimate::Sweeps(Sweeps {
        cells: table.or("cells", default.cells, |f| f.whole(1..=Sweeps::MAX_CELLS))?,
        bands: table.or("bands", default.bands, |f| f.whole(1..=Records::MAX_BANDS))?,
        directions: table.or("directions", default.directions, |f| f.whole(12..=12 * Records::MAX_NSIDE.pow(2)))?,
        orders,
    })))
}

/// Which orders of scattering an estimator of the key `of` brings.
pub(super) fn orders(table: &Table<'_>, of: &str) -> Result<Orders, Fault> {
    let tolerance = table.or("tolerance", None, |f| {
        f.number_where("above 0 and below 1", |v| v > 0.0 && v < 1.0).map(|v| Some(v as f32))
    })?;
    let converged = Orders::Converged { tolerance: tolerance.unwrap_or(Orders::TOLERANCE) };
    table.or("orders", converged, |f| match f.text() {
        Ok("converged") => Ok(converged),
        Ok(_) => Err(f.wrong(&format!("it must be \"converged\" or a whole number from 1 to {}", Orders::MAX))),
        Err(_) if tolerance.is_some() => {
            Err(f.error(format!("{of}: a number of orders needs no tolerance; give one of them")))
        }
        Err(_) => f.whole(1..=Orders::MAX).map(Orders::Count),
    })
}

fn path(options: &Table<'_>) -> Result<Path, Fault> {
    let default = Path::default();
    let positive = |f: Field<'_>| f.number_where("above 0", |v| v > 0.0);
    Ok(Path {
        samples: options.or("samples", default.samples, |f| f.whole(1..=Path::MAX_SAMPLES))?,
        max_depth: options.or("max_depth", None, |f| f.whole(1..=u32::MAX).map(Some))?,
        time_limit: options.or("time_limit", None, |f| positive(f).map(Some))?,
        noise: options.or("noise", None, |f| {
            f.number_where("above 0 and at most 1", |v| v > 0.0 && v <= 1.0).map(|v| Some(v as f32))
        })?,
    })
}

fn environment(field: &Field<'_>) -> Result<Option<EnvironmentEstimate>, Fault> {
    if field.is_none() {
        return Ok(None);
    }
    let (kind, table) = field.kinds(Some("records"), &[RECORDS, NONE])?;
    if kind == "none" {
        return Ok(None);
    }
    let default = Records::default();
    let basis = table.or("basis", default.basis, |f| light_basis(&f, &table))?;
    let contents = [
        ("radiance", Some(Content::Radiance)),
        ("transmittance", Some(Content::Transmittance)),
        ("phase", Some(Content::Phase)),
    ];
    let content = table.or("content", default.content, |f| f.choice(&contents))?;
    // What sweeps do not know is marched, unless the scene says otherwise.
    let solver = match (content, table.wanted("elimination")) {
        (Content::Phase, _) | (_, Some(_)) => Solver::March,
        _ => default.solver,
    };
    let solvers = [("sweep", Some(Solver::Sweep)), ("march", Some(Solver::March))];
    let interpolations = [("trilinear", Some(Interpolation::Trilinear)), ("nearest", Some(Interpolation::Nearest))];
    let windows =
        [("none", Some(Window::None)), ("hanning", Some(Window::Hanning)), ("lanczos", Some(Window::Lanczos))];
    Ok(Some(EnvironmentEstimate::Records(Records {
        cells: table.or("cells", default.cells, |f| f.whole(1..=Records::MAX_CELLS))?,
        bands: table.or("bands", default.bands, |f| f.whole(1..=Records::MAX_BANDS))?,
        basis,
        directions: table.or("directions", default.directions, |f| f.whole(12..=12 * Records::MAX_NSIDE.pow(2)))?,
        content,
        interpolation: table.or("interpolation", default.interpolation, |f| f.choice(&interpolations))?,
        elimination: table.or("elimination", default.elimination, |f| elimination(&f))?,
        solver: table.or("solver", solver, |f| f.choice(&solvers))?,
        extract_sun: table.or("extract_sun", default.extract_sun, |f| extract_sun(&f))?,
        window: table.or(
            "window",
            default.window,
            |f| if f.is_none() { Ok(Window::None) } else { f.choice(&windows) },
        )?,
    })))
}

fn light_basis(field: &Field<'_>, records: &Table<'_>) -> Result<RecordBasis, Fault> {
    let (kind, table) = field.kinds(None, &[("sh", &[]), ("dsf", &["functions"]), ("srbf", &[])])?;
    if kind == "srbf" {
        return Err(field.pending("take \"sh\" or \"dsf\""));
    }
    if kind == "sh" {
        return Ok(RecordBasis::Harmonics);
    }
    if let Some(bands) = records.get("bands") {
        return Err(bands.error(
            "estimate.environment.bands are of spherical harmonics; basis = \"dsf\" has functions in their place",
        ));
    }
    let numbers = "it must be 12, 42, 162 or 642";
    Ok(RecordBasis::Discrete(table.or("functions", RecordBasis::DISCRETE, |f| match f.whole(1..=u32::MAX) {
        Ok(n) if RecordBasis::FUNCTIONS.contains(&n) => Ok(n),
        _ => Err(f.wrong(numbers)),
    })?))
}

fn extract_sun(field: &Field<'_>) -> Result<ExtractSun, Fault> {
    match (field.text(), field.flag()) {
        (Ok("auto"), _) => Ok(ExtractSun::Auto),
        (_, Ok(true)) => Ok(ExtractSun::Always),
        (_, Ok(false)) => Ok(ExtractSun::Never),
        _ if field.is_none() => Ok(ExtractSun::Never),
        _ => Err(field.wrong("it must be \"auto\", true or false")),
    }
}

fn elimination(field: &Field<'_>) -> Result<Elimination, Fault> {
    if field.is_none() {
        return Ok(Elimination::None);
    }
    let (kind, table) = field.kinds(None, &[("exact", &[]), ("probes", &["n"]), NONE])?;
    Ok(match kind {
        "exact" => Elimination::Exact,
        "probes" => Elimination::Probes(table.or("n", 3, |f| f.whole(1..=Records::MAX_PROBES))?),
        _ => Elimination::None,
    })
}

fn lights(field: &Field<'_>) -> Result<Option<LightsEstimate>, Fault> {
    if field.is_none() {
        return Ok(None);
    }
    let (kind, table) = field.kinds(Some("opacity"), &[OPACITY, DIRECT, LOCAL, NONE])?;
    Ok(match kind {
        "opacity" => {
            let default = Opacity::default();
            let schemes = [
                ("short-characteristics", Some(Scheme::ShortCharacteristics)),
                ("metric", Some(Scheme::Metric)),
                ("published", Some(Scheme::Published)),
            ];
            Some(LightsEstimate::Opacity(Opacity {
                cells: table.or("cells", default.cells, |f| f.whole(1..=Opacity::MAX_CELLS))?,
                scheme: table.or("scheme", default.scheme, |f| f.choice(&schemes))?,
                surface_shadow: table.or("surface_shadow", default.surface_shadow, |f| surface_shadow(&f))?,
            }))
        }
        "direct" => {
            let shadows = [
                ("march", Some(Shadow::March)),
                ("propagated", Some(Shadow::Propagated)),
                ("none", Some(Shadow::None)),
            ];
            let default = Direct::default();
            Some(LightsEstimate::Direct(Direct {
                shadow: table.or("shadow", default.shadow, |f| f.choice(&shadows))?,
                surface_shadow: table.or("surface_shadow", default.surface_shadow, |f| surface_shadow(&f))?,
            }))
        }
        "local" => {
            let default = Local::default();
            let number = |key, default: f32, low: f32, high: f32| {
                let within = |v: f64| (f64::from(low)..=f64::from(high)).contains(&v);
                table.or(key, default, |f| f.number_where(&format!("from {low} to {high}"), within).map(|v| v as f32))
            };
            Some(LightsEstimate::Local(Local {
                ambient: number("ambient", default.ambient, 0.0, Local::MOST)?,
                diffuse: number("diffuse", default.diffuse, 0.0, Local::MOST)?,
                specular: number("specular", default.specular, 0.0, Local::MOST)?,
                shininess: number("shininess", default.shininess, 1.0, Material::MAX_SHININESS)?,
            }))
        }
        _ => None,
    })
}

fn surface_shadow(field: &Field<'_>) -> Result<SurfaceShadow, Fault> {
    if field.is_none() {
        return Ok(SurfaceShadow::None);
    }
    let (kind, table) = field.kinds(None, &[("map", &["texels"]), ("ray", &[]), NONE])?;
    Ok(match kind {
        "map" => {
            let texels = table.or("texels", SurfaceShadow::TEXELS, |f| f.whole(1..=SurfaceShadow::MAX_TEXELS))?;
            SurfaceShadow::Map(texels)
        }
        "ray" => SurfaceShadow::Ray,
        _ => SurfaceShadow::None,
    })
}

pub(super) fn quality(root: &Table<'_>) -> Result<Quality, Fault> {
    let mut quality = Quality::default();
    let Some(field) = root.get("quality") else { return Ok(quality) };
    let table = field.table(&["step", "steps", "jitter", "scale", "temporal", "density"])?;
    table.exclusive("step", "steps")?;
    // The least that `Scene::validate` takes.
    quality.step = table.or("step", quality.step, |f| f.number_where("at least 0.001 voxels", |v| v >= 1e-3))?;
    quality.steps = table.or("steps", None, |f| f.whole(1..=Quality::MAX_STEPS).map(Some))?;
    let jitters = [("none", Some(Jitter::None)), ("blue-noise", Some(Jitter::BlueNoise))];
    quality.jitter =
        table.or("jitter", quality.jitter, |f| if f.is_none() { Ok(Jitter::None) } else { f.choice(&jitters) })?;
    quality.scale = table.or("scale", quality.scale, |f| match f.whole(1..=4)? {
        3 => Err(f.wrong("it must be 1, 2 or 4")),
        scale => Ok(scale),
    })?;
    let precisions = [("f32", Some(Precision::F32)), ("f16", Some(Precision::F16))];
    quality.density = table.or("density", quality.density, |f| f.choice(&precisions))?;
    quality.temporal = table.or("temporal", quality.temporal, |f| f.flag())?;
    Ok(quality)
}
