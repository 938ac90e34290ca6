//! The papers' own measurements, repeated: tables of frames per second, each row beside the paper's figure.
//!
//! A paper has a module, which says what its scenes are here; a [`Table`] bears the name of its row in
//! `docs/papers.md`. Every row is rendered in two forms, ours and the published one, with one thing moving from frame
//! to frame, and every entry tells which stages a steady frame ran.

mod figures;
mod opacity;
mod records;
mod transfer;

use std::time::Duration;

use airlight::Renderer;
use airlight::device::Device;

use crate::quick::Fault;
use crate::steady::{self, Outcome, Work};

/// What most tables count.
const FRAMES: &str = "Frames a second.";

/// A table of a paper.
pub struct Table {
    /// Its row in `docs/papers.md`, such as `001-table-2`.
    pub name: &'static str,
    /// What it tells.
    pub title: &'static str,
    /// Who published it.
    pub paper: &'static str,
    /// What the paper's figures were measured on.
    pub hardware: &'static str,
    /// What is rendered here, and what differs from the paper.
    pub ours: &'static str,
    /// What its figures are.
    pub figures: &'static str,
    /// What rows differ in.
    pub axes: &'static [&'static str],
    /// The rows.
    pub rows: Vec<Row>,
}

/// A row: what is timed, and the paper's figure.
pub struct Row {
    /// Where it stands on the table's axes.
    pub at: Vec<String>,
    /// What its figures count.
    pub unit: Unit,
    /// The paper's figure, where it has the row.
    pub paper: Option<f64>,
    work: Box<dyn Fn(Form) -> Work + Send + Sync>,
    stages: Box<dyn Fn(Form) -> Vec<&'static str> + Send + Sync>,
}

impl Row {
    /// What is timed.
    pub fn work(&self, form: Form) -> Work {
        (self.work)(form)
    }

    /// The stages that every frame but the first must run, and no others. None where a transfer is made.
    pub fn stages(&self, form: Form) -> Vec<&'static str> {
        (self.stages)(form)
    }
}

/// What a figure counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Frames a second.
    FramesPerSecond,
    /// Seconds.
    Seconds,
    /// Thousandths of a second.
    Milliseconds,
}

impl Unit {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::FramesPerSecond => "frames/s",
            Self::Seconds => "s",
            Self::Milliseconds => "ms",
        }
    }

    /// The figure of what takes so long.
    pub fn of(self, time: Duration) -> f64 {
        match self {
            Self::FramesPerSecond => 1.0 / time.as_secs_f64(),
            Self::Seconds => time.as_secs_f64(),
            Self::Milliseconds => 1e3 * time.as_secs_f64(),
        }
    }
}

/// Which form of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Its defaults.
    Ours,
    /// As the paper has it.
    Published,
}

impl Form {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Ours, Self::Published];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ours => "ours",
            Self::Published => "published",
        }
    }
}

/// A row in one form on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Index of the row.
    pub row: usize,
    /// Its form.
    pub form: Form,
    /// What came of it.
    pub outcome: Outcome,
}

/// All tables, in the papers' order.
pub fn tables() -> Vec<Table> {
    tables_of(1)
}

/// All tables, with volumes, pictures and transfers of the papers' sizes divided by `small`.
fn tables_of(small: u32) -> Vec<Table> {
    vec![
        figures::figure_1(small),
        figures::figure_5(small),
        figures::figure_6(small),
        records::table_1(small),
        opacity::table_2(),
        opacity::table_3(),
        transfer::table_1(small),
    ]
}

/// Measures every row of a table in both forms on a device that `open` opens, and gives each entry to `tell` as soon as
/// it is there. `limit` is as of [`steady::measure`]. After a fault the device is opened anew for the next entry.
pub fn measure(
    table: &Table,
    open: impl Fn() -> Result<Box<dyn Device>, Fault>,
    limit: Duration,
    mut tell: impl FnMut(Entry),
) {
    let mut renderer = None;
    for (row, content) in table.rows.iter().enumerate() {
        for form in Form::ALL {
            let outcome = match renderer.take().map_or_else(|| open().map(Renderer::new), Ok) {
                Ok(mut opened) => {
                    let name = format!("{}/{}/{}", table.name, content.at.join("/"), form.name());
                    let outcome = steady::measure(&mut opened, content.work(form), &name, limit);
                    if !matches!(outcome, Outcome::Failed(_)) {
                        renderer = Some(opened);
                    }
                    outcome
                }
                Err(fault) => Outcome::Failed(fault.to_string()),
            };
            tell(Entry { row, form, outcome });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows that are quick to prepare, in small pictures.
    fn small() -> Vec<Table> {
        let mut tables = tables_of(16);
        for table in &mut tables {
            table.rows.retain(|row| !["64", "128", "bonsai", "bone", "part"].contains(&row.at[0].as_str()));
        }
        tables
    }

    #[test]
    fn what_is_static_is_not_redone() {
        let mut renderer = Renderer::new(airlight::open("cpu").unwrap());
        for table in small() {
            assert!(table.rows.len() >= 2, "{}", table.name);
            for row in &table.rows {
                for form in Form::ALL {
                    let Work::Frames(mut frames) = row.work(form) else { continue };
                    (frames.scene.camera.width, frames.scene.camera.height) = (24, 16);
                    let first = renderer.render(&frames.scene).unwrap().film;
                    for _ in 0..2 {
                        frames.advance();
                        let next = renderer.render(&frames.scene).unwrap();
                        assert_eq!(next.report.ran(), row.stages(form), "{} {:?} {form:?}", table.name, row.at);
                        assert!(next.film.beauty != first.beauty, "nothing moves: {} {:?}", table.name, row.at);
                    }
                }
            }
        }
    }

    #[test]
    fn transfers_are_made_in_both_forms() {
        let cpu = || Ok(airlight::open("cpu")?);
        let mut table = transfer::table_1(32);
        table.rows.truncate(1);
        measure(&table, cpu, Duration::from_secs(600), |entry| {
            let Outcome::Measured { timing, stages, .. } = entry.outcome else { panic!("{:?}", entry.outcome) };
            assert!(!timing.median().is_zero() && stages.is_empty(), "{timing:?} {stages:?}");
        });
        measure(&table, cpu, Duration::ZERO, |entry| {
            assert!(matches!(&entry.outcome, Outcome::Skipped(why) if why.contains("more than 0 s")), "{entry:?}");
        });
    }

    #[test]
    fn tables_are_named_once_and_rows_stand_on_their_axes() {
        let tables = tables();
        for (n, table) in tables.iter().enumerate() {
            assert!(tables[..n].iter().all(|other| other.name != table.name), "{} stands twice", table.name);
            for (n, row) in table.rows.iter().enumerate() {
                assert_eq!(row.at.len(), table.axes.len(), "{} {:?}", table.name, row.at);
                assert!(table.rows[..n].iter().all(|other| other.at != row.at), "{:?} stands twice", row.at);
            }
            assert!(table.rows.iter().filter(|row| row.paper.is_some()).count() >= 2, "{}", table.name);
        }
    }

    /// The first row of the smallest table.
    fn one() -> Table {
        let mut table = opacity::table_3();
        table.rows.truncate(1);
        table
    }

    #[test]
    fn an_entry_is_told_whatever_comes_of_it() {
        let cpu = || Ok(airlight::open("cpu")?);
        let measured = |open: &dyn Fn() -> Result<Box<dyn Device>, Fault>, limit| {
            let mut outcomes = Vec::new();
            measure(&one(), open, limit, |entry| outcomes.push(entry.outcome));
            outcomes
        };
        for outcome in measured(&cpu, Duration::from_secs(600)) {
            let Outcome::Measured { timing, stages, .. } = outcome else { panic!("{outcome:?}") };
            assert!(timing.runs() >= steady::FEWEST && stages.ends_with(&["march"]), "{timing:?} {stages:?}");
        }
        for outcome in measured(&cpu, Duration::ZERO) {
            assert!(matches!(&outcome, Outcome::Skipped(why) if why.contains("more than 0 s")), "{outcome:?}");
        }
        for outcome in measured(&|| Err("it is gone".into()), steady::LIMIT) {
            assert_eq!(outcome, Outcome::Failed("it is gone".into()));
        }
        let broken = || {
            let fault = airlight::device::Fault::Fail;
            let faulty = airlight::device::Faulty::new(airlight::open("cpu")?, "march", fault);
            Ok(Box::new(faulty) as Box<dyn Device>)
        };
        for outcome in measured(&broken, steady::LIMIT) {
            assert!(matches!(&outcome, Outcome::Failed(why) if why.contains("on purpose")), "{outcome:?}");
        }
    }

    #[test]
    fn a_device_that_is_too_small_is_skipped_with_its_numbers() {
        let mut renderer = Renderer::new(airlight::open("cpu").unwrap());
        renderer.executor().set_budget(1 << 20);
        let outcome = steady::measure(&mut renderer, one().rows[0].work(Form::Ours), "small", steady::LIMIT);
        assert!(matches!(&outcome, Outcome::Skipped(why) if why.contains("1.0 MiB")), "{outcome:?}");
    }
}
