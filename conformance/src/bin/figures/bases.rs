//! Light in bases: Zhang, Dong and Ma 2013, figures 6 to 8.

use std::error::Error;
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use airlight::basis::{Basis, DiscreteSpherical, RadialFunctions, SphericalHarmonics, healpix};
use airlight::glam::{DVec3, Vec3};
use airlight::light::{Beams, Environment, Image, Prefilter};
use airlight_formats::image::{ToneMap, load_environment};
use rayon::prelude::*;

use super::percent;
use super::sheet::sheet;

/// n of the 12·n² directions in which light and its approximation are compared, 0.46° apart.
const NSIDE: u32 = 128;

/// Columns and rows of the lights that are made here.
const SIZE: [u32; 2] = [1024, 512];

/// Columns and rows of a picture of figure 7.
const TILE: [u32; 2] = [144, 72];

/// The sections on bases, and their pictures where there is a folder for them.
pub(super) fn bases(page: &mut String, images: Option<&Path>) -> Result<(), Box<dyn Error>> {
    let ways = ways()?;
    let lights = lights()?;
    approximation(page, &ways, &lights, images)?;
    times(page, &ways, &lights[lights.len() - 1].1)?;
    shadows(page, images)
}

/// A basis, and how light gets its coefficients.
struct Way {
    name: &'static str,
    basis: Box<dyn Basis>,
    fit: Fit,
    /// Whether figure 7 shows it.
    shown: bool,
}

enum Fit {
    /// The exact projection on spherical harmonics.
    Harmonics(SphericalHarmonics),
    /// What the basis makes of its moments.
    Moments,
    Prefiltered(DiscreteSpherical, Prefilter),
    LeastSquares(DiscreteSpherical),
}

impl Way {
    fn coefficients(&self, light: &Environment) -> Result<Vec<[f64; 3]>, Box<dyn Error>> {
        Ok(match &self.fit {
            Fit::Harmonics(harmonics) => light.project_sh(harmonics),
            Fit::Moments => self.basis.coefficients(&Beams::new(light).moments(&*self.basis, light.rotation))?,
            Fit::Prefiltered(basis, prefilter) => prefilter.coefficients(light, basis),
            Fit::LeastSquares(basis) => basis.least_squares(&light.moments(basis))?,
        })
    }
}

fn ways() -> Result<Vec<Way>, Box<dyn Error>> {
    let harmonics = |name, bands| -> Result<Way, Box<dyn Error>> {
        let basis = SphericalHarmonics::new(bands)?;
        Ok(Way { name, basis: Box::new(basis.clone()), fit: Fit::Harmonics(basis), shown: bands == 26 })
    };
    let discrete = |name, functions, fit: fn(DiscreteSpherical) -> Fit| -> Result<Way, Box<dyn Error>> {
        let basis = DiscreteSpherical::new(functions)?;
        let shown = name == "DSF 642, energy";
        Ok(Way { name, basis: Box::new(basis.clone()), fit: fit(basis), shown })
    };
    let energy = |basis| Fit::Prefiltered(basis, Prefilter::Energy);
    let gaussian = |basis| Fit::Prefiltered(basis, Prefilter::Gaussian { width: 1.0 });
    let radial = RadialFunctions::new(642)?;
    Ok(vec![
        harmonics("SH, 6 bands (36)", 6)?,
        harmonics("SH, 26 bands (676)", 26)?,
        Way { name: "SRBF 642", basis: Box::new(radial), fit: Fit::Moments, shown: true },
        discrete("DSF 162, energy", 162, energy)?,
        discrete("DSF 642, energy", 642, energy)?,
        discrete("DSF 2562, energy", 2562, energy)?,
        discrete("DSF 162, Gaussian (published)", 162, gaussian)?,
        discrete("DSF 642, Gaussian (published)", 642, gaussian)?,
        discrete("DSF 2562, Gaussian (published)", 2562, gaussian)?,
        discrete("DSF 642, sampled", 642, |basis| Fit::Prefiltered(basis, Prefilter::None))?,
        discrete("DSF 162, least squares", 162, Fit::LeastSquares)?,
        discrete("DSF 642, least squares", 642, Fit::LeastSquares)?,
        discrete("DSF 2562, least squares", 2562, Fit::LeastSquares)?,
    ])
}

fn lights() -> Result<Vec<(&'static str, Environment)>, Box<dyn Error>> {
    let scenes = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes"));
    let sky = |name: &str| load_environment(&scenes.join(name)).map(|(environment, _)| environment);
    let (sunset, city) = (sky("sunset.exr")?, sky("city.exr")?);
    let rest = |sky: &Environment| sky.split().map(|split| split.rest).ok_or("a sky without a sun");
    Ok(vec![
        ("checkerboard", made(checkerboard)?),
        ("three lights", made(three_lights)?),
        ("studio", sky("studio.exr")?),
        ("sunset without its sun", rest(&sunset)?),
        ("city without its sun", rest(&city)?),
        ("sunset", sunset),
        ("city", city),
    ])
}

/// A light by its radiance in every direction.
pub(super) fn made(radiance: impl Fn(DVec3) -> Vec3) -> Result<Environment, Box<dyn Error>> {
    let [width, height] = SIZE;
    let texel = |i: u32| radiance(direction(i, SIZE)).to_array();
    Ok(Environment::new(Image { width, height, texels: (0..width * height).map(texel).collect() })?)
}

/// Toward the middle of a texel of a latitude–longitude picture.
fn direction(i: u32, [width, height]: [u32; 2]) -> DVec3 {
    let (u, v) = (f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
    let ((sin, cos), azimuth) = ((PI * v / f64::from(height)).sin_cos(), PI - 2.0 * PI * u / f64::from(width));
    DVec3::new(sin * azimuth.sin(), cos, sin * azimuth.cos())
}

/// Black and white fields on the faces of a cube, four along each side.
fn checkerboard(d: DVec3) -> Vec3 {
    let axis = (0..3).fold(0, |best, a| if d[a].abs() > d[best].abs() { a } else { best });
    let field = |a: usize| (2.0 * (1.0 + d[a] / d[axis].abs())).floor() as i32;
    let odd = (field((axis + 1) % 3) + field((axis + 2) % 3) + i32::from(d[axis] > 0.0)) % 2 == 1;
    if odd { Vec3::ONE } else { Vec3::ZERO }
}

/// A red, a green and a blue disc of 15° in radius before grey.
pub(super) fn three_lights(d: DVec3) -> Vec3 {
    let lights = [
        (DVec3::new(0.8, 0.4, 0.4), Vec3::new(8.0, 0.4, 0.2)),
        (DVec3::new(-0.5, 0.7, 0.6), Vec3::new(0.3, 6.0, 0.4)),
        (DVec3::new(0.1, -0.3, -0.9), Vec3::new(0.2, 0.5, 9.0)),
    ];
    let lit = lights.iter().filter(|(toward, _)| toward.normalize().dot(d) > 15f64.to_radians().cos());
    lit.map(|(_, radiance)| *radiance).sum::<Vec3>() + 0.1
}

/// What a basis makes of a light.
struct Approximation {
    relative_l2: f64,
    /// Share of the sphere where a channel is below zero.
    negative: f64,
    /// How far a channel goes above its largest value, as a share of it.
    overshoot: f64,
    /// A picture of it.
    tile: Vec<[f32; 3]>,
}

fn value(basis: &dyn Basis, coefficients: &[[f64; 3]], d: DVec3) -> [f64; 3] {
    let mut sum = [0.0; 3];
    basis.each(d, &mut |k, v| (0..3).for_each(|c| sum[c] += coefficients[k][c] * v));
    sum
}

fn approximate(way: &Way, light: &Environment) -> Result<Approximation, Box<dyn Error>> {
    let coefficients = way.coefficients(light)?;
    let basis = &*way.basis;
    let largest = light.max_radiance();
    let rounding = -1e-9 * largest.max_element();
    let measure = |d: &DVec3| {
        let (found, truth) = (DVec3::from(value(basis, &coefficients, *d)), light.radiance(*d));
        let over = (found / largest - 1.0).max_element().max(0.0);
        let below = u32::from(found.min_element() < rounding);
        ((found - truth).length_squared(), truth.length_squared(), below, over)
    };
    let add = |a: (f64, f64, u32, f64), b: (f64, f64, u32, f64)| (a.0 + b.0, a.1 + b.1, a.2 + b.2, a.3.max(b.3));
    let directions = healpix::directions(NSIDE);
    let (error, square, negative, overshoot) = directions.par_iter().map(measure).reduce(|| (0.0, 0.0, 0, 0.0), add);
    let pixels = 0..TILE[0] * TILE[1];
    let tile = pixels.map(|i| value(basis, &coefficients, direction(i, TILE)).map(|v| v as f32)).collect();
    let negative = f64::from(negative) / directions.len() as f64;
    Ok(Approximation { relative_l2: (error / square).sqrt(), negative, overshoot, tile })
}

fn approximation(
    page: &mut String,
    ways: &[Way],
    lights: &[(&str, Environment)],
    images: Option<&Path>,
) -> Result<(), Box<dyn Error>> {
    writeln!(page, "\n## Light in bases\n")?;
    for line in [
        "Zhang, Dong and Ma 2013, figures 6 and 7: relative L2 error of linear radiance over the sphere; in brackets the",
        "share of the sphere where a channel is below zero, and how far one goes above the light's largest value. The",
        "checkerboard has 4 × 4 fields on each face of a cube, the three lights are discs of 15° in radius before grey,",
        "and the skies are those of `scenes/`, with their suns and without what `extract_sun` lights apart. The paper's",
        "checkerboard is not given; there DSF of 162, 642 and 2562 have 13.2 %, 8.9 % and 7.3 %. *Energy*, *Gaussian* and",
        "*sampled* are the prefilters of DSF.\n",
    ] {
        writeln!(page, "{line}")?;
    }
    write!(page, "| basis |")?;
    lights.iter().try_for_each(|(name, _)| write!(page, " {name} |"))?;
    writeln!(page, "\n| --- |{}", " ---: |".repeat(lights.len()))?;
    let mut rows = vec![Vec::new(); lights.len()];
    for (row, (_, light)) in rows.iter_mut().zip(lights) {
        row.push((0..TILE[0] * TILE[1]).map(|i| light.radiance(direction(i, TILE)).as_vec3().to_array()).collect());
    }
    for way in ways {
        write!(page, "| {} |", way.name)?;
        for (row, (_, light)) in rows.iter_mut().zip(lights) {
            let found = approximate(way, light)?;
            let share = |v: f64| if v < 5e-4 { "0".into() } else { format!("{:.1} %", 100.0 * v) };
            write!(page, " {} ({}, {}) |", percent(found.relative_l2), share(found.negative), share(found.overshoot))?;
            if way.shown {
                row.push(found.tile);
            }
        }
        writeln!(page)?;
    }
    if let Some(images) = images {
        // Each light as bright as its own mean asks for.
        for (row, (_, light)) in rows.iter_mut().zip(lights) {
            let gain = (0.35 / light.mean_radiance().max_element()) as f32;
            row.iter_mut().flatten().flatten().for_each(|v| *v *= gain);
        }
        sheet(&images.join("figure-7-bases.png"), TILE, &rows, ToneMap::LINEAR)?;
    }
    Ok(())
}

/// Seconds, the least of five times.
fn timed<T>(mut run: impl FnMut() -> T) -> f64 {
    let once = |_| {
        let start = Instant::now();
        std::hint::black_box(run());
        start.elapsed().as_secs_f64()
    };
    (0..5).map(once).fold(f64::INFINITY, f64::min)
}

fn times(page: &mut String, ways: &[Way], light: &Environment) -> Result<(), Box<dyn Error>> {
    let beams = Beams::new(light);
    let made = timed(|| Beams::new(light));
    let count = beams.iter().count();
    for line in [
        "\nProjecting a picture of 1024 × 512, and evaluating in one direction, on one core, the least of five times."
            .into(),
        "*Turned* is what a turn of the light asks for: moments of its beams, and coefficients. There are".into(),
        format!(
            "{count} beams, which take {:.0} ms once for a picture; projection of SRBF is that with them. The paper's",
            1e3 * made
        ),
        "pictures have 6 × 256 × 256 texels.\n".into(),
    ] {
        writeln!(page, "{line}")?;
    }
    writeln!(page, "| basis | projection, ms | published | turned, ms | evaluation, µs | published |")?;
    writeln!(page, "| --- | ---: | ---: | ---: | ---: | ---: |")?;
    let published = [
        ("SH, 26 bands (676)", "539", "369"),
        ("SRBF 642", "91", "59"),
        ("DSF 642, energy", "2", "13"),
        ("DSF 2562, energy", "", ""),
        ("DSF 642, least squares", "", ""),
    ];
    let directions: Vec<DVec3> = healpix::directions(64).into_iter().step_by(31).collect();
    for (name, projection, evaluation) in published {
        let way = ways.iter().find(|way| way.name == name).ok_or("a name of a way")?;
        let coefficients = way.coefficients(light)?;
        let once = timed(|| way.coefficients(light).map(|c| c.len()).unwrap_or(0));
        let turned = timed(|| match &way.fit {
            Fit::LeastSquares(basis) => basis.least_squares(&beams.moments(basis, 30.0)),
            Fit::Prefiltered(..) | Fit::Moments | Fit::Harmonics(_) => {
                way.basis.coefficients(&beams.moments(&*way.basis, 30.0))
            }
        });
        let each = timed(|| directions.iter().map(|&d| value(&*way.basis, &coefficients, d)[1]).sum::<f64>());
        writeln!(
            page,
            "| {name} | {:.3} | {projection} | {:.2} | {:.3} | {evaluation} |",
            1e3 * once,
            1e3 * turned,
            1e6 * each / directions.len() as f64
        )?;
    }
    Ok(())
}

/// n of the 12·n² directions from which the plane of figure 8 is lit.
const RAYS: u32 = 64;

/// Columns and rows of a picture of figure 8.
const PLANE: [u32; 2] = [120, 90];

/// A ball over a plane under light from one direction: ∫ L V cos θ dω at the plane, relative to what falls there without a
/// ball.
fn shadows(page: &mut String, images: Option<&Path>) -> Result<(), Box<dyn Error>> {
    writeln!(page, "\n## A shadow in bases\n")?;
    for line in [
        "Figure 8: a ball of radius 1 that hovers 1.5 over a plane, and a directional light 40° from the zenith in the",
        "coefficients of each basis: the irradiance of 6 × 4.5 of the plane, in units of what the light sends there.",
    ] {
        writeln!(page, "{line}")?;
    }
    writeln!(page, "\n| basis | relative L2 | least | largest | mean |\n| --- | ---: | ---: | ---: | ---: |")?;
    let toward = DVec3::new(0.5, 0.766, 0.4).normalize();
    let center = DVec3::new(0.0, 2.5, 0.0);
    let seen = |x: DVec3, d: DVec3| {
        let along = (center - x).dot(d);
        along < 0.0 || (center - x - d * along).length_squared() > 1.0
    };
    let place = |i: u32| {
        let at = |k: u32, n: u32, size: f64| size * ((f64::from(k) + 0.5) / f64::from(n) - 0.5);
        DVec3::new(at(i % PLANE[0], PLANE[0], 6.0) - 1.6, 0.0, at(i / PLANE[0], PLANE[1], 4.5) - 1.3)
    };
    let pixels = PLANE[0] * PLANE[1];
    let truth: Vec<f64> = (0..pixels).map(|i| f64::from(u8::from(seen(place(i), toward)))).collect();
    let bases: [(&str, Box<dyn Basis>); 6] = [
        ("SH, 6 bands (36)", Box::new(SphericalHarmonics::new(6)?)),
        ("SH, 26 bands (676)", Box::new(SphericalHarmonics::new(26)?)),
        ("SRBF 642", Box::new(RadialFunctions::new(642)?)),
        ("DSF 162", Box::new(DiscreteSpherical::new(162)?)),
        ("DSF 642", Box::new(DiscreteSpherical::new(642)?)),
        ("DSF 2562", Box::new(DiscreteSpherical::new(2562)?)),
    ];
    let mut tiles = vec![truth.clone()];
    for (name, basis) in bases {
        let light: Vec<[f64; 3]> = basis.directional(toward).into_iter().map(|f| [f, 0.0, 0.0]).collect();
        let rays: Vec<(DVec3, f64)> = healpix::directions(RAYS)
            .into_iter()
            .filter(|d| d.y > 0.0)
            .map(|d| (d, value(&*basis, &light, d)[0] * d.y * healpix::weight(RAYS) / toward.y))
            .filter(|(_, e)| *e != 0.0)
            .collect();
        let lit = |i: u32| {
            let x = place(i);
            rays.iter().filter(|(d, _)| seen(x, *d)).fold(0.0, |sum, (_, e)| sum + e)
        };
        let found: Vec<f64> = (0..pixels).into_par_iter().map(lit).collect();
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
        let error = square(&mut found.iter().zip(&truth).map(|(f, t)| f - t)) / square(&mut truth.iter().copied());
        writeln!(
            page,
            "| {name} | {} | {:.3} | {:.3} | {:.3} |",
            percent(error.sqrt()),
            found.iter().copied().fold(f64::INFINITY, f64::min),
            found.iter().copied().fold(0.0, f64::max),
            found.iter().sum::<f64>() / f64::from(pixels)
        )?;
        tiles.push(found);
    }
    writeln!(page, "| the light itself | | 0.000 | 1.000 | {:.3} |", truth.iter().sum::<f64>() / f64::from(pixels))?;
    if let Some(images) = images {
        let tile = |values: Vec<f64>| values.into_iter().map(|v| [0.8 * v as f32; 3]).collect();
        sheet(&images.join("figure-8-shadows.png"), PLANE, &[tiles.into_iter().map(tile).collect()], ToneMap::LINEAR)?;
    }
    Ok(())
}
