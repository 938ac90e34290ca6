//! How time grows: each [`Curve`] makes one number larger, from point to point, and times what depends on it.
//!
//! t = c nᵖ is fitted by least squares of logarithms. A part that does not grow lowers p; a p above what the algorithm
//! says by more than [`MARGIN`] is [told](Growth::faster). No test asserts a time.

mod scenes;

use std::thread::available_parallelism;
use std::time::Duration;

use airlight::Renderer;
use airlight::device::{Device, DeviceInfo};

use crate::quick::Fault;
use crate::steady::{self, Outcome, Work};

/// A number that grows.
pub struct Curve {
    /// Its name, such as `cells`.
    pub name: &'static str,
    /// What is set, and what stays.
    pub title: &'static str,
    /// The points: what the scene is made with, and the number that grows.
    pub points: Vec<Point>,
    /// What is timed.
    pub series: Vec<Series>,
    /// Whether points are numbers of threads, which only the processor's cores have.
    pub threads: bool,
}

/// A point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// What the scene is made with, such as cells along a side.
    setting: u32,
    /// The number that grows, such as cells.
    pub at: u64,
}

/// Something whose time is measured along a curve.
pub struct Series {
    /// What it is.
    pub name: &'static str,
    /// The exponent that the algorithm has.
    pub expected: f64,
    /// Where it comes from.
    pub why: &'static str,
    work: Box<dyn Fn(u32) -> Work + Send + Sync>,
}

impl Curve {
    /// Whether the curve says anything about a device.
    pub fn fits(&self, info: &DeviceInfo) -> bool {
        !self.threads || info.backend == "cpu"
    }
}

/// A point of a series on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Index of the series.
    pub series: usize,
    /// Index of the point.
    pub point: usize,
    /// What came of it.
    pub outcome: Outcome,
}

/// How much an exponent may exceed the expected one before it is told: then ten times as many cost 1.4 times what they
/// should, more than a few points on a machine with other work leave in doubt.
pub const MARGIN: f64 = 0.15;

/// How the time of a series grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// The fitted exponent.
    pub exponent: f64,
    /// Whether that is more than the expected one and [`MARGIN`].
    pub faster: bool,
}

impl Growth {
    /// That of times in seconds, where they are of two numbers at least, and the expected exponent.
    pub fn of(times: &[(u64, f64)], expected: f64) -> Option<Self> {
        let exponent = exponent(times)?;
        Some(Self { exponent, faster: exponent > expected + MARGIN })
    }
}

/// p of t = c nᵖ by least squares of logarithms; none of fewer than two different n, or of a time of 0.
fn exponent(times: &[(u64, f64)]) -> Option<f64> {
    let logs: Vec<_> = times.iter().map(|&(n, t)| ((n as f64).ln(), t.ln())).collect();
    let count = logs.len() as f64;
    let mean = logs.iter().fold([0.0, 0.0], |[x, y], at| [x + at.0 / count, y + at.1 / count]);
    let (mut above, mut below) = (0.0, 0.0);
    for (x, y) in &logs {
        above += (x - mean[0]) * (y - mean[1]);
        below += (x - mean[0]) * (x - mean[0]);
    }
    Some(above / below).filter(|p| p.is_finite())
}

/// All curves.
pub fn curves() -> Vec<Curve> {
    scenes::all(1, available_parallelism().map_or(1, |cores| cores.get() as u32))
}

/// Times every series of a curve on a device that `open` opens, and gives each entry to `tell` as soon as it is there.
/// `limit` is as of [`steady::measure`]; a series ends at the first point that is skipped or fails.
pub fn measure(
    curve: &Curve,
    open: impl Fn() -> Result<Box<dyn Device>, Fault>,
    limit: Duration,
    mut tell: impl FnMut(Entry),
) {
    let mut renderer = None;
    for (series, content) in curve.series.iter().enumerate() {
        let mut end = None;
        for (point, Point { setting, at }) in curve.points.iter().enumerate() {
            let outcome = end.clone().unwrap_or_else(|| {
                let mut opened = match renderer.take().map_or_else(|| open().map(Renderer::new), Ok) {
                    Ok(opened) => opened,
                    Err(fault) => return Outcome::Failed(fault.to_string()),
                };
                let name = format!("{}/{}/{at}", curve.name, content.name);
                let work = (content.work)(*setting);
                let outcome = match curve.threads {
                    true => among(*setting, || steady::measure(&mut opened, work, &name, limit)),
                    false => steady::measure(&mut opened, work, &name, limit),
                };
                if !matches!(outcome, Outcome::Failed(_)) {
                    renderer = Some(opened);
                }
                outcome
            });
            if !matches!(outcome, Outcome::Measured { .. }) {
                end = Some(outcome.clone());
            }
            tell(Entry { series, point, outcome });
        }
    }
}

/// What `run` does among so many threads.
fn among(threads: u32, run: impl FnOnce() -> Outcome + Send) -> Outcome {
    match rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build() {
        Ok(pool) => pool.install(run),
        Err(error) => Outcome::Failed(format!("{threads} threads: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_those_of_powers() {
        let of = |p: f64| [1u64, 3, 10, 17].map(|n| (n, 0.02 * (n as f64).powf(p)));
        for p in [-1.0, 0.0, 1.0 / 3.0, 1.0, 2.5] {
            // Four logarithms of f64.
            assert!((exponent(&of(p)).unwrap() - p).abs() < 1e-12, "{p}");
        }
        // By hand: logarithms to the base 2 are (0, 0), (1, 2), (2, 2), whose slope is 1.
        assert!((exponent(&[(1, 1.0), (2, 4.0), (4, 4.0)]).unwrap() - 1.0).abs() < 1e-12);
        for none in [&[][..], &[(3, 1.0)], &[(3, 1.0), (3, 2.0)], &[(1, 0.0), (2, 1.0)]] {
            assert_eq!(exponent(none), None, "{none:?}");
        }
    }

    #[test]
    fn what_grows_faster_than_it_should_is_told() {
        let times = |p: f64| [2u64, 4, 8].map(|n| (n, (n as f64).powf(p)));
        let faster = |p, expected| Growth::of(&times(p), expected).unwrap().faster;
        assert!(faster(2.0, 1.0) && faster(1.16, 1.0) && faster(-0.8, -1.0) && faster(0.5, 1.0 / 3.0));
        assert!(!faster(1.14, 1.0) && !faster(0.0, 1.0) && !faster(-0.9, -1.0));
        assert_eq!(Growth::of(&times(1.0)[..1], 1.0), None);
    }

    #[test]
    fn curves_and_series_are_named_once_and_points_grow() {
        let curves = curves();
        let names: Vec<_> = curves.iter().map(|curve| curve.name).collect();
        let wanted =
            ["voxels", "cells", "directions", "lights", "gaussians", "basis-lights", "sky", "pixels", "threads"];
        assert_eq!(names, wanted);
        for curve in &curves {
            assert!(curve.points.is_sorted_by(|a, b| a.at < b.at), "{}", curve.name);
            assert!(curve.threads || (4..=6).contains(&curve.points.len()), "{}", curve.name);
            for (n, series) in curve.series.iter().enumerate() {
                assert!(
                    curve.series[..n].iter().all(|other| other.name != series.name),
                    "{} stands twice",
                    series.name
                );
            }
        }
    }

    #[test]
    fn every_curve_runs_on_every_device() {
        let backends = airlight::devices();
        let listed = backends.iter().flat_map(|backend| backend.devices.iter().flatten());
        for info in listed.filter(|info| info.unusable.is_none()) {
            for mut curve in scenes::all(8, 2) {
                curve.points.truncate(1);
                if !curve.fits(info) {
                    continue;
                }
                let count = curve.series.len() * curve.points.len();
                let mut told = 0;
                measure(
                    &curve,
                    || Ok(airlight::open(&info.id())?),
                    Duration::from_secs(600),
                    |entry| {
                        let Outcome::Measured { timing, .. } = &entry.outcome else { panic!("{entry:?}") };
                        assert!(!timing.slowest().is_zero(), "nothing is timed: {entry:?}");
                        told += 1;
                    },
                );
                assert_eq!(told, count, "{}", curve.name);
            }
        }
    }

    #[test]
    fn a_series_ends_where_its_limit_is() {
        let curve = scenes::all(8, 2).swap_remove(0);
        let mut outcomes = Vec::new();
        measure(&curve, || Ok(airlight::open("cpu")?), Duration::ZERO, |entry| outcomes.push(entry.outcome));
        assert_eq!(outcomes.len(), curve.series.len() * curve.points.len());
        for outcome in outcomes {
            assert!(matches!(&outcome, Outcome::Skipped(why) if why.contains("more than 0 s")), "{outcome:?}");
        }
        measure(
            &curve,
            || Err("it is gone".into()),
            steady::LIMIT,
            |entry| {
                assert_eq!(entry.outcome, Outcome::Failed("it is gone".into()));
            },
        );
    }
}
