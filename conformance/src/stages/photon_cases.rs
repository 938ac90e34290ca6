//! `photons` against closed forms and itself.

use std::f64::consts::PI;

use airlight::basis::quadrature::gauss_legendre;
use airlight::basis::{Basis, SphericalHarmonics, healpix};
use airlight::glam::{DVec3, UVec3};
use airlight::media::{Lattice, Phase};
use airlight::stage::{PhotonTable, Stage, photon_counter, photon_deposit};
use libtest_mimic::Failed;

use super::photons::Flown;
use crate::bench::Bench;
use crate::fixtures::{DIMS, Map, noise};
use crate::{Axis, Case, Record, Subject, check, tolerance};

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "photons::once",
            "Light from one side that is scattered once in an even box is the double integral's, cell by cell, in every moment.",
            once,
        )
        .within(&tolerance::PHOTON_NOISE),
        Case::new(
            "photons::furnace",
            "In a medium that absorbs nothing, under light that is 1 from everywhere, unscattered and scattered light are 1 together.",
            furnace,
        )
        .within(&tolerance::PHOTON_NOISE),
        Case::new(
            "photons::kinds",
            "What is left along flights, at collisions and at absorptions agrees, summed over the box.",
            kinds,
        )
        .within(&tolerance::PHOTON_NOISE)
        .permutes(&kinds_axis()),
        Case::new(
            "photons::batches",
            "Lights in batches, and photons in several dispatches, leave the same integers as all at once.",
            batches,
        )
        .within(&tolerance::EXACT),
        Case::new(
            "photons::convergence",
            "Sixteen times as many photons leave a quarter of the noise.",
            convergence,
        ),
        Case::new("photons::overflow", "Sums that an integer does not hold are counted.", overflow),
    ]
}

/// What photons left, over scale and photons, laid out as the deposits, with the counters.
struct Left {
    moments: Vec<f64>,
    integers: Vec<i32>,
    counters: Vec<i32>,
}

/// Runs a stage whose parameters are changed first, over outputs of zeros.
fn fly(
    subject: &Subject,
    flown: &Flown,
    table: &PhotonTable,
    seed: u32,
    dispatches: &[(u32, u32)],
) -> Result<Left, Failed> {
    let mut bench = Bench::new(subject)?;
    let mut stage = flown.stage(&mut bench, table, &flown.rows())?.stage;
    stage.params.seed = seed;
    for &(round, rounds) in dispatches {
        (stage.params.round, stage.params.rounds) = (round, rounds);
        let run = Stage::Photons(stage.clone());
        // Software that renders ends loops: as the executor does, each device gets passes that it runs whole.
        let passes = match bench.device.info().limits.loop_turns {
            Some(turns) => run.passes(turns.into())?,
            None => vec![run],
        };
        for pass in passes {
            bench.device.dispatch(&pass, 0..pass.axis())?;
        }
    }
    bench.device.finish()?;
    let (integers, counters) = (bench.read(stage.deposits)?, bench.read(stage.counters)?);
    let photons = f64::from(stage.params.directions) * dispatches.iter().map(|d| f64::from(d.1)).sum::<f64>();
    let unit = f64::from(stage.params.scale) * photons;
    let moments = integers.iter().map(|&v| f64::from(v) / unit).collect();
    Ok(Left { moments, integers, counters })
}

fn counter(left: &Left, which: u32) -> i32 {
    left.counters[which as usize]
}

/// A box of even density.
fn even() -> Flown {
    Flown {
        map: Map::Sheared,
        cells: UVec3::new(3, 2, 4),
        density: vec![0.5; DIMS.element_product() as usize],
        extinction: 4.0,
        bands: 2,
        turns: 1500,
        max_depth: 300,
        lights: 1,
        ..Flown::plain()
    }
}

/// The sum over cells of the first of four moments.
fn sum(moments: &[f64]) -> f64 {
    moments.chunks_exact(4).map(|m| m[0]).sum()
}

/// Metres from a place in the box to its wall.
fn wall(lattice: &Lattice, x: DVec3, d: DVec3) -> f64 {
    let (at, way) = (lattice.world_to_index().transform_point3(x), lattice.world_to_index().transform_vector3(d));
    let leave = |a: usize| {
        let end = if way[a] > 0.0 { f64::from(lattice.dims()[a]) - 0.5 } else { -0.5 };
        if way[a] == 0.0 { f64::INFINITY } else { ((end - at[a]) / way[a]).max(0.0) }
    };
    leave(0).min(leave(1)).min(leave(2))
}

/// Means over each cell of moments at places in the world. Near walls moments fall steeply: Gauss and Legendre's points lie there.
fn means(flown: &Flown, mut at: impl FnMut(DVec3) -> Vec<f64>) -> Vec<f64> {
    let points = gauss_legendre(4);
    let (lattice, n) = (flown.map.lattice(DIMS), flown.cells);
    let mut all = Vec::new();
    for number in 0..n.element_product() {
        let cell = UVec3::new(number % n.x, number / n.x % n.y, number / n.x / n.y).as_dvec3();
        let mut mean = vec![0.0; 4];
        for (x, p) in &points {
            for (y, q) in &points {
                for (z, r) in &points {
                    let index = (cell + 0.5 + 0.5 * DVec3::new(*x, *y, *z)) / n.as_dvec3() * DIMS.as_dvec3() - 0.5;
                    let values = at(lattice.index_to_world().transform_point3(index));
                    mean.iter_mut().zip(values).for_each(|(m, v)| *m += p * q * r / 8.0 * v);
                }
            }
        }
        all.extend(mean);
    }
    all
}

fn once(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let phase = Phase::HenyeyGreenstein { g: 0.4 };
    let flown = Flown { max_depth: 1, phase: phase.clone(), scale: 100.0, ..even() };
    let (lattice, set) = (flown.map.lattice(DIMS), flown.set());
    const FROM: usize = 37;
    let table = flown.table(|i, _, out| {
        if i == FROM {
            out.push((0, 1.0));
        }
    });
    let left = fly(subject, &flown, &table, 1, &[(0, 300_000)])?;
    check!(counter(&left, photon_counter::OVERFLOWS) == 0, "sums overflow");
    check!(counter(&left, photon_counter::LOST) == 0, "light is lost, and every cell has a row");
    let harmonics = SphericalHarmonics::new(flown.bands)?;
    let (from, around) = (set[FROM], healpix::directions(8));
    let (sigma, scatters) = (0.5 * f64::from(flown.extinction), f64::from(flown.albedo));
    // Radiance 1 from a direction's solid angle.
    let entering = 4.0 * PI / set.len() as f64;
    let expected = means(&flown, |x| {
        const STEPS: u32 = 16;
        let (mut moments, mut values) = (vec![0.0; 4], vec![0.0; 4]);
        for &toward in &around {
            let step = wall(&lattice, x, toward) / f64::from(STEPS);
            let reaches = |s: f64| (-sigma * (s + wall(&lattice, x + s * toward, from))).exp();
            let column: f64 = (0..STEPS).map(|i| reaches((f64::from(i) + 0.5) * step) * step).sum();
            let radiance = sigma * scatters * phase.eval(toward.dot(from)) * entering * column;
            harmonics.eval(toward, &mut values);
            let weight = 4.0 * PI / around.len() as f64;
            moments.iter_mut().zip(&values).for_each(|(m, y)| *m += weight * radiance * y);
        }
        moments
    });
    record.hold("moments", left.moments.iter().copied(), expected.iter().copied());
    record.score("mean", "off", (sum(&left.moments) / sum(&expected) - 1.0).abs(), 0.007);
    // Light from one side, scattered forward, comes from there.
    let band = |l: usize| left.moments.chunks_exact(4).map(|m| m[l]).sum::<f64>();
    let toward = DVec3::new(band(1), band(2), band(3)).normalize();
    record.score("band 1", "angle to the light, degrees", toward.dot(from).acos().to_degrees(), 20.0);
    Ok(())
}

fn furnace(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    // Linear between the outermost samples, which trilinear lookups keep.
    let at = |index: DVec3| {
        let p = index.clamp(DVec3::ZERO, DIMS.as_dvec3() - 1.0);
        0.2 + 0.1 * p.x + 0.04 * p.y + 0.05 * p.z
    };
    let place = |i: u32| UVec3::new(i % DIMS.x, i / DIMS.x % DIMS.y, i / DIMS.x / DIMS.y).as_dvec3();
    let flown = Flown {
        density: (0..DIMS.element_product()).map(|i| at(place(i)) as f32).collect(),
        albedo: 1.0,
        phase: Phase::HenyeyGreenstein { g: 0.3 },
        scale: 50.0,
        ..even()
    };
    let (lattice, set) = (flown.map.lattice(DIMS), flown.set());
    let table = flown.table(|_, _, out| out.push((0, 1.0)));
    let left = fly(subject, &flown, &table, 2, &[(0, 500)])?;
    check!(counter(&left, photon_counter::OVERFLOWS) == 0, "sums overflow");
    check!(counter(&left, photon_counter::TRUNCATED) == 0, "photons are given up");
    let harmonics = SphericalHarmonics::new(flown.bands)?;
    let unscattered = means(&flown, |x| {
        const STEPS: u32 = 24;
        let (mut moments, mut values) = (vec![0.0; 4], vec![0.0; 4]);
        for &toward in &set {
            let step = wall(&lattice, x, toward) / f64::from(STEPS);
            let index = |i: u32| lattice.world_to_index().transform_point3(x + (f64::from(i) + 0.5) * step * toward);
            let column: f64 = (0..STEPS).map(|i| at(index(i)) * step).sum();
            let through = (-f64::from(flown.extinction) * column).exp() * 4.0 * PI / set.len() as f64;
            harmonics.eval(toward, &mut values);
            moments.iter_mut().zip(&values).for_each(|(m, y)| *m += through * y);
        }
        moments
    });
    let (scattered, direct) = (sum(&left.moments), sum(&unscattered));
    check!(scattered > direct, "{scattered} is scattered of {direct}: the case tries little");
    let white = (4.0 * PI).sqrt() * f64::from(flown.cells.element_product());
    record.score("mean", "off", ((scattered + direct) / white - 1.0).abs(), 0.003);
    let all = left.moments.iter().zip(&unscattered).map(|(a, b)| a + b);
    let expected = (0..left.moments.len()).map(|i| if i % 4 == 0 { (4.0 * PI).sqrt() } else { 0.0 });
    record.hold("moments", all, expected);
    Ok(())
}

fn kinds_axis() -> Axis<u32> {
    Axis::new("deposit", [("collision", photon_deposit::COLLISION), ("absorption", photon_deposit::ABSORPTION)])
}

fn kinds(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let flown = Flown {
        map: Map::Rotated,
        density: noise(7, DIMS.element_product() as usize).into_iter().map(|v| 0.3 + 0.7 * v).collect(),
        albedo: 0.7,
        phase: Phase::HenyeyGreenstein { g: 0.5 },
        lights: 4,
        scale: 50.0,
        ..even()
    };
    // One light from everywhere, and three from one side each.
    let table = flown.table(|_, d, out| {
        out.extend([1.0, d.x.max(0.0), d.y.max(0.0), d.z.max(0.0)].into_iter().zip(0..).map(|(value, k)| (k, value)));
    });
    let sums = |deposit: u32| -> Result<Vec<f64>, Failed> {
        let left = fly(subject, &Flown { deposit, ..flown.clone() }, &table, 5 + deposit, &[(0, 300)])?;
        check!(counter(&left, photon_counter::OVERFLOWS) == 0, "sums overflow");
        check!(counter(&left, photon_counter::TRUNCATED) == 0, "photons are given up");
        let mut sums = vec![0.0; 16];
        left.moments.chunks_exact(16).for_each(|row| sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += v));
        Ok(sums)
    };
    let tracks = sums(photon_deposit::TRACK)?;
    check!(tracks[0] > 0.0, "photons leave nothing");
    record.each(&kinds_axis(), |record, &deposit| {
        record.hold("sums", sums(deposit)?, tracks.iter().copied());
        Ok(())
    })
}

fn batches(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let harmonics = SphericalHarmonics::new(2)?;
    let whole = Flown { lights: 4, scale: 1000.0, ..Flown::plain() };
    let weights = |first: u32, lights: u32| {
        let harmonics = harmonics.clone();
        move |_: usize, d: DVec3, out: &mut Vec<(u32, f64)>| {
            let mut values = [0.0; 4];
            harmonics.eval(d, &mut values);
            // One light is from one side, so that its batch does without some directions.
            values[2] = values[2].max(0.0);
            out.extend((0..lights).map(|k| (k, values[(first + k) as usize])));
        }
    };
    let all = fly(subject, &whole, &whole.table(weights(0, 4)), 9, &[(0, 7)])?;
    check!(counter(&all, photon_counter::OVERFLOWS) == 0, "sums overflow");
    let bits = |values: &[i32]| values.iter().map(|&v| f32::from_bits(v as u32)).collect::<Vec<_>>();
    let per = 9;
    for (first, lights) in [(0, 2), (2, 1), (3, 1)] {
        let part = Flown { lights, ..whole.clone() };
        let found = fly(subject, &part, &part.table(weights(first, lights)), 9, &[(4, 3), (0, 1), (1, 3)])?;
        let span = first as usize * per..(first + lights) as usize * per;
        let expected: Vec<i32> =
            all.integers.chunks_exact(4 * per).flat_map(|row| row[span.clone()].to_vec()).collect();
        check!(expected.iter().any(|&v| v != 0), "nothing is left");
        record.same("batch", &bits(&found.integers), &bits(&expected));
    }
    Ok(())
}

fn convergence(subject: &Subject, record: &mut Record) -> Result<(), Failed> {
    let flown = Flown { density: Flown::plain().density, map: Map::Plain, extinction: 24.0, nside: 2, ..even() };
    let table = flown.table(|_, _, out| out.push((0, 1.0)));
    let noise = |rounds: u32| -> Result<f64, Failed> {
        let mut squares = 0.0;
        for seed in 0..4 {
            let [a, b] = [2 * seed, 2 * seed + 1].map(|seed| fly(subject, &flown, &table, seed, &[(0, rounds)]));
            squares += a?.moments.iter().zip(&b?.moments).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        }
        Ok(squares.sqrt())
    };
    let ratio = noise(4)? / noise(64)?;
    // Some hundred values, which are not independent, four times.
    record.score("noise", "off from four", (ratio / 4.0 - 1.0).abs(), 0.2);
    Ok(())
}

fn overflow(subject: &Subject, _: &mut Record) -> Result<(), Failed> {
    for (scale, overflows) in [(1e4, false), (1e8, true), (1e30, true)] {
        let flown = Flown { lights: 1, scale, ..Flown::plain() };
        let table = flown.table(|_, _, out| out.push((0, 1.0)));
        let count = counter(&fly(subject, &flown, &table, 1, &[(0, 2)])?, photon_counter::OVERFLOWS);
        check!((count > 0) == overflows, "{count} overflows are counted at a scale of {scale}");
    }
    Ok(())
}
