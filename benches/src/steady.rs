//! Scenes of which one thing changes from frame to frame, and how long a frame takes once the first one is there.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use airlight::Renderer;
use airlight::device::DeviceError;
use airlight::exec::{ExecError, Hooks, Progress, RenderError, Rendered};
use airlight::metric::difference;
use airlight::scene::{Precompute, Scene};
use airlight::transfer::TransferError;

use crate::quick::Timing;
use crate::settled;

/// What is timed.
pub enum Work {
    /// Frames, of which the first prepares.
    Frames(Frames),
    /// The making of a transfer.
    Making(Making),
}

/// Makes of a scene the one of a frame.
type Change = Box<dyn FnMut(&mut Scene, u32) + Send>;

/// A scene of which something changes from frame to frame.
pub struct Frames {
    /// The frame to render next.
    pub scene: Scene,
    change: Change,
    number: u32,
    part: Option<Part>,
    full: Option<Box<Scene>>,
}

/// What of a frame is timed, where it is not all of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// What the host makes and writes,
    pub uploads: bool,
    /// and the stages of these names.
    pub stages: &'static [&'static str],
}

impl Frames {
    pub(crate) fn new(scene: Scene, change: impl FnMut(&mut Scene, u32) + Send + 'static) -> Self {
        Self { scene, change: Box::new(change), number: 0, part: None, full: None }
    }

    /// The same frames, of which the first is held against the picture of another scene.
    pub(crate) fn beside(self, full: Scene) -> Self {
        Self { full: Some(Box::new(full)), ..self }
    }

    /// The same frames, of which only a part is timed.
    pub(crate) fn part(self, part: Part) -> Self {
        Self { part: Some(part), ..self }
    }

    /// Goes on to the next frame.
    pub fn advance(&mut self) {
        self.number += 1;
        (self.change)(&mut self.scene, self.number);
    }

    /// How long a frame took that took `all` from the scene to the film on the host.
    fn time(&self, all: Duration, rendered: &Rendered) -> Duration {
        let Some(part) = self.part else { return all };
        let report = &rendered.report;
        let counted = report.stages.iter().filter(|stage| stage.ran && part.stages.contains(&stage.stage));
        let stages: Duration = counted.map(|stage| stage.time).sum();
        stages + if part.uploads { report.upload_time } else { Duration::ZERO }
    }
}

/// The making of a transfer.
pub struct Making {
    /// Whose medium it is of.
    pub scene: Scene,
    /// How it is made.
    pub options: Precompute,
    /// What of it is timed.
    pub(crate) timed: MakingPart,
}

/// What of the making of a transfer is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MakingPart {
    /// All of it.
    Whole,
    /// Carrying light.
    Transport,
    /// Compressing what it leaves.
    Compression,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It was timed; of frames, the steady ones, the film's way back to the host included.
    Measured {
        /// How long one takes.
        timing: Timing,
        /// The stages that the last frame ran, in order; none of a transfer that is made.
        stages: Vec<&'static str>,
        /// How far the first frame is from a picture that saves nothing: relative L2. None where none is saved.
        error: Option<f64>,
    },
    /// It was left out, for this reason: it would take too long, or more memory than there is.
    Skipped(String),
    /// A fault of the device.
    Failed(String),
}

/// How long the frames of an entry may take together unless said otherwise.
pub const LIMIT: Duration = Duration::from_secs(5);

/// How many times as long that which prepares may take, a first frame or a transfer: what is given up leaves nothing, and
/// the next entry would upload the same volume again.
pub const PREPARING: u32 = 10;

/// Runs are repeated until they have taken this long together,
const ENOUGH: Duration = Duration::from_millis(300);
/// but frames at least so often,
pub(crate) const FEWEST: usize = 3;
/// and at most this often.
const MOST: usize = 9;

/// Times the work. What takes longer than `limit`, or [`PREPARING`] times that where it prepares, is skipped.
pub fn measure(renderer: &mut Renderer, work: Work, name: &str, limit: Duration) -> Outcome {
    match work {
        Work::Frames(frames) => steady(renderer, frames, name, limit),
        Work::Making(making) => make(renderer, &making, name, limit.saturating_mul(PREPARING)),
    }
}

/// Renders the first frame, which prepares, and times those after it.
fn steady(renderer: &mut Renderer, mut frames: Frames, name: &str, limit: Duration) -> Outcome {
    let first = limit.saturating_mul(PREPARING);
    let mut prepared = |scene: &Scene| within(first, |hooks| renderer.render_with(scene, hooks));
    let full = frames.full.take().map(|full| prepared(&full)).transpose();
    let (full, quick) = match full.and_then(|full| Ok((full, prepared(&frames.scene)?))) {
        Ok(pictures) => pictures,
        Err(error) => return given_up(error, "preparing", first),
    };
    let error = full.map(|full| difference(&quick.film.beauty, &full.film.beauty).relative_l2);
    let begin = Instant::now();
    let camera = &frames.scene.camera;
    let pixels = Some((u64::from(camera.width) * u64::from(camera.height), "pixels"));
    // Frames in which drivers and backends settle do not count, where there is time for others.
    let (mut settling, mut settled_for) = (0, Duration::ZERO);
    let (mut runs, mut total, mut stages) = (Vec::new(), Duration::ZERO, Vec::new());
    while runs.len() < settling + MOST && (total < ENOUGH || runs.len() < settling + FEWEST) {
        frames.advance();
        let start = Instant::now();
        match within(limit.saturating_sub(begin.elapsed()), |hooks| renderer.render_with(&frames.scene, hooks)) {
            Ok(rendered) => {
                let time = start.elapsed();
                runs.push(frames.time(time, &rendered));
                if settled(settling, settled_for) {
                    total += time;
                } else {
                    (settling, settled_for) = (settling + 1, settled_for + time);
                }
                stages = rendered.report.ran();
                renderer.recycle(rendered.film);
            }
            Err(RenderError::Exec(ExecError::Cancelled)) if !runs.is_empty() => break,
            Err(error) => return given_up(error, "a frame", limit),
        }
    }
    runs.drain(..settling.min(runs.len().saturating_sub(FEWEST)));
    Outcome::Measured { timing: Timing::new(name, runs, pixels), stages, error }
}

/// Surveys the medium, which uploads it, and makes the transfer.
fn make(renderer: &mut Renderer, making: &Making, name: &str, limit: Duration) -> Outcome {
    let Making { scene, options, timed } = making;
    let begin = Instant::now();
    if let Err(error) = within(limit, |hooks| renderer.survey_transfer(scene, options, hooks)) {
        return given_up(error, "preparing", limit);
    }
    let mut runs = Vec::new();
    let mut total = Duration::ZERO;
    while runs.len() < MOST && total < ENOUGH {
        match foreseen(limit.saturating_sub(begin.elapsed()), |hooks| renderer.precompute(scene, options, hooks)) {
            Ok(made) => {
                total += made.transport + made.compression;
                runs.push(match timed {
                    MakingPart::Whole => made.transport + made.compression,
                    MakingPart::Transport => made.transport,
                    MakingPart::Compression => made.compression,
                });
            }
            Err(RenderError::Exec(ExecError::Cancelled)) if !runs.is_empty() => break,
            Err(error) => return given_up(error, "making it", limit),
        }
    }
    Outcome::Measured { timing: Timing::new(name, runs, None), stages: Vec::new(), error: None }
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

/// What `run` makes, unless it is not done within `limit`.
fn within<T>(limit: Duration, run: impl FnOnce(&mut Hooks<'_>) -> Result<T, RenderError>) -> Result<T, RenderError> {
    let begin = Instant::now();
    unless(|_| begin.elapsed() >= limit, limit, run)
}

/// As [`within`], of what tells how far it has come: it ends as soon as it can be seen to take longer.
fn foreseen<T>(limit: Duration, run: impl FnOnce(&mut Hooks<'_>) -> Result<T, RenderError>) -> Result<T, RenderError> {
    let begin = Instant::now();
    let mut stage = ("", begin);
    let late = move |progress: Progress| {
        if stage.0 != progress.stage {
            stage = (progress.stage, Instant::now());
        }
        let (all, of_stage) = (begin.elapsed(), stage.1.elapsed());
        all + left(of_stage, progress.done, limit) >= limit
    };
    unless(late, limit, run)
}

/// How long a stage goes on that has taken `elapsed` for a share of its work; 0 before it has taken long enough to tell.
fn left(elapsed: Duration, done: f32, limit: Duration) -> Duration {
    let telling = done > 0.0 && elapsed >= limit / 20;
    let seconds = elapsed.as_secs_f64() * f64::from((1.0 - done) / done);
    if telling { Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX / 2) } else { Duration::ZERO }
}

/// What `run` makes, unless it is too late before it is done.
fn unless<T>(
    mut late: impl FnMut(Progress) -> bool,
    limit: Duration,
    run: impl FnOnce(&mut Hooks<'_>) -> Result<T, RenderError>,
) -> Result<T, RenderError> {
    if limit.is_zero() {
        return Err(ExecError::Cancelled.into());
    }
    let cancel = AtomicBool::new(false);
    let mut watch = |progress| {
        if late(progress) {
            cancel.store(true, Ordering::Relaxed);
        }
    };
    run(&mut Hooks { progress: Some(&mut watch), cancel: Some(&cancel) })
}

/// Whether the device is well and merely too small, or the host is.
fn is_too_large(error: &RenderError) -> bool {
    use DeviceError::{Limit, OutOfMemory};
    let device = |error: &DeviceError| matches!(error, OutOfMemory { .. } | Limit { .. });
    match error {
        RenderError::Exec(ExecError::Memory { .. }) | RenderError::Transfer(TransferError::Memory { .. }) => true,
        RenderError::Exec(ExecError::Device { error, .. }) => device(error),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_is_told_by_what_is_done() {
        let seconds = Duration::from_secs;
        assert_eq!(left(seconds(2), 0.25, seconds(10)), seconds(6));
        assert_eq!(left(seconds(2), 1.0, seconds(10)), Duration::ZERO);
        // Nothing is done yet, or it is too early to tell.
        assert_eq!(left(seconds(9), 0.0, seconds(10)), Duration::ZERO);
        assert_eq!(left(seconds(2), 0.01, seconds(100)), Duration::ZERO);
    }

    #[test]
    fn what_will_be_late_is_ended() {
        let ended = |step: u64, limit: u64| {
            foreseen(Duration::from_millis(limit), |hooks| {
                for done in 0..10 {
                    std::thread::sleep(Duration::from_millis(step));
                    let progress = hooks.progress.as_mut().expect("it is watched");
                    progress(Progress { stage: "photons", done: done as f32 / 10.0 });
                    if hooks.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
                        return Ok(done);
                    }
                }
                Ok(10)
            })
            .unwrap()
        };
        // Ten tenths of 20 ms and more each: the first of them tell that 100 ms are not enough.
        assert!(ended(20, 100) < 5);
        assert_eq!(ended(0, 600_000), 10);
    }
}
