//! `airlight bench`

mod curves;
mod markdown;
mod papers;

use std::time::Duration;

use airlight::device::DeviceInfo;
use airlight_benches::quick::{self, Timing};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::progress::Meter;
use crate::{Done, devices, output};

#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("pages").args(["papers", "curves"]))]
pub(crate) struct Options {
    /// Measure only entries whose name contains one of these: stage/march, frame/, re.
    #[arg(value_name = "ENTRY", conflicts_with = "pages")]
    entries: Vec<String>,
    /// auto, a backend (cpu), an index (cpu:0) or part of a device's name. May repeat; without it, every device that
    /// there is. Ratios are to the first.
    #[arg(long, value_name = "ID")]
    device: Vec<String>,
    /// Measure all of it so many times, and take the median of all runs. An entry is measured on all devices, one after the
    /// other, before the next is: what disturbs a machine for seconds then disturbs all of them alike.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000), conflicts_with = "pages")]
    rounds: u32,
    /// Repeat the papers' own measurements instead: all tables, or those whose name begins with TABLE (001,
    /// 001-table-3), or rows of them (000-table-1/50/nothing). Prints Markdown. Minutes a device.
    #[arg(long, value_name = "TABLE", num_args = 0..=1, default_missing_value = "")]
    papers: Option<String>,
    /// Measure how time grows with voxels, cells, directions, lights, Gaussians, lights of a basis, skies, pixels and threads
    /// instead, with the exponent of each: all curves, or those whose name begins with CURVE. Prints Markdown. Minutes a
    /// device.
    #[arg(long, value_name = "CURVE", num_args = 0..=1, default_missing_value = "")]
    curves: Option<String>,
    /// The most seconds that the frames of an entry of --papers or of a point of --curves may take, and a tenth of what
    /// preparing them or making a transfer may; what would take longer is skipped, and said to be.
    #[arg(long, value_name = "S", requires = "pages", default_value_t = airlight_benches::steady::LIMIT.as_secs_f64())]
    time_limit: f64,
    /// Print JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

/// A device and what was measured on it, up to a fault.
struct Measured {
    info: DeviceInfo,
    timings: Vec<Timing>,
    fault: Option<String>,
}

impl Measured {
    fn timing(&self, name: &str) -> Option<&Timing> {
        self.timings.iter().find(|timing| timing.name == name)
    }

    /// One round of an entry more, unless there was a fault before.
    fn add(&mut self, name: &str) {
        if self.fault.is_some() {
            return;
        }
        let id = self.info.id();
        let measured = quick::measure(
            || Ok(airlight::open(&id)?),
            |entry| entry == name,
            |timing| match self.timings.iter_mut().find(|earlier| earlier.name == timing.name) {
                Some(earlier) => earlier.pool(timing),
                None => self.timings.push(timing),
            },
        );
        self.fault = measured.err().map(|fault| fault.to_string());
    }
}

/// Rounds of entries, each on all devices.
fn measure(names: &[String], subjects: Vec<DeviceInfo>, rounds: u32) -> Vec<Measured> {
    let mut measured: Vec<_> =
        subjects.into_iter().map(|info| Measured { info, timings: Vec::new(), fault: None }).collect();
    // Drivers keep on disk what other entries make them compile, so what compiling takes comes first.
    let mut order: Vec<&String> = names.iter().collect();
    order.sort_by_key(|name| *name != quick::COMPILE);
    let mut meter = Meter::new();
    let (mut done, whole) = (0, order.len() * measured.len() * rounds as usize);
    for _ in 0..rounds {
        for name in &order {
            for device in &mut measured {
                meter.show(format_args!("bench {name} {}", device.info.id()), done as f32 / whole as f32);
                device.add(name);
                done += 1;
            }
        }
    }
    for device in &mut measured {
        device.timings.sort_by_key(|timing| names.iter().position(|name| *name == timing.name));
    }
    measured
}

pub(crate) fn run(options: &Options) -> Done {
    let tables = options.papers.as_deref().map(papers::tables).transpose()?;
    let curves = options.curves.as_deref().map(curves::curves).transpose()?;
    let limit = Duration::try_from_secs_f64(options.time_limit)
        .map_err(|_| Failure::input(format!("--time-limit {}: it must be a number of seconds", options.time_limit)))?;
    let mut absent = Vec::new();
    let subjects = devices::subjects(&options.device, &mut absent)?;
    if let Some(tables) = tables {
        return papers::run(&tables, &subjects, &absent, limit, options.json);
    }
    if let Some(curves) = curves {
        return curves::run(&curves, &subjects, &absent, limit, options.json);
    }
    let names = entries(&options.entries)?;
    let measured = measure(&names, subjects, options.rounds);
    if options.json {
        output::json(&report(&measured, &absent))?;
    } else {
        table(&names, &measured).iter().try_for_each(|line| output::line(line))?;
    }
    let faults: Vec<_> =
        measured.iter().filter_map(|m| Some(format!("{}: {}", m.info.id(), m.fault.as_ref()?))).collect();
    if faults.is_empty() { Ok(()) } else { Err(Failure::running(faults.join("; "))) }
}

/// Those whose name begins with `prefix`, of what an option names.
fn chosen<T>(
    mut all: Vec<T>,
    name: impl Fn(&T) -> &'static str,
    prefix: &str,
    [option, what]: [&str; 2],
) -> Result<Vec<T>, Failure> {
    let names: Vec<_> = all.iter().map(&name).collect();
    all.retain(|one| name(one).starts_with(prefix));
    if all.is_empty() {
        let names = names.join(", ");
        return Err(Failure::input(format!("{option} {prefix}: no such {what}; there are {names}")));
    }
    Ok(all)
}

/// The entries that are measured: those whose name contains one of `parts`, or all.
fn entries(parts: &[String]) -> Result<Vec<String>, Failure> {
    let mut names = quick::names();
    if let Some(part) = parts.iter().find(|part| !names.iter().any(|name| name.contains(*part))) {
        return Err(Failure::input(format!("no entry contains {part:?}; there are {}", names.join(", "))));
    }
    names.retain(|name| parts.is_empty() || parts.iter().any(|part| name.contains(part)));
    Ok(names)
}

/// How many times as long as on the first device.
fn ratio(timing: &Timing, first: &Measured) -> Option<f64> {
    let first = first.timing(&timing.name)?.median().as_secs_f64();
    (first > 0.0).then(|| timing.median().as_secs_f64() / first)
}

/// Characters of the columns: names with units, a time with its rate, a ratio.
const NAMES: usize = 40;
const TIME: usize = 18;
const RATIO: usize = 8;

fn table(names: &[String], measured: &[Measured]) -> Vec<String> {
    let mut lines: Vec<_> = measured.iter().map(|m| format!("{:<10} {}", m.info.id(), m.info.name)).collect();
    let Some(first) = measured.first() else { return lines };
    lines.push(String::new());
    let width = |n: usize| if n == 0 { TIME } else { TIME + RATIO };
    let row = |name: &str, cells: Vec<String>| {
        let cells: String = cells.iter().enumerate().map(|(n, cell)| format!("{cell:>0$}", width(n))).collect();
        format!("{name:<NAMES$}{cells}").trim_end().to_owned()
    };
    lines.push(row("", measured.iter().map(|m| m.info.id()).collect()));
    for name in names {
        let unit = measured.iter().find_map(|m| m.timing(name)?.elements).map(|(_, unit)| format!(" ({unit})"));
        let cell = |(n, m): (usize, &Measured)| {
            m.timing(name).map_or("failed".into(), |timing| cell(timing, (n > 0).then_some(first)))
        };
        lines.push(row(&(name.clone() + &unit.unwrap_or_default()), measured.iter().enumerate().map(cell).collect()));
    }
    lines.push(String::new());
    lines.push("Medians of a few runs; elements a second; × as long as on the first device.".into());
    lines
}

fn cell(timing: &Timing, first: Option<&Measured>) -> String {
    let rate = timing.rate().map_or(String::new(), |rate| format!("{}/s", scaled(rate)));
    let ratio = first.map_or(String::new(), |first| {
        let ratio = ratio(timing, first).map_or(String::new(), |r| format!("{} ×", figures(r)));
        format!("{ratio:>RATIO$}")
    });
    format!("{:>8} {rate:>8}{ratio}", time(timing.median()))
}

/// A time in three figures.
pub(crate) fn time(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    let (scale, unit) = match seconds {
        s if s >= 0.9995 => (1.0, "s"),
        s if s >= 0.9995e-3 => (1e3, "ms"),
        _ => (1e6, "µs"),
    };
    format!("{} {unit}", figures(seconds * scale))
}

/// A large number in three figures and a prefix.
fn scaled(v: f64) -> String {
    let (scale, prefix) = match v {
        v if v >= 0.9995e9 => (1e-9, "G"),
        v if v >= 0.9995e6 => (1e-6, "M"),
        v if v >= 0.9995e3 => (1e-3, "k"),
        _ => (1.0, ""),
    };
    format!("{}{prefix}", figures(v * scale))
}

/// Three figures where there are fewer than three before the point.
fn figures(v: f64) -> String {
    let digits = if v >= 99.95 {
        0
    } else if v >= 9.995 {
        1
    } else {
        2
    };
    format!("{v:.digits$}")
}

fn report(measured: &[Measured], absent: &[Value]) -> Value {
    let entry = |timing: &Timing| {
        json!({
            "name": timing.name,
            "seconds": timing.median().as_secs_f64(),
            "fastest": timing.fastest().as_secs_f64(),
            "slowest": timing.slowest().as_secs_f64(),
            "runs": timing.runs(),
            "elements": timing.elements.map(|(n, _)| n),
            "unit": timing.elements.map(|(_, unit)| unit),
            "per_second": timing.rate(),
            "ratio": measured.first().and_then(|first| ratio(timing, first)),
        })
    };
    let device = |m: &Measured| {
        let entries: Vec<_> = m.timings.iter().map(entry).collect();
        json!({ "device": devices::device(&m.info), "entries": entries, "fault": m.fault })
    };
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "devices": measured.iter().map(device).collect::<Vec<_>>(),
        "absent": absent,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_figures() {
        let micros = |n| time(Duration::from_micros(n));
        assert_eq!([micros(7), micros(999), micros(1000), micros(12_345)], ["7.00 µs", "999 µs", "1.00 ms", "12.3 ms"]);
        assert_eq!([micros(999_900), micros(123_456_000)], ["1.00 s", "123 s"]);
        assert_eq!([scaled(367.4e6), scaled(999.0), scaled(1234.0), scaled(3.1e9)], ["367M", "999", "1.23k", "3.10G"]);
    }
}
