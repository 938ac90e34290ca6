//! `airlight bench --curves`: how time grows, as Markdown or JSON.

use std::time::Duration;

use airlight::device::DeviceInfo;
use airlight_benches::curves::{self, Curve, Entry, Growth, MARGIN, Series};
use airlight_benches::steady::Outcome;
use serde_json::{Value, json};

use super::markdown::{aligned, note};
use super::{chosen, figures, markdown, time};
use crate::failure::Failure;
use crate::progress::Meter;
use crate::{devices, output};

/// The curves whose name begins with `prefix`.
pub(super) fn curves(prefix: &str) -> Result<Vec<Curve>, Failure> {
    chosen(curves::curves(), |curve| curve.name, prefix, ["--curves", "curve"])
}

/// A curve and what each device made of it.
struct Measured<'a> {
    curve: &'a Curve,
    entries: Vec<(&'a DeviceInfo, Vec<Entry>)>,
}

/// Measures the curves on every device, and prints each as soon as it is done, or all of them as JSON.
pub(super) fn run(
    curves: &[Curve],
    subjects: &[DeviceInfo],
    absent: &[Value],
    limit: Duration,
    json: bool,
) -> crate::Done {
    let mut faults = Vec::new();
    let mut all = Vec::new();
    if !json {
        markdown::head("Cost curves", "--curves", "the fastest of a few runs", ("a point", limit), subjects)?;
        output::line(&format!(
            "\n*p* is the exponent of t = c nᵖ, by least squares of logarithms over a row; *expected* is the algorithm's. \
             **Faster** is what exceeds that by more than {MARGIN}."
        ))?;
    }
    for curve in curves {
        let fitting = subjects.iter().filter(|info| curve.fits(info));
        let measured = Measured { curve, entries: fitting.map(|info| (info, measure(curve, info, limit))).collect() };
        faults.extend(measured.faults());
        if json {
            all.push(measured.report());
        } else {
            measured.markdown().iter().try_for_each(|line| output::line(line))?;
        }
    }
    if json {
        output::json(&json!({
            "version": env!("CARGO_PKG_VERSION"),
            "devices": subjects.iter().map(devices::device).collect::<Vec<_>>(),
            "margin": MARGIN,
            "curves": all,
            "absent": absent,
        }))?;
    }
    if faults.is_empty() { Ok(()) } else { Err(Failure::running(faults.join("; "))) }
}

fn measure(curve: &Curve, info: &DeviceInfo, limit: Duration) -> Vec<Entry> {
    let (id, count) = (info.id(), curve.series.len() * curve.points.len());
    let mut meter = Meter::new();
    let mut entries = Vec::new();
    let tell = |entry| {
        entries.push(entry);
        meter.show(format!("{} {id}", curve.name), entries.len() as f32 / count as f32);
    };
    curves::measure(curve, || Ok(airlight::open(&id)?), limit, tell);
    entries
}

impl<'a> Measured<'a> {
    /// Devices that failed, with the first reason of each.
    fn faults(&self) -> Vec<String> {
        let fault = |(info, entries): &(&DeviceInfo, Vec<Entry>)| {
            let why = entries.iter().find_map(|entry| match &entry.outcome {
                Outcome::Failed(why) => Some(why),
                _ => None,
            });
            why.map(|why| format!("{}: {}: {why}", self.curve.name, info.id()))
        };
        self.entries.iter().filter_map(fault).collect()
    }

    /// The rows: a series on a device each, with its points.
    fn rows(&self) -> Vec<(&Series, &'a DeviceInfo, Vec<&Entry>)> {
        let mut rows = Vec::new();
        for (n, series) in self.curve.series.iter().enumerate() {
            for (info, entries) in &self.entries {
                rows.push((series, *info, entries.iter().filter(|entry| entry.series == n).collect()));
            }
        }
        rows
    }

    /// That of the fastest runs, which other work on the machine disturbs least.
    fn growth(&self, series: &Series, entries: &[&Entry]) -> Option<Growth> {
        let timed = entries.iter().filter_map(|entry| match &entry.outcome {
            Outcome::Measured { timing, .. } => {
                Some((self.curve.points[entry.point].at, timing.fastest().as_secs_f64()))
            }
            _ => None,
        });
        Growth::of(&timed.collect::<Vec<_>>(), series.expected)
    }

    fn markdown(&self) -> Vec<String> {
        let curve = self.curve;
        let mut lines =
            vec![String::new(), format!("## {}", curve.name), String::new(), curve.title.into(), String::new()];
        let mut heads: Vec<String> = vec!["time of".into(), "device".into()];
        heads.extend(curve.points.iter().map(|point| point.at.to_string()));
        heads.extend(["p", "expected", "since", ""].map(str::to_owned));
        let (mut rows, mut notes) = (vec![heads], Vec::new());
        for (series, info, entries) in self.rows() {
            let mut cells = vec![series.name.to_owned(), info.id()];
            cells.extend(entries.iter().map(|entry| match &entry.outcome {
                Outcome::Measured { timing, .. } => time(timing.fastest()),
                Outcome::Skipped(why) => format!("skipped ({})", note(why, &mut notes)),
                Outcome::Failed(why) => format!("failed ({})", note(why, &mut notes)),
            }));
            let growth = self.growth(series, &entries);
            cells.push(growth.map_or("–".into(), |growth| figures(growth.exponent)));
            cells.push(figures(series.expected));
            cells.push(series.why.into());
            cells.push(if growth.is_some_and(|growth| growth.faster) { "**faster**".into() } else { String::new() });
            rows.push(cells);
        }
        if rows.len() == 1 {
            lines.push("Of the processor's cores alone.".into());
            return lines;
        }
        lines.extend(aligned(&rows));
        lines.extend(markdown::notes(&notes));
        lines
    }

    fn report(&self) -> Value {
        let rows = self.rows().into_iter().map(|(series, info, entries)| {
            let points = entries.iter().map(|entry| {
                let mut point = json!({
                    "at": self.curve.points[entry.point].at,
                    "seconds": null,
                    "fastest": null,
                    "slowest": null,
                    "runs": 0,
                    "skipped": null,
                    "fault": null,
                });
                match &entry.outcome {
                    Outcome::Measured { timing, .. } => {
                        point["seconds"] = json!(timing.median().as_secs_f64());
                        point["fastest"] = json!(timing.fastest().as_secs_f64());
                        point["slowest"] = json!(timing.slowest().as_secs_f64());
                        point["runs"] = json!(timing.runs());
                    }
                    Outcome::Skipped(why) => point["skipped"] = json!(why),
                    Outcome::Failed(why) => point["fault"] = json!(why),
                }
                point
            });
            let growth = self.growth(series, &entries);
            json!({
                "name": series.name,
                "device": info.id(),
                "expected": series.expected,
                "why": series.why,
                "exponent": growth.map(|growth| growth.exponent),
                "faster": growth.map(|growth| growth.faster),
                "points": points.collect::<Vec<_>>(),
            })
        });
        json!({ "name": self.curve.name, "title": self.curve.title, "series": rows.collect::<Vec<_>>() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_picked_by_the_beginning_of_their_name() {
        let names = |prefix| curves(prefix).map(|found| found.iter().map(|c| c.name).collect::<Vec<_>>());
        assert_eq!(names("basis").ok(), Some(vec!["basis-lights"]));
        assert!(names("").is_ok_and(|all| all.len() == 9));
        let error = names("time").unwrap_err();
        assert!(error.code == 2 && error.message.contains("directions"), "{error:?}");
    }
}
