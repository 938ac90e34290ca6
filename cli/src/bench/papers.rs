//! `airlight bench --papers`: the papers' tables, as Markdown or JSON.

use std::time::Duration;

use airlight::device::DeviceInfo;
use airlight_benches::papers::{self, Entry, Form, Outcome, Table};
use serde_json::{Value, json};

use super::figures;
use crate::failure::Failure;
use crate::progress::Meter;
use crate::{devices, output};

/// The tables whose name begins with `prefix`.
pub(super) fn tables(prefix: &str) -> Result<Vec<Table>, Failure> {
    let mut tables = papers::tables();
    let names: Vec<_> = tables.iter().map(|table| table.name).collect();
    tables.retain(|table| table.name.starts_with(prefix));
    if tables.is_empty() {
        let what = format!("--papers {prefix}: no such table; there are {}", names.join(", "));
        return Err(Failure::input(what));
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
        output::line("# Speed in the papers' tables\n")?;
        let seconds = limit.as_secs_f64();
        output::line(&format!(
            "By `airlight bench --papers`, version {}: medians of a few frames, in at most {seconds} s an entry.\n",
            env!("CARGO_PKG_VERSION")
        ))?;
        for info in subjects {
            output::line(&format!("- `{}`: {}", info.id(), info.name))?;
        }
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
            format!("Frames a second. *Paper*: {}; {}. {}", table.paper, table.hardware, table.ours),
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
            cells.push(row.paper.map_or("–".into(), |fps| fps.to_string()));
            for (_, entries) in entries {
                let of = entries.iter().filter(|entry| entry.row == n);
                cells.extend(of.map(|entry| cell(&entry.outcome, &mut notes)));
            }
            cells.extend(Form::ALL.map(|form| self.stages(n, form)));
            rows.push(cells);
        }
        lines.extend(aligned(&rows));
        if !notes.is_empty() {
            lines.push(String::new());
            lines.extend(notes.iter().zip(1..).map(|(note, number)| format!("{number}. {note}")));
        }
        lines
    }

    /// What steady frames ran: the same on every device, or each list once.
    fn stages(&self, row: usize, form: Form) -> String {
        let mut lists: Vec<String> = Vec::new();
        for (_, outcome) in self.outcomes(row, form) {
            if let Outcome::Measured { stages, .. } = outcome {
                lists.push(stages.join(", "));
            }
        }
        lists.dedup();
        if lists.is_empty() { "–".into() } else { lists.join(" / ") }
    }

    fn report(&self) -> Value {
        let entry = |info: &DeviceInfo, form: Form, outcome: &Outcome| {
            let mut entry = json!({
                "device": info.id(),
                "form": form.name(),
                "seconds": null,
                "fastest": null,
                "slowest": null,
                "runs": 0,
                "frames_per_second": null,
                "stages": null,
                "skipped": null,
                "fault": null,
            });
            match outcome {
                Outcome::Measured { timing, stages } => {
                    let seconds = timing.median.as_secs_f64();
                    entry["seconds"] = json!(seconds);
                    entry["fastest"] = json!(timing.fastest.as_secs_f64());
                    entry["slowest"] = json!(timing.slowest.as_secs_f64());
                    entry["runs"] = json!(timing.runs);
                    entry["frames_per_second"] = output::number(1.0 / seconds);
                    entry["stages"] = json!(stages);
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
                self.outcomes(n, form).map(|(info, outcome)| entry(info, form, outcome)).collect::<Vec<_>>()
            });
            json!({ "at": at, "paper": row.paper, "entries": entries.collect::<Vec<_>>() })
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
fn cell(outcome: &Outcome, notes: &mut Vec<String>) -> String {
    let (what, why) = match outcome {
        Outcome::Measured { timing, .. } => return figures(1.0 / timing.median.as_secs_f64()),
        Outcome::Skipped(why) => ("skipped", why),
        Outcome::Failed(why) => ("failed", why),
    };
    let place = notes.iter().position(|note| note == why).unwrap_or_else(|| {
        notes.push(why.clone());
        notes.len() - 1
    });
    format!("{what} ({})", place + 1)
}

/// A Markdown table whose first row is its head, with columns of one width each.
fn aligned(rows: &[Vec<String>]) -> Vec<String> {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |n: usize| rows.iter().map(|row| row[n].chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells: Vec<_> = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:<width$}")).collect();
        format!("| {} |", cells.join(" | "))
    };
    let rule = format!("| {} |", widths.iter().map(|&width| "-".repeat(width.max(3))).collect::<Vec<_>>().join(" | "));
    let mut lines: Vec<_> = rows.iter().map(line).collect();
    lines.insert(1.min(lines.len()), rule);
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_told_once() {
        let mut notes = Vec::new();
        let slow = Outcome::Skipped("too slow".into());
        assert_eq!(cell(&slow, &mut notes), "skipped (1)");
        assert_eq!(cell(&Outcome::Failed("gone".into()), &mut notes), "failed (2)");
        assert_eq!(cell(&slow, &mut notes), "skipped (1)");
        assert_eq!(notes, ["too slow", "gone"]);
    }

    #[test]
    fn columns_have_one_width() {
        let row = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        let lines = aligned(&[row(["static", "a"]), row(["–", "bcde"])]);
        assert_eq!(lines, ["| static | a    |", "| ------ | ---- |", "| –      | bcde |"]);
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
