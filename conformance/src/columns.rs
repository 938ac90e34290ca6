//! Columns of density toward lights in sums of Gaussians, which have a closed form: what the schemes of `propagate` are
//! worth.

use airlight::device::Usage;
use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::Lattice;
use airlight::reference::closed::gaussian_column;
use airlight::scene::{Opacity, Scheme};
use airlight::stage::propagate::{faces, steps};
use airlight::stage::{GridParams, LightPlace, Propagate, PropagateParams, Reduce, ReduceParams, Stage};
use libtest_mimic::Failed;
use rayon::prelude::*;

use crate::bench::Bench;
use crate::compare::compare;
use crate::fixtures::noise;
use crate::truth;
use crate::{Case, Difference, Record, Subject, check, tolerance};

/// c exp(-a²|x-b|²), a in 1/m.
#[derive(Clone, Copy, Debug)]
struct Gaussian {
    c: f64,
    a: f64,
    b: DVec3,
}

/// A sum of Gaussians in a box, and lights.
pub struct Lit {
    /// What it is.
    pub name: String,
    blobs: Vec<Gaussian>,
    lattice: Lattice,
    lights: Vec<Light>,
}

/// What a scheme gives at the cells' centres, for all lights.
pub struct Found {
    /// Of the columns.
    pub difference: Difference,
    /// Sum of the columns over the sum of the true ones.
    pub ratio: f64,
    /// Light after light.
    columns: Vec<f64>,
    expected: Vec<f64>,
}

/// The reference's Gaussians, and lines through them with their columns.
struct Reference {
    blobs: Vec<Gaussian>,
    segments: Vec<Segment>,
}

/// A line of the reference.
#[derive(serde::Deserialize)]
struct Segment {
    start: [f64; 3],
    end: [f64; 3],
    optical_depth: f64,
}

/// Extinction of the reference's Gaussians, 1/m and unit of density.
const EXTINCTION: f64 = 8.0;

fn reference() -> Result<Reference, Failed> {
    #[derive(serde::Deserialize)]
    struct Medium {
        a: Vec<f64>,
        b: Vec<[f64; 3]>,
        c: Vec<f64>,
    }
    #[derive(serde::Deserialize)]
    struct Blobs {
        medium: Medium,
        segments: Vec<Segment>,
    }
    let file = truth::file("blobs.json")?;
    let Blobs { medium: Medium { a, b, c }, segments } = serde_json::from_slice(&file.bytes)?;
    let blobs = a.iter().zip(&b).zip(&c).map(|((&a, &b), &c)| Gaussian { c, a, b: DVec3::from(b) }).collect();
    Ok(Reference { blobs, segments })
}

/// So many random Gaussians within a box, each as wide as a share of it.
fn random(seed: u64, count: usize, min: DVec3, size: DVec3, widths: [f64; 2]) -> Vec<Gaussian> {
    let one = |v: &[f32]| {
        let [x, y, z, c, a] = [0, 1, 2, 3, 4].map(|n| f64::from(v[n]));
        let b = min + (0.1 + 0.8 * DVec3::new(x, y, z)) * size;
        Gaussian { c: 0.2 + 1.8 * c, a: widths[0] + (widths[1] - widths[0]) * a, b }
    };
    noise(seed, 5 * count).chunks_exact(5).map(one).collect()
}

/// The reference's 40 Gaussians under its sun and its lamp, and random ones under lights of every kind.
///
/// # Errors
/// A missing or damaged file.
pub fn all() -> Result<Vec<Lit>, Failed> {
    let reference = reference()?.blobs;
    let (min, max) = (DVec3::new(-0.6, 0.0, -0.5), DVec3::new(0.6, 0.8, 0.5));
    let lattice = Lattice::in_box(UVec3::new(72, 48, 60), min, max)?;
    let point = |p: DVec3| Light::point(p, Vec3::ONE);
    let lit = |name: &str, blobs: &[Gaussian], lattice: &Lattice, light| Lit {
        name: name.into(),
        blobs: blobs.to_vec(),
        lattice: lattice.clone(),
        lights: vec![light],
    };
    let mut all = vec![
        lit("reference, lamp inside", &reference, &lattice, point(DVec3::new(0.3, 0.55, 0.1))?),
        lit("reference, lamp outside", &reference, &lattice, point(DVec3::new(-0.9, 1.1, 0.6))?),
        lit("reference, sun", &reference, &lattice, Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::ONE)?),
    ];
    let lattice = Lattice::in_box(UVec3::splat(64), DVec3::ZERO, DVec3::ONE)?;
    for seed in 0..3u64 {
        let blobs = random(200 + seed, 30, DVec3::ZERO, DVec3::ONE, [5.0, 20.0]);
        let place = noise(300 + seed, 3);
        let place = 0.1 + 0.8 * DVec3::new(place[0].into(), place[1].into(), place[2].into());
        all.push(lit(&format!("random {seed}, lamp inside"), &blobs, &lattice, point(place)?));
        let toward = place - 0.5;
        all.push(lit(&format!("random {seed}, sun"), &blobs, &lattice, Light::directional(toward, Vec3::ONE)?));
    }
    Ok(all)
}

/// Cells of [`everywhere`], one to a voxel.
const CELLS: UVec3 = UVec3::new(40, 28, 34);

/// Lights in random places within a cell and in special ones, all at once, in a box of [`CELLS`].
fn everywhere() -> Result<(Lit, Vec<String>), Failed> {
    let (min, size) = (DVec3::new(-0.4, 0.1, -0.5), CELLS.as_dvec3() / 40.0);
    let lattice = Lattice::in_box(CELLS, min, min + size)?;
    let [i, j, k] = (CELLS.as_dvec3() - 0.5).to_array();
    let mut places: Vec<(String, [f64; 3])> = [
        ("a cell's centre", [11.0, 20.0, 7.0]),
        ("a face between cells", [11.5, 20.0, 7.0]),
        ("an edge between cells", [11.5, 20.5, 7.0]),
        ("a corner of cells", [11.5, 20.5, 7.5]),
        ("a wall", [-0.5, 9.3, 21.8]),
        ("an edge of the box", [i, j, 12.7]),
        ("a corner of the box", [i, -0.5, k]),
        ("beside a wall", [17.2, j + 0.3, 25.6]),
        ("beside a corner", [-1.1, -0.9, k + 0.7]),
        ("a box's length away", [-38.0, 33.1, 60.4]),
    ]
    .map(|(name, at)| (name.to_owned(), at))
    .to_vec();
    for (n, v) in noise(401, 12).chunks_exact(3).enumerate() {
        let at = [0, 1, 2].map(|a| f64::from(v[a]) * CELLS.as_dvec3()[a] - 0.5);
        places.push((format!("random place {n}"), at));
    }
    // Two at one place.
    let again = places[10].1;
    places.push(("random place 0 again".into(), again));
    let point = |at: [f64; 3]| Light::point(lattice.index_to_world().transform_point3(at.into()), Vec3::ONE);
    let lights = places.iter().map(|(_, at)| point(*at)).collect::<Result<_, _>>()?;
    let blobs = random(400, 20, min, size, [4.0, 10.0]);
    let names = places.into_iter().map(|(name, _)| name).collect();
    Ok((Lit { name: "everywhere".into(), blobs, lattice, lights }, names))
}

impl Lit {
    /// Runs a scheme on `cells` cells along the longest side and compares columns at the cells' centres.
    ///
    /// # Errors
    /// A fault of the device.
    pub fn measure(&self, subject: &Subject, scheme: Scheme, cells: u32) -> Result<Found, Failed> {
        let (lattice, grid) = (&self.lattice, GridParams::new(&self.lattice));
        let dims = lattice.dims();
        let options = Opacity { cells, scheme, ..Opacity::default() };
        let cells = options.grid(lattice.edges() * dims.as_dvec3());
        let number = scheme.number();
        let to_world = lattice.index_to_world();
        let every = |n: [u32; 3]| (0..n.iter().product()).map(move |i| [i % n[0], i / n[0] % n[1], i / n[0] / n[1]]);
        let float = |at: [u32; 3]| DVec3::from(at.map(f64::from));
        let voxels: Vec<_> = every(dims.to_array()).collect();
        let rho: Vec<f32> = voxels.par_iter().map(|&at| self.at(to_world.transform_point3(float(at))) as f32).collect();
        let places: Vec<_> = self.lights.iter().map(|l| LightPlace::new(l, lattice, cells, number)).collect();
        let side = |a: usize| grid.dims[a] as f32 / cells[a] as f32;
        let lights = places.len() as u32;
        let lanes = PropagateParams::LANES as usize * lights.div_ceil(PropagateParams::LANES) as usize;
        let params = PropagateParams {
            dims: grid.dims,
            world_x: grid.world[0],
            world_y: grid.world[1],
            world_z: grid.world[2],
            cells: [cells[0], cells[1], cells[2], lights.div_ceil(PropagateParams::LANES)],
            cell: [side(0), side(1), side(2), lattice.shortest_edge() as f32],
            lights,
            steps: steps(&places, cells, number),
            scheme: number,
            items: PropagateParams::most_items(cells, lights, number).ok_or("too many items")?,
        };
        let count = cells.iter().product::<u32>() as usize;
        let mut bench = Bench::new(subject)?;
        let density = bench.scalars(dims.to_array(), &rho)?;
        let occupancy = bench.room::<[f32; 2]>(count, Usage::Work)?;
        let coarse = [cells[0], cells[1], cells[2], 0];
        let reduce = Stage::Reduce(Reduce {
            params: ReduceParams::new(grid.dims, coarse, [side(0), side(1), side(2), 0.0]),
            density,
            other: None,
            out: occupancy,
        });
        bench.device.dispatch(&reduce, 0..reduce.axis())?;
        let out = bench.room(lanes * count, Usage::Output)?;
        let stage = Stage::Propagate(Propagate {
            params,
            density,
            occupancy: Some(occupancy),
            lights: bench.buf(&places)?,
            faces: match scheme {
                Scheme::ShortCharacteristics => Some(bench.buf(&faces(&places, cells))?),
                Scheme::Metric | Scheme::Published => None,
            },
            values: bench.room(count * self.lights.len(), Usage::Work)?,
            out,
        });
        stage.validate()?;
        bench.device.dispatch(&stage, 0..stage.axis())?;
        let found = bench.read(out)?;
        let scale = dims.as_dvec3() / float(cells);
        let centers: Vec<_> =
            every(cells).map(|at| to_world.transform_point3((float(at) + 0.5) * scale - 0.5)).collect();
        let mean = scheme == Scheme::ShortCharacteristics;
        let (mut columns, mut expected) = (Vec::new(), Vec::new());
        for (n, light) in self.lights.iter().enumerate() {
            let ends: Vec<_> = centers.iter().map(|&x| self.end(light, x)).collect();
            let value = |(cell, (x, end)): (usize, (&DVec3, &DVec3))| {
                f64::from(found[lanes * cell + n]) * if mean { x.distance(*end) } else { 1.0 }
            };
            columns.extend(centers.iter().zip(&ends).enumerate().map(value));
            expected.par_extend(centers.par_iter().zip(&ends).map(|(&x, &end)| column(&self.blobs, x, end)));
        }
        let ratio = columns.iter().sum::<f64>() / expected.iter().sum::<f64>();
        let difference = compare(columns.iter().copied(), expected.iter().copied());
        Ok(Found { difference, ratio, columns, expected })
    }

    fn at(&self, x: DVec3) -> f64 {
        self.blobs.iter().map(|g| g.c * (-(g.a * g.a) * x.distance_squared(g.b)).exp()).sum()
    }

    /// Where the way from `x` to the light ends: at it, or at the wall before it.
    fn end(&self, light: &Light, x: DVec3) -> DVec3 {
        let (min, max) = self.lattice.world_bounds();
        let (toward, distance, _) = light.at(x, 0.0);
        let wall = |a: usize| if toward[a] > 0.0 { max[a] - x[a] } else { min[a] - x[a] } / toward[a];
        let walls = (0..3).filter(|&a| toward[a] != 0.0).map(wall);
        x + walls.fold(distance, f64::min) * toward
    }
}

fn column(blobs: &[Gaussian], from: DVec3, to: DVec3) -> f64 {
    blobs.iter().map(|g| gaussian_column(g.c, g.a, g.b, from, to)).sum()
}

/// Where cells are as large as voxels.
const SIDE: u32 = 64;

pub(crate) fn cases() -> Vec<Case> {
    let gathers = "as the published scheme is known to";
    vec![
        Case::new(
            "columns::short_characteristics",
            "Columns of sums of Gaussians by short characteristics are the closed form's.",
            short_characteristics,
        )
        .within(&tolerance::COLUMNS),
        Case::new(
            "columns::places",
            "Columns toward lights anywhere in a cell, on its borders, on the box's walls and outside are the closed form's.",
            places,
        )
        .within(&tolerance::COLUMNS),
        Case::new(
            "columns::closed_form",
            "The closed form is that of the reference's lines; no device takes part, but all are held to it.",
            closed_form,
        )
        .within(&tolerance::CLOSED_COLUMNS),
        Case::new("columns::metric", "Columns gathered with the way's own length miss by some per cent.", |s, r| {
            band(s, r, Scheme::Metric, 0.02, 0.15)
        }),
        Case::new("columns::published", format!("Columns gathered by whole cells are too deep, {gathers}."), |s, r| {
            band(s, r, Scheme::Published, 0.25, 0.75)
        }),
    ]
}

fn short_characteristics(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    for lit in all()?.iter().take(5) {
        let found = lit.measure(subject, Scheme::ShortCharacteristics, SIDE)?;
        record.hold(&lit.name, found.columns, found.expected);
    }
    Ok(())
}

fn places(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let (lit, names) = everywhere()?;
    let found = lit.measure(subject, Scheme::ShortCharacteristics, CELLS.max_element())?;
    let cells = CELLS.element_product() as usize;
    let lights = found.columns.chunks_exact(cells).zip(found.expected.chunks_exact(cells));
    for (name, (columns, expected)) in names.iter().zip(lights) {
        record.hold(name, columns.iter().copied(), expected.iter().copied());
    }
    Ok(())
}

fn closed_form(_: &Subject, record: &mut Record) -> Result<(), Failed> {
    let Reference { blobs, segments } = reference()?;
    check!(segments.len() == 64, "{} lines", segments.len());
    let found = segments.iter().map(|s| EXTINCTION * column(&blobs, s.start.into(), s.end.into()));
    record.hold("optical depth", found, segments.iter().map(|s| s.optical_depth));
    Ok(())
}

/// Errors that a scheme is known for; a smaller one would be another scheme.
fn band(subject: &Subject, record: &mut Record, scheme: Scheme, least: f64, most: f64) -> Result<(), Failed> {
    for lit in all()?.iter().take(2) {
        let found = lit.measure(subject, scheme, SIDE)?;
        let error = found.difference.relative_l2;
        check!(error >= least, "{}: relative L2 {error:.3}, at least {least}", lit.name);
        record.score(&lit.name, "relative L2 error", error, most);
        let deeper = scheme != Scheme::Published || found.ratio > 1.2;
        check!(deeper, "{}: {:.3} times the depth", lit.name, found.ratio);
    }
    Ok(())
}
