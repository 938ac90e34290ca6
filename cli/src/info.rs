//! `airlight info`

use std::path::{Path, PathBuf};
use std::sync::Arc;

use airlight::basis::window::{DIRECTIONS, Ringing};
use airlight::device::{Bytes, FieldFormat, FieldSpec};
use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::{Environment, Light, Split};
use airlight::media::{ControlPoint, DensitySource, Grid, GridMedium, Lattice, Medium, OpticsField, OpticsFields};
use airlight::scene::{Background, Extraction, Jitter, Material, Negative, Precision, Reason, Scene};
use airlight::transfer::Channel;
use airlight_formats::image::load_environment;
use airlight_formats::scene::{Animation, LoadedSurface, SceneFile};
use airlight_formats::{mesh, transfer, volume};
use serde_json::{Map, Value, json};

use crate::failure::Failure;
use crate::output::{number, short};
use crate::{Done, output};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// A scene (.toml), a volume (.vdb, .nrrd, .nii, .nii.gz, .mhd, .vol), an environment (.exr, .hdr), surfaces (.obj, .gltf,
    /// .glb) or a transfer (.transfer).
    file: PathBuf,
    /// Print JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> Done {
    let path = &options.file;
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let value = match ending.as_str() {
        "toml" => scene(path)?,
        "exr" | "hdr" | "pic" => environment_file(path)?,
        "obj" | "gltf" | "glb" => mesh_file(path)?,
        "transfer" => transfer_file(path)?,
        _ => volume_file(path)?,
    };
    if options.json {
        return output::json(&value);
    }
    let mut lines = Vec::new();
    print(&value, "", &mut lines);
    lines.iter().try_for_each(|line| output::line(line))
}

/// One line a value, indented by depth; lists of numbers on one line.
fn print(value: &Value, indent: &str, lines: &mut Vec<String>) {
    let Value::Object(map) = value else { return };
    for (key, value) in map {
        let key = key.replace('_', " ");
        match value {
            Value::Object(_) => {
                lines.push(format!("{indent}{key}"));
                print(value, &format!("{indent}  "), lines);
            }
            Value::Array(items) if items.iter().any(Value::is_object) => {
                for (i, item) in items.iter().enumerate() {
                    lines.push(format!("{indent}{key} {i}"));
                    print(item, &format!("{indent}  "), lines);
                }
            }
            _ => lines.push(format!("{indent}{key:<22} {}", plain(value))),
        }
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(n) if n.is_f64() => short(n.as_f64().unwrap_or(f64::NAN)),
        Value::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(" "),
        Value::Null => "-".into(),
        other => other.to_string(),
    }
}

fn scene(path: &Path) -> Result<Value, Failure> {
    let mut file = SceneFile::open(path, &[])?;
    let loaded = file.frame(file.first_frame())?;
    let Scene { camera, medium, optics, environment, background, frame, lights, estimate, quality, .. } = &loaded.scene;
    let mut field = density(medium.as_ref());
    let columns = field.remove("largest_column").and_then(|c| serde_json::from_value::<[f64; 3]>(c).ok());
    if let Some(columns) = columns {
        // Depth along the box's axes; where extinction has colour, of its densest channel.
        let depth = columns.map(|c| c * f64::from(optics.extinction.max_element()));
        field.insert("optical_depth".into(), json!(depth.map(number)));
    }
    Ok(json!({
        "scene": path.display().to_string(),
        "frame": frame,
        "animation": file.animation().map(animation),
        "camera": {
            "origin": camera.origin.to_array(),
            "target": camera.target.to_array(),
            "fov": camera.fov,
            "size": [camera.width, camera.height],
            "samples": camera.samples,
        },
        "medium": field,
        "transfer_function": classification(medium.as_ref()),
        "optics": {
            "extinction": rgb(optics.extinction),
            "albedo": rgb(optics.albedo),
            "emission": rgb(optics.emission),
            "phase": format!("{:?}", PhaseName(&optics.phase)),
            "mean_cosine": optics.phase.moments(2)[1],
            "fields": fields(medium.as_ref()),
        },
        "environment": environment.as_ref().map(|e| environment_of(&loaded.scene, e)),
        "background": background.as_ref().map(background_values),
        "light": lights.iter().map(light).collect::<Vec<_>>(),
        "surface": loaded.surfaces.iter().map(surface).collect::<Vec<_>>(),
        "estimate": {
            "environment": estimate.environment.as_ref().map(|e| format!("{e:?}")),
            "lights": estimate.lights.as_ref().map(|l| format!("{l:?}")),
            "scattering": estimate.scattering.as_ref().map(|s| format!("{s:?}")),
            "all": estimate.all.as_ref().map(|a| format!("{a:?}")),
        },
        "quality": {
            "step": quality.step,
            "step_metres": quality.step * medium.voxel(),
            "steps": quality.steps,
            "jitter": jitter(quality.jitter),
            "scale": quality.scale,
            "temporal": quality.temporal,
            "density": precision(quality.density),
        },
        "files": loaded.files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>(),
        "warnings": loaded.warnings,
    }))
}

/// The values of a medium that is classified, and what they mean.
fn classification(medium: &dyn Medium) -> Option<Value> {
    let DensitySource::Classified(medium) = medium.source() else { return None };
    let dims = medium.lattice().dims();
    let point = |p: &ControlPoint| {
        json!({
            "value": shortest(p.value),
            "density": shortest(p.density),
            "albedo": rgb(p.albedo),
            "emission": rgb(p.emission),
            "tint": rgb(p.tint),
        })
    };
    let points: Vec<_> = medium.function().points().iter().map(point).collect();
    Some(json!({ "values": range(dims, |k, out| medium.values_slice(k, out)), "point": points }))
}

/// The largest values, in each channel, of what scatters and shines otherwise than the density does; null where nothing does.
fn fields(medium: &dyn Medium) -> Value {
    let dims = medium.lattice().dims();
    let largest = |field: Option<OpticsField<'_>>, values: usize| {
        let field = field?;
        let mut most = [0.0f32; 4];
        if !walkable(dims) {
            return Some(Value::Null);
        }
        let mut slice = vec![0.0f32; dims.x as usize * dims.y as usize * values];
        for k in 0..dims.z {
            field.slice(k, &mut slice);
            for voxel in slice.chunks_exact(values) {
                most.iter_mut().zip(voxel).for_each(|(most, v)| *most = most.max(*v));
            }
        }
        let channels = most[..values.min(3)].iter().map(|v| number(f64::from(*v)));
        Some(json!(channels.collect::<Vec<_>>()))
    };
    let OpticsFields { scattering, emission, emission_color, seen } = medium.optics_fields();
    let mut map = Map::new();
    for (name, field, values) in [
        ("scattering", scattering, 4),
        ("emission", emission, 1),
        ("emission_color", emission_color, 4),
        ("seen", seen, 4),
    ] {
        map.extend(largest(field, values).map(|most| (name.to_owned(), most)));
    }
    if map.is_empty() { Value::Null } else { Value::Object(map) }
}

/// A jitter as scenes name it.
pub(crate) fn jitter(jitter: Jitter) -> &'static str {
    match jitter {
        Jitter::None => "none",
        Jitter::BlueNoise => "blue-noise",
    }
}

pub(crate) fn precision(precision: Precision) -> &'static str {
    match precision {
        Precision::F32 => "f32",
        Precision::F16 => "f16",
    }
}

/// A phase function without the entries of its table.
struct PhaseName<'a>(&'a airlight::media::Phase);

impl std::fmt::Debug for PhaseName<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            airlight::media::Phase::Table(_) => f.write_str("Table"),
            other => other.fmt(f),
        }
    }
}

fn rgb(v: Vec3) -> [f64; 3] {
    v.to_array().map(shortest)
}

/// As the scene says it: 0.9, not 0.8999999761581421.
fn shortest(v: f32) -> f64 {
    v.to_string().parse().unwrap_or_else(|_| v.into())
}

fn light(light: &Light) -> Value {
    match light {
        Light::Directional { to_light, irradiance } => {
            json!({ "kind": "directional", "to_light": to_light.to_array(), "irradiance": rgb(*irradiance) })
        }
        Light::Point { position, intensity } => {
            json!({ "kind": "point", "position": position.to_array(), "intensity": rgb(*intensity) })
        }
        Light::Spot { position, axis, intensity, beam, cutoff } => json!({
            "kind": "spot",
            "position": position.to_array(),
            "axis": axis.to_array(),
            "intensity": rgb(*intensity),
            "beam": beam.to_degrees(),
            "cutoff": cutoff.to_degrees(),
        }),
    }
}

fn surface(surface: &LoadedSurface) -> Value {
    let (min, max) = surface.bounds;
    let materials: Vec<_> = surface.materials.iter().map(|(name, m)| material(name, m)).collect();
    json!({
        "source": surface.source,
        "triangles": surface.triangles,
        "bounds": [min.to_array(), max.to_array()],
        "material": materials,
    })
}

fn material(name: &str, material: &Material) -> Value {
    json!({
        "name": name,
        "diffuse": rgb(material.diffuse),
        "specular": rgb(material.specular),
        "shininess": shortest(material.shininess),
    })
}

fn mesh_file(path: &Path) -> Result<Value, Failure> {
    let file = mesh::read(path)?;
    let materials: Vec<_> = file.names.iter().zip(file.mesh.materials()).map(|(name, m)| material(name, m)).collect();
    Ok(json!({
        "mesh": path.display().to_string(),
        "format": file.format.name(),
        "triangles": file.mesh.triangles().len(),
        "degenerate": file.mesh.degenerate(),
        "vertices": file.mesh.positions().len(),
        "smooth": !file.mesh.normals().is_empty(),
        "bounds": file.mesh.bounds().map(|(min, max)| [min.to_array(), max.to_array()]),
        "material": materials,
        "files": file.files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>(),
        "warnings": file.warnings.iter().chain(&file.missing).collect::<Vec<_>>(),
    }))
}

fn environment_file(path: &Path) -> Result<Value, Failure> {
    let (environment, warnings) = load_environment(path)?;
    let mut value = json!({ "environment": path.display().to_string(), "warnings": warnings });
    if let (Value::Object(all), Value::Object(values)) = (&mut value, environment_values(&environment)) {
        all.extend(values);
    }
    Ok(value)
}

/// An environment and what a scene makes of it.
fn environment_of(scene: &Scene, environment: &Environment) -> Value {
    let mut value = environment_values(environment);
    if let (Some(Extraction { taken, reason, .. }), Value::Object(sun)) = (scene.sun(), &mut value["sun"]) {
        let cost = match reason {
            Reason::Gain(cost) | Reason::NoGain(cost) => Some([cost.whole, cost.split].map(number)),
            Reason::Asked | Reason::Refused | Reason::Whole | Reason::Shadow => None,
        };
        sun.insert("extracted".into(), json!(taken));
        sun.insert("why".into(), json!(reason.to_string()));
        sun.insert("cost".into(), json!(cost));
    }
    let ringing = |r: Ringing| json!({ "directions": r.negative, "depth": number(r.depth) });
    value["negative"] = json!(scene.negative().map(|Negative { plain, windowed }| {
        json!({ "of": DIRECTIONS, "without_window": ringing(plain), "with_window": ringing(windowed) })
    }));
    value
}

fn sun(environment: &Environment) -> Option<Value> {
    let Split { sun, .. } = environment.split()?;
    Some(json!({
        "to_light": sun.to_light.to_array(),
        "irradiance": sun.irradiance.to_array().map(number),
        "angular_radius": number(sun.angular_radius.to_degrees()),
        "share": number(sun.share),
    }))
}

fn environment_values(environment: &Environment) -> Value {
    let image = environment.image();
    json!({
        "size": [image.width, image.height],
        "scale": rgb(environment.scale),
        "rotation": environment.rotation,
        "visible": environment.visible,
        "mean_radiance": environment.mean_radiance().to_array().map(number),
        "max_radiance": environment.max_radiance().to_array().map(number),
        "sun": sun(environment),
    })
}

fn background_values(background: &Background) -> Value {
    let surfaces: Vec<f64> =
        background.depth().into_iter().flatten().filter(|d| **d < Background::FAR).map(|d| f64::from(*d)).collect();
    let nearest = surfaces.iter().copied().reduce(f64::min);
    json!({
        "color": background.color().is_some(),
        "depth": background.depth().is_some(),
        "surfaces": surfaces.len(),
        "nearest": nearest.map(number),
        "farthest": surfaces.iter().copied().reduce(f64::max).map(number),
    })
}

fn animation(animation: &Animation) -> Value {
    let (first, last) = (*animation.frames.start(), *animation.frames.end());
    let track: Vec<_> = animation
        .tracks
        .iter()
        .map(|t| json!({ "key": t.key, "frames": t.frames, "interpolation": t.curve.name() }))
        .collect();
    let seconds = (f64::from(last - first) + 1.0) / animation.fps;
    json!({ "frames": [first, last], "fps": animation.fps, "seconds": seconds, "track": track })
}

fn volume_file(path: &Path) -> Result<Value, Failure> {
    let file = volume::inspect(path)?;
    let mut grids = Vec::new();
    for info in &file.grids {
        let mut value = json!({
            "name": info.name,
            "values": info.value_type,
            "class": info.class,
            "encoding": info.encoding,
            "placed": info.placed,
        });
        let Value::Object(map) = &mut value else { continue };
        if let Some(bounds) = info.bounds {
            map.insert("first_index".into(), json!(bounds.min.to_array()));
            map.insert("dims".into(), json!(bounds.dims.to_array()));
        }
        if let Some((min, max)) = info.world_bounds() {
            map.insert("bounds".into(), json!([min.to_array(), max.to_array()]));
        }
        map.insert("active_voxels".into(), json!(info.active_voxels));
        match &info.usable {
            Ok(()) => map.extend(grid_values(path, &info.name)?),
            Err(reason) => {
                map.insert("not_usable".into(), json!(reason));
            }
        }
        grids.push(value);
    }
    Ok(json!({ "volume": path.display().to_string(), "format": file.format.name(), "grid": grids }))
}

/// What the values of a grid are, whether or not they could be densities.
fn grid_values(path: &Path, name: &str) -> Result<Map<String, Value>, Failure> {
    let grid = volume::read(path, Some(name))?.grid;
    let bytes = grid.bytes();
    let mut values = match GridMedium::new(Arc::new(grid.clone()), None) {
        Ok(medium) => density(&medium),
        Err(reason) => {
            let mut map = raw_range(&grid);
            map.insert("not_a_density".into(), json!(reason.to_string()));
            map
        }
    };
    values.remove("dims");
    values.remove("bounds");
    values.insert("memory_bytes".into(), json!(bytes));
    Ok(values)
}

/// Voxels of the largest grid that is walked one by one: more would take minutes.
const MAX_WALK: u64 = 1 << 31;
/// The largest slice of one: some values are held for each of its voxels, and a few voxels far apart make a large slice.
const MAX_SLICE: u64 = 1 << 26;

/// Whether a grid is small enough to be walked.
fn walkable(dims: UVec3) -> bool {
    let slice = u64::from(dims.x) * u64::from(dims.y);
    slice <= MAX_SLICE && slice.saturating_mul(dims.z.into()) <= MAX_WALK
}

fn raw_range(grid: &Grid) -> Map<String, Value> {
    let fill = |k: u32, out: &mut [f32]| grid.write_slice(grid.bounds(), grid.bounds().min.z + k as i32, out);
    Map::from_iter([("range".to_owned(), range(grid.bounds().dims, fill))])
}

/// The least and the largest value of what is small enough to be walked.
fn range(dims: UVec3, fill: impl FnMut(u32, &mut [f32])) -> Value {
    if !walkable(dims) {
        return Value::Null;
    }
    let (mut min, mut max) = (f32::INFINITY, f32::NEG_INFINITY);
    slices(dims, fill, |_, slice| {
        for &v in slice {
            (min, max) = (min.min(v), max.max(v));
        }
    });
    json!([number(min.into()), number(max.into())])
}

/// Calls `visit` with every slice of a grid that is [`walkable`].
fn slices(dims: UVec3, mut fill: impl FnMut(u32, &mut [f32]), mut visit: impl FnMut(u32, &[f32])) {
    let mut slice = vec![0.0f32; dims.x as usize * dims.y as usize];
    for k in 0..dims.z {
        fill(k, &mut slice);
        visit(k, &slice);
    }
}

/// What a density takes on a device: laid out, and in bricks where it is held sparse; in 32 and in 16 bits.
fn device_bytes(medium: &dyn Medium) -> Value {
    let dims = medium.lattice().dims().to_array();
    let dense = [FieldFormat::Scalar, FieldFormat::half(1.0)].map(|format| FieldSpec::dense(dims, 1, format));
    let bricks = medium.density_bricks().map(|bricks| dense.map(|field| field.in_bricks(bricks.layout()).bytes()));
    json!({ "dense": dense.map(|field| field.bytes()), "bricks": bricks })
}

/// Size, place, range, mean and largest columns of a density.
fn density(medium: &dyn Medium) -> Map<String, Value> {
    let lattice: &Lattice = medium.lattice();
    let (dims, (min, max)) = (lattice.dims(), lattice.world_bounds());
    let mut map = Map::new();
    map.insert("dims".into(), json!(dims.to_array()));
    map.insert("bounds".into(), json!([min.to_array(), max.to_array()]));
    map.insert("voxel_edges".into(), json!(lattice.edges().to_array()));
    map.insert("device_bytes".into(), device_bytes(medium));
    if !walkable(dims) {
        map.insert("range".into(), Value::Null);
        return map;
    }
    let (nx, ny) = (dims.x as usize, dims.y as usize);
    let (mut low, mut high, mut sum, mut filled) = (f32::INFINITY, 0.0f32, 0.0f64, 0u64);
    let (mut along_z, mut along_x, mut along_y) = (vec![0.0f64; nx * ny], 0.0f64, 0.0f64);
    slices(
        dims,
        |k, out| medium.density_slice(k, out),
        |_, slice| {
            let mut down = vec![0.0f64; nx];
            for (j, line) in slice.chunks_exact(nx).enumerate() {
                let mut across = 0.0;
                for (i, &v) in line.iter().enumerate() {
                    (low, high, filled) = (low.min(v), high.max(v), filled + u64::from(v > 0.0));
                    let v = f64::from(v);
                    across += v;
                    down[i] += v;
                    along_z[j * nx + i] += v;
                }
                sum += across;
                along_x = along_x.max(across);
            }
            along_y = down.into_iter().fold(along_y, f64::max);
        },
    );
    let edges = lattice.edges();
    let columns = DVec3::new(along_x, along_y, along_z.into_iter().fold(0.0, f64::max)) * edges;
    map.insert("range".into(), json!([number(low.into()), number(high.into())]));
    map.insert("mean".into(), number(sum / lattice.voxels() as f64));
    map.insert("filled".into(), number(filled as f64 / lattice.voxels() as f64));
    map.insert("largest_column".into(), json!(columns.to_array().map(number)));
    map
}

/// What a transfer holds, and what its compression loses.
fn transfer_file(path: &Path) -> Result<Value, Failure> {
    let found = transfer::read(path)?;
    let (shape, origin) = (found.shape(), found.origin());
    let channel = |channel: &Channel| {
        let mut errors: Vec<f64> = channel.errors.iter().map(|&e| e.into()).collect();
        errors.sort_by(f64::total_cmp);
        let at =
            |share: f64| errors.get((share * errors.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
        json!({
            "loss": channel.loss,
            "cluster_loss": { "least": at(0.0), "median": at(0.5), "most": at(1.0) },
        })
    };
    Ok(json!({
        "transfer": path.display().to_string(),
        "cells": shape.cells,
        "rows": shape.rows.len(),
        "basis": transfer::basis_text(shape.basis),
        "functions": shape.basis.count(),
        "bands": shape.bands,
        "clusters": shape.clusters,
        "components": shape.components,
        "memory": Bytes(found.bytes()).to_string(),
        "made_from": {
            "lattice": format!("{:032x}", origin.lattice),
            "density": format!("{:032x}", origin.density),
            "optics": format!("{:032x}", origin.optics),
        },
        "channel": found.channels().iter().map(channel).collect::<Vec<_>>(),
    }))
}
