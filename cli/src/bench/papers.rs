//! `airlight bench --papers`: the papers' tables, as Markdown or JSON.

use std::time::Duration;

use airlight::device::DeviceInfo;
use airlight_benches::papers::{self, Entry, Form, Table, Unit};
use airlight_benches::steady::Outcome;
use serde_json::{Value, json};

use super::markdown::{aligned, note};
use super::{chosen, figures, markdown};
use crate::failure::Failure;
use crate::progress::Meter;
use crate::{devices, output};

/// The tables whose name begins with `wanted`; of them, where slashes follow, the rows whose first columns say what stands
/// between them.
pub(super) fn tables(wanted: &str) -> Result<Vec<Table>, Failure> {
    let mut parts = wanted.split('/');
    let prefix = parts.next().unwrap_or_default();
    let mut tables = chosen(papers::tables(), |table| table.name, prefix, ["--papers", "table"])?;
    let columns: Vec<_> = parts.collect();
    if columns.is_empty() {
        return Ok(tables);
    }
    let shown = |row: &papers::Row| row.at.join("/");
    let all: Vec<_> = tables.iter().flat_map(|table| table.rows.iter().map(shown)).collect();
    for table in &mut tables {
        table.rows.retain(|row| row.at.len() >= columns.len() && row.at.iter().zip(&columns).all(|(a, b)| a == b));
    }
    tables.retain(|table| !table.rows.is_empty());
    if tables.is_empty() {
        let all = all.join(", ");
        return Err(Failure::input(format!("--papers {wanted}: no such row; of {prefix} there are {all}")));
    }
    Ok(tables)
}

/// A table and what each device made of it.
struct Measured<'a> {
    table: &'a Table,
    entries: Vec<(&'a DeviceInfo, Vec<Entry>)>,
}

/// Measures the tables on every device, and prints each as soon as it is done, or all of them as JSON.
pub(super) fn run(
    tables: &[Table],
    subjects: &[DeviceInfo],
    absent: &[Value],
    limit: Duration,
    json: bool,
) -> crate::Done {
    let mut faults = Vec::new();
    let mut all = Vec::new();
    if !json {
        let title = "Speed in the papers' tables";
        markdown::head(title, "--papers", "medians of a few frames", ("an entry", limit), subjects)?;
    }
    for table in tables {
        let entries = subjects.iter().map(|info| (info, measure(table, info, limit))).collect();
        let measured = Measured { table, entries };
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
            "tables": all,
            "absent": absent,
        }))?;
    }
    if faults.is_empty() { Ok(()) } else { Err(Failure::running(faults.join("; "))) }
}

fn measure(table: &Table, info: &DeviceInfo, limit: Duration) -> Vec<Entry> {
    let (id, count) = (info.id(), table.rows.len() * Form::ALL.len());
    let mut meter = Meter::new();
    let mut entries = Vec::new();
    let tell = |entry| {
        entries.push(entry);
        meter.show(format!("{} {id}", table.name), entries.len() as f32 / count as f32);
    };
    papers::measure(table, || Ok(airlight::open(&id)?), limit, tell);
    entries
}

impl Measured<'_> {
    /// The outcomes of a row in one form, a device each.
    fn outcomes(&self, row: usize, form: Form) -> impl Iterator<Item = (&DeviceInfo, &Outcome)> {
        self.entries.iter().flat_map(move |(info, entries)| {
            let found = entries.iter().find(|entry| entry.row == row && entry.form == form);
            found.map(|entry| (*info, &entry.outcome))
        })
    }

    /// Devices that failed, with the first reason of each.
    fn faults(&self) -> Vec<String> {
        let fault = |(info, entries): &(&DeviceInfo, Vec<Entry>)| {
            let why = entries.iter().find_map(|entry| match &entry.outcome {
                Outcome::Failed(why) => Some(why),
                _ => None,
            });
            why.map(|why| format!("{}: {}: {why}", self.table.name, info.id()))
        };
        self.entries.iter().filter_map(fault).collect()
    }

    fn markdown(&self) -> Vec<String> {
        let Self { table, entries } = self;
        let mut lines = vec![
            String::new(),
            format!("## {}: {}", table.name, table.title),
            String::new(),
            format!("{} *Paper*: {}; {}. {}", table.figures, table.paper, table.hardware, table.ours),
            String::new(),
        ];
        let mut heads: Vec<String> = table.axes.iter().map(|&axis| axis.into()).collect();
        heads.push("paper".into());
        for (info, _) in entries {
            heads.extend(Form::ALL.map(|form| format!("{} {}", info.id(), form.name())));
        }
        heads.extend(Form::ALL.map(|form| format!("stages, {}", form.name())));
        let (mut rows, mut notes) = (vec![heads], Vec::new());
        for (n, row) in table.rows.iter().enumerate() {
            let mut cells = row.at.clone();
            cells.push(row.paper.map_or("–".into(), |figure| figure.to_string()));
            for (_, entries) in entries {
                let of = entries.iter().filter(|entry| entry.row == n);
                cells.extend(of.map(|entry| cell(&entry.outcome, row.unit, &mut notes)));
            }
            cells.extend(Form::ALL.map(|form| self.stages(n, form)));
            rows.push(cells);
        }
        lines.extend(aligned(&rows));
        lines.extend(markdown::notes(&notes));
        lines
    }

    /// What steady frames ran: the same on every device, or each list once.
    fn stages(&self, row: usize, form: Form) -> String {
        let mut lists: Vec<String> = Vec::new();
        for (_, outcome) in self.outcomes(row, form) {
            if let Outcome::Measured { stages, .. } = outcome
                && !stages.is_empty()
            {
                lists.push(stages.join(", "));
            }
        }
        lists.dedup();
        if lists.is_empty() { "–".into() } else { lists.join(" / ") }
    }

    fn report(&self) -> Value {
        let entry = |unit: Unit, info: &DeviceInfo, form: Form, outcome: &Outcome| {
            let mut entry = json!({
                "device": info.id(),
                "form": form.name(),
                "seconds": null,
                "fastest": null,
                "slowest": null,
                "runs": 0,
                "frames_per_second": null,
                "stages": null,
                "error": null,
                "skipped": null,
                "fault": null,
            });
            match outcome {
                Outcome::Measured { timing, stages, error } => {
                    entry["seconds"] = json!(timing.median().as_secs_f64());
                    if unit == Unit::FramesPerSecond {
                        entry["frames_per_second"] = output::number(unit.of(timing.median()));
                    }
                    entry["fastest"] = json!(timing.fastest().as_secs_f64());
                    entry["slowest"] = json!(timing.slowest().as_secs_f64());
                    entry["runs"] = json!(timing.runs());
                    entry["stages"] = json!(stages);
                    entry["error"] = json!(error);
                }
                Outcome::Skipped(why) => entry["skipped"] = json!(why),
                Outcome::Failed(why) => entry["fault"] = json!(why),
            }
            entry
        };
        let row = |(n, row): (usize, &papers::Row)| {
            let at: serde_json::Map<_, _> =
                self.table.axes.iter().zip(&row.at).map(|(&axis, at)| (axis.into(), json!(at))).collect();
            let entries = Form::ALL.into_iter().flat_map(|form| {
                self.outcomes(n, form).map(|(info, outcome)| entry(row.unit, info, form, outcome)).collect::<Vec<_>>()
            });
            json!({ "at": at, "unit": row.unit.name(), "paper": row.paper, "entries": entries.collect::<Vec<_>>() })
        };
        json!({
            "name": self.table.name,
            "title": self.table.title,
            "paper": self.table.paper,
            "hardware": self.table.hardware,
            "ours": self.table.ours,
            "rows": self.table.rows.iter().enumerate().map(row).collect::<Vec<_>>(),
        })
    }
}

/// A figure, or the number of the note that says why there is none.
fn cell(outcome: &Outcome, unit: Unit, notes: &mut Vec<String>) -> String {
    match outcome {
        Outcome::Measured { timing, error: Some(error), .. } => {
            format!("{} ({:.2} %)", figures(unit.of(timing.median())), 100.0 * error)
        }
        Outcome::Measured { timing, .. } => figures(unit.of(timing.median())),
        Outcome::Skipped(why) => format!("skipped ({})", note(why, notes)),
        Outcome::Failed(why) => format!("failed ({})", note(why, notes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_told_once() {
        let mut notes = Vec::new();
        let mut told = |outcome| cell(&outcome, Unit::Seconds, &mut notes);
        assert_eq!(told(Outcome::Skipped("too slow".into())), "skipped (1)");
        assert_eq!(told(Outcome::Failed("gone".into())), "failed (2)");
        assert_eq!(told(Outcome::Skipped("too slow".into())), "skipped (1)");
        assert_eq!(notes, ["too slow", "gone"]);
    }

    #[test]
    fn tables_are_picked_by_the_beginning_of_their_name() {
        let names = |prefix| tables(prefix).map(|found| found.iter().map(|t| t.name).collect::<Vec<_>>());
        assert_eq!(names("001").ok(), Some(vec!["001-table-2", "001-table-3"]));
        assert!(names("").is_ok_and(|all| all.len() > 2));
        let error = names("002").unwrap_err();
        assert!(error.code == 2 && error.message.contains("000-table-1"), "{error:?}");
    }
}
