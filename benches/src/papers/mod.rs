//! The papers' own measurements, repeated: tables of frames per second, each row beside the paper's figure.
//!
//! A paper has a module, which says what its scenes are here; a [`Table`] bears the name of its row in
//! `docs/papers.md`. Every row is rendered in two forms, ours and the published one, with one thing moving from frame
//! to frame, and every entry tells which stages a steady frame ran.

mod opacity;
mod records;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use airlight::Renderer;
use airlight::device::{Device, DeviceError};
use airlight::exec::{ExecError, Hooks, RenderError, Rendered};
use airlight::scene::Scene;

use crate::quick::{Fault, Timing};

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
    /// What rows differ in.
    pub axes: &'static [&'static str],
    /// The rows.
    pub rows: Vec<Row>,
}

/// A row: what is rendered, and the paper's figure.
pub struct Row {
    /// Where it stands on the table's axes.
    pub at: Vec<String>,
    /// Frames a second in the paper, where it has the row.
    pub paper: Option<f64>,
    frames: Box<dyn Fn(Form) -> Frames + Send + Sync>,
    stages: Box<dyn Fn(Form) -> Vec<&'static str> + Send + Sync>,
}

impl Row {
    /// The scene and what moves in it.
    pub fn frames(&self, form: Form) -> Frames {
        (self.frames)(form)
    }

    /// The stages that every frame but the first must run, and no others.
    pub fn stages(&self, form: Form) -> Vec<&'static str> {
        (self.stages)(form)
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

/// Makes of a scene the one of a frame.
type Change = Box<dyn FnMut(&mut Scene, u32)>;

/// A scene of which something changes from frame to frame.
pub struct Frames {
    /// The frame to render next.
    pub scene: Scene,
    change: Change,
    number: u32,
}

impl Frames {
    fn new(scene: Scene, change: impl FnMut(&mut Scene, u32) + 'static) -> Self {
        Self { scene, change: Box::new(change), number: 0 }
    }

    /// Goes on to the next frame.
    pub fn advance(&mut self) {
        self.number += 1;
        (self.change)(&mut self.scene, self.number);
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

/// What came of an entry.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Steady frames were timed, the film's way back to the host included.
    Measured {
        /// How long a frame takes.
        timing: Timing,
        /// The stages that the last of them ran, in order.
        stages: Vec<&'static str>,
    },
    /// It was left out, for this reason: it would take too long, or more memory than there is.
    Skipped(String),
    /// A fault of the device, which was opened anew for the next entry.
    Failed(String),
}

/// All tables, in the papers' order.
pub fn tables() -> Vec<Table> {
    vec![records::table_1(records::VOXELS), opacity::table_2(), opacity::table_3()]
}

/// How long the frames of an entry may take together unless said otherwise.
pub const LIMIT: Duration = Duration::from_secs(5);

/// How many times as long the frame before them may take, which prepares: a frame that is given up leaves nothing, and
/// the next entry would upload the same volume again.
pub const PREPARING: u32 = 10;

/// Frames are repeated until they have taken this long together,
const ENOUGH: Duration = Duration::from_millis(300);
/// but at least so often,
const FEWEST: usize = 3;
/// and at most this often.
const MOST: usize = 9;

/// Measures every row of a table in both forms on a device that `open` opens, and gives each entry to `tell` as soon as
/// it is there. A frame that takes longer than `limit`, or [`PREPARING`] times that for the first, is skipped.
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
                    let outcome = steady(&mut opened, content.frames(form), &name, limit);
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

/// Renders the first frame, which prepares, and times those after it.
fn steady(renderer: &mut Renderer, mut frames: Frames, name: &str, limit: Duration) -> Outcome {
    if let Err(error) = within(limit.saturating_mul(PREPARING), renderer, &frames.scene) {
        return given_up(error, "preparing", limit.saturating_mul(PREPARING));
    }
    let begin = Instant::now();
    let camera = &frames.scene.camera;
    let pixels = Some((u64::from(camera.width) * u64::from(camera.height), "pixels"));
    let (mut runs, mut total, mut stages) = (Vec::new(), Duration::ZERO, Vec::new());
    while runs.len() < MOST && (total < ENOUGH || runs.len() < FEWEST) {
        frames.advance();
        let start = Instant::now();
        match within(limit.saturating_sub(begin.elapsed()), renderer, &frames.scene) {
            Ok(rendered) => {
                let time = start.elapsed();
                runs.push(time);
                total += time;
                stages = rendered.report.ran();
            }
            Err(RenderError::Exec(ExecError::Cancelled)) if !runs.is_empty() => break,
            Err(error) => return given_up(error, "a frame", limit),
        }
    }
    Outcome::Measured { timing: Timing::new(name, runs, pixels), stages }
}

/// Why there is no figure.
fn given_up(error: RenderError, what: &str, limit: Duration) -> Outcome {
    match error {
        RenderError::Exec(ExecError::Cancelled) => {
            Outcome::Skipped(format!("{what} takes more than {} s", limit.as_secs_f64()))
        }
        error if is_too_large(&error) => Outcome::Skipped(error.to_string()),
        error => Outcome::Failed(error.to_string()),
    }
}

/// Renders a frame, unless it is not done within `limit`.
fn within(limit: Duration, renderer: &mut Renderer, scene: &Scene) -> Result<Rendered, RenderError> {
    if limit.is_zero() {
        return Err(ExecError::Cancelled.into());
    }
    let (begin, cancel) = (Instant::now(), AtomicBool::new(false));
    let mut watch = |_| cancel.store(begin.elapsed() >= limit, Ordering::Relaxed);
    renderer.render_with(scene, &mut Hooks { progress: Some(&mut watch), cancel: Some(&cancel) })
}

/// Whether the device is well and merely too small.
fn is_too_large(error: &RenderError) -> bool {
    use DeviceError::{Limit, OutOfMemory};
    let RenderError::Exec(error) = error else { return false };
    let device = |error: &DeviceError| matches!(error, OutOfMemory { .. } | Limit { .. });
    match error {
        ExecError::Memory { .. } => true,
        ExecError::Device { error, .. } => device(error),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows that are quick to prepare, in small pictures.
    fn small() -> Vec<Table> {
        let mut tables = vec![records::table_1(24), opacity::table_2(), opacity::table_3()];
        for table in &mut tables {
            table.rows.retain(|row| row.at[0] != "100" && row.at[0] != "50" && row.at[0] != "64" && row.at[0] != "128");
        }
        tables
    }

    fn shrink(mut frames: Frames) -> Frames {
        (frames.scene.camera.width, frames.scene.camera.height) = (24, 16);
        frames
    }

    #[test]
    fn what_is_static_is_not_redone() {
        let mut renderer = Renderer::new(airlight::open("cpu").unwrap());
        for table in small() {
            assert!(table.rows.len() >= 3, "{}", table.name);
            for row in &table.rows {
                for form in Form::ALL {
                    let mut frames = shrink(row.frames(form));
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
    fn tables_are_named_once_and_rows_stand_on_their_axes() {
        let tables = tables();
        for (n, table) in tables.iter().enumerate() {
            assert!(tables[..n].iter().all(|other| other.name != table.name), "{} stands twice", table.name);
            for (n, row) in table.rows.iter().enumerate() {
                assert_eq!(row.at.len(), table.axes.len(), "{} {:?}", table.name, row.at);
                assert!(table.rows[..n].iter().all(|other| other.at != row.at), "{:?} stands twice", row.at);
            }
            assert!(table.rows.iter().filter(|row| row.paper.is_some()).count() >= 4, "{}", table.name);
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
            let Outcome::Measured { timing, stages } = outcome else { panic!("{outcome:?}") };
            assert!(timing.runs >= FEWEST && stages.ends_with(&["march"]), "{timing:?} {stages:?}");
        }
        for outcome in measured(&cpu, Duration::ZERO) {
            assert!(matches!(&outcome, Outcome::Skipped(why) if why.contains("more than 0 s")), "{outcome:?}");
        }
        for outcome in measured(&|| Err("it is gone".into()), LIMIT) {
            assert_eq!(outcome, Outcome::Failed("it is gone".into()));
        }
        let broken = || {
            let fault = airlight::device::Fault::Fail;
            let faulty = airlight::device::Faulty::new(airlight::open("cpu")?, "march", fault);
            Ok(Box::new(faulty) as Box<dyn Device>)
        };
        for outcome in measured(&broken, LIMIT) {
            assert!(matches!(&outcome, Outcome::Failed(why) if why.contains("on purpose")), "{outcome:?}");
        }
    }

    #[test]
    fn a_device_that_is_too_small_is_skipped_with_its_numbers() {
        let mut renderer = Renderer::new(airlight::open("cpu").unwrap());
        renderer.executor().set_budget(1 << 20);
        let frames = one().rows[0].frames(Form::Ours);
        let outcome = steady(&mut renderer, frames, "small", LIMIT);
        assert!(matches!(&outcome, Outcome::Skipped(why) if why.contains("1.0 MiB")), "{outcome:?}");
    }
}
