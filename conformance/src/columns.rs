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

/// A sum of Gaussians in a box, and a light.
pub struct Lit {
    /// What it is.
    pub name: String,
    blobs: Vec<Gaussian>,
    lattice: Lattice,
    light: Light,
}

/// What a scheme gives at the cells' centres.
pub struct Found {
    /// Of the columns.
    pub difference: Difference,
    /// Sum of the columns over the sum of the true ones.
    pub ratio: f64,
    columns: Vec<f64>,
    expected: Vec<f64>,
}

/// The reference's 40 Gaussians under its sun and its lamp, and random ones under lights of every kind.
///
/// # Errors
/// A missing or damaged file.
pub fn all() -> Result<Vec<Lit>, Failed> {
    #[derive(serde::Deserialize)]
    struct Medium {
        a: Vec<f64>,
        b: Vec<[f64; 3]>,
        c: Vec<f64>,
    }
    #[derive(serde::Deserialize)]
    struct Blobs {
        medium: Medium,
    }
    let file = truth::file("blobs.json")?;
    let Blobs { medium: Medium { a, b, c } } = serde_json::from_slice(&file.bytes)?;
    let reference: Vec<_> =
        a.iter().zip(&b).zip(&c).map(|((&a, &b), &c)| Gaussian { c, a, b: DVec3::from(b) }).collect();
    let (min, max) = (DVec3::new(-0.6, 0.0, -0.5), DVec3::new(0.6, 0.8, 0.5));
    let lattice = Lattice::in_box(UVec3::new(72, 48, 60), min, max)?;
    let point = |p: DVec3| Light::point(p, Vec3::ONE);
    let lit = |name: &str, blobs: &[Gaussian], lattice: &Lattice, light| Lit {
        name: name.into(),
        blobs: blobs.to_vec(),
        lattice: lattice.clone(),
        light,
    };
    let mut all = vec![
        lit("reference, lamp inside", &reference, &lattice, point(DVec3::new(0.3, 0.55, 0.1))?),
        lit("reference, lamp outside", &reference, &lattice, point(DVec3::new(-0.9, 1.1, 0.6))?),
        lit("reference, sun", &reference, &lattice, Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::ONE)?),
    ];
    let lattice = Lattice::in_box(UVec3::splat(64), DVec3::ZERO, DVec3::ONE)?;
    for seed in 0..3u64 {
        let at = |v: &[f32]| 0.1 + 0.8 * DVec3::new(v[0].into(), v[1].into(), v[2].into());
        let random = |v: &[f32]| Gaussian { c: 0.2 + 1.8 * f64::from(v[3]), a: 5.0 + 15.0 * f64::from(v[4]), b: at(v) };
        let blobs: Vec<_> = noise(200 + seed, 150).chunks_exact(5).map(random).collect();
        let place = at(&noise(300 + seed, 3));
        all.push(lit(&format!("random {seed}, lamp inside"), &blobs, &lattice, point(place)?));
        let toward = place - 0.5;
        all.push(lit(&format!("random {seed}, sun"), &blobs, &lattice, Light::directional(toward, Vec3::ONE)?));
    }
    Ok(all)
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
        let place = LightPlace::new(&self.light, lattice, cells, number);
        let side = |a: usize| grid.dims[a] as f32 / cells[a] as f32;
        let params = PropagateParams {
            dims: grid.dims,
            world_x: grid.world[0],
            world_y: grid.world[1],
            world_z: grid.world[2],
            cells: [cells[0], cells[1], cells[2], 1],
            cell: [side(0), side(1), side(2), lattice.shortest_edge() as f32],
            lights: 1,
            steps: steps(&[place], cells, number),
            scheme: number,
            items: PropagateParams::most_items(cells, 1, number).ok_or("too many items")?,
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
        let out = bench.room(4 * count, Usage::Output)?;
        let stage = Stage::Propagate(Propagate {
            params,
            density,
            occupancy: Some(occupancy),
            lights: bench.buf(&[place])?,
            faces: match scheme {
                Scheme::ShortCharacteristics => Some(bench.buf(&faces(&[place], cells))?),
                Scheme::Metric | Scheme::Published => None,
            },
            out,
        });
        stage.validate()?;
        bench.device.dispatch(&stage, 0..stage.axis())?;
        let found = bench.read(out)?;
        let scale = dims.as_dvec3() / float(cells);
        let ways: Vec<_> = every(cells)
            .map(|at| to_world.transform_point3((float(at) + 0.5) * scale - 0.5))
            .map(|x| (x, self.end(x)))
            .collect();
        let mean = scheme == Scheme::ShortCharacteristics;
        let columns = found.chunks_exact(4).zip(&ways);
        let columns: Vec<_> =
            columns.map(|(value, (x, end))| f64::from(value[0]) * if mean { x.distance(*end) } else { 1.0 }).collect();
        let column =
            |(x, end): &(DVec3, DVec3)| self.blobs.iter().map(|g| gaussian_column(g.c, g.a, g.b, *x, *end)).sum();
        let expected: Vec<f64> = ways.par_iter().map(column).collect();
        let ratio = columns.iter().sum::<f64>() / expected.iter().sum::<f64>();
        let difference = compare(columns.iter().copied(), expected.iter().copied());
        Ok(Found { difference, ratio, columns, expected })
    }

    fn at(&self, x: DVec3) -> f64 {
        self.blobs.iter().map(|g| g.c * (-(g.a * g.a) * x.distance_squared(g.b)).exp()).sum()
    }

    /// Where the way from `x` to the light ends: at it, or at the wall before it.
    fn end(&self, x: DVec3) -> DVec3 {
        let (min, max) = self.lattice.world_bounds();
        let (toward, distance, _) = self.light.at(x, 0.0);
        let wall = |a: usize| if toward[a] > 0.0 { max[a] - x[a] } else { min[a] - x[a] } / toward[a];
        let walls = (0..3).filter(|&a| toward[a] != 0.0).map(wall);
        x + walls.fold(distance, f64::min) * toward
    }
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
