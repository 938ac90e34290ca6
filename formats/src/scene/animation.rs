//! `[animation]`: values of the scene that change from frame to frame.

use std::ops::RangeInclusive;

use super::error::Fault;
use super::table::{Field, Table, closest};
use super::tree::{Entry, Node, Origin, Value, shorten};

/// How a scene changes from frame to frame, beside sequences of files.
#[derive(Clone, Debug)]
pub struct Animation {
    /// The frames that the scene is meant for; others may be asked for all the same.
    pub frames: RangeInclusive<u32>,
    /// Frames a second, for who makes a film of them; no value depends on it.
    pub fps: f64,
    /// The keys that change.
    pub tracks: Vec<Track>,
}

/// The course of one key: its values at some frames.
#[derive(Clone, Debug)]
pub struct Track {
    /// Dotted path of the key, as in `light.0.position`.
    pub key: String,
    /// Frames with a value of their own, rising, at least one. Before the first and after the last the value holds.
    pub frames: Vec<u32>,
    /// The course between two of them.
    pub curve: Curve,
    /// As many as frames, numbers or lists of them of one form.
    values: Vec<Node>,
}

/// The course between two frames that have values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// In proportion to time, each component by itself.
    Linear,
    /// A cubic of a continuous speed, which is 0 at the first and the last frame and wherever a component turns. Between
    /// two frames no component leaves the range of its two values (Fritsch and Butland, A Method for Constructing Local
    /// Monotone Piecewise Cubic Interpolants, SIAM J. Sci. Stat. Comput. 5, 1984).
    Smooth,
    /// The value of the frame before.
    Step,
}

impl Curve {
    /// The name of each in scenes.
    pub const NAMES: [(&'static str, Self); 3] =
        [("linear", Self::Linear), ("smooth", Self::Smooth), ("step", Self::Step)];

    /// Its name in scenes.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, curve)| *curve == self).map_or("", |(name, _)| name)
    }
}

/// `[animation]` of the scene `root`, whose sections are those; `sets` are the overrides, already in place.
pub(super) fn parse(root: &Node, sections: &Table<'_>, sets: &[(String, String)]) -> Result<Option<Animation>, Fault> {
    let Some(field) = sections.asked("animation") else { return Ok(None) };
    let table = field.table(&["frames", "fps", "track"])?;
    let frames = range(&table.require("frames", "frames = [1, 120]")?)?;
    let fps = table.or("fps", 24.0, |f| f.number_where("above 0", |v| v > 0.0))?;
    let mut tracks: Vec<Track> = Vec::new();
    for field in table.asked("track").map_or(Ok(Vec::new()), |f| f.list())? {
        let (track, key) = track(&field, root)?;
        if let Some(n) = tracks.iter().position(|t| overlap(&t.key, &track.key)) {
            let what = format!("animation.track[{n}] gives values to {} already; one track each", tracks[n].key);
            return Err(key.wrong(&what));
        }
        if let Some(n) = sets.iter().position(|(set, _)| overlap(set, &track.key)) {
            let what =
                format!("animation.track[{}] gives {} its values; take one of both out", tracks.len(), track.key);
            return Err(Fault::new(Origin::Set(n), what));
        }
        tracks.push(track);
    }
    Ok(Some(Animation { frames, fps, tracks }))
}

fn range(field: &Field<'_>) -> Result<RangeInclusive<u32>, Fault> {
    let [first, last] = &field.list()?[..] else {
        return Err(field.wrong("it must be [first, last], two frames"));
    };
    let (first, last) = (first.whole(0..=u32::MAX)?, last.whole(0..=u32::MAX)?);
    if first <= last { Ok(first..=last) } else { Err(field.wrong("the last frame must not be before the first")) }
}

/// A track, and where its key stands.
fn track<'a>(field: &Field<'a>, root: &Node) -> Result<(Track, Field<'a>), Fault> {
    let table = field.table(&["key", "frames", "values", "interpolation"])?;
    let key = table.require("key", "key = \"light.0.position\"")?;
    target(&key, root)?;

    let at = table.require("frames", "frames = [1, 60]")?;
    let mut frames: Vec<u32> = Vec::new();
    for frame in at.list()? {
        let number = frame.whole(0..=u32::MAX)?;
        if let Some(last) = frames.last().filter(|last| **last >= number) {
            return Err(frame.wrong(&format!("it must be above {last}, the frame before it")));
        }
        frames.push(number);
    }
    if frames.is_empty() {
        return Err(at.wrong("at least one frame must have a value"));
    }

    let given = table.require("values", "values = [[0, 2, 0], [1, 2, 0]]")?;
    let list = given.list()?;
    if list.len() != frames.len() {
        let what = format!("has {} values for {} frames; each frame takes one", list.len(), frames.len());
        return Err(given.from(what));
    }
    for value in &list {
        numbers(value)?;
        let first = list[0].node();
        if !alike(first, value.node()) {
            let right = format!("it must be of the form of the first value, {}", first.value);
            return Err(value.wrong(&right));
        }
    }
    let values = list.iter().map(|f| f.node().clone()).collect();
    let curve = table.or("interpolation", Curve::Linear, |f| f.choice(&Curve::NAMES.map(|(n, c)| (n, Some(c)))))?;
    Ok((Track { key: key.text()?.to_owned(), frames, curve, values }, key))
}

/// Refuses a key that the scene does not have, or that holds no numbers there.
fn target(key: &Field<'_>, root: &Node) -> Result<(), Fault> {
    let steps: Vec<_> = key.text()?.split('.').collect();
    if steps[0] == "animation" {
        return Err(key.wrong("what is animated is the rest of the scene"));
    }
    let Some(node) = root.at(&steps) else {
        return Err(key.wrong(&missing(&steps, root)));
    };
    if numeric(node) { Ok(()) } else { Err(key.wrong(&format!("it is {}; numbers are animated", node.value.kind()))) }
}

/// What is there in place of a key that is not.
fn missing(steps: &[&str], root: &Node) -> String {
    let depth = (0..steps.len()).take_while(|n| root.at(&steps[..*n]).is_some()).last().unwrap_or_default();
    let (path, step) = (steps[..depth].join("."), shorten(steps[depth]));
    let within = if path.is_empty() { "the scene".to_owned() } else { path };
    match root.at(&steps[..depth]).map(|node| &node.value) {
        Some(Value::List(list)) => format!("{within} has {} entries, counted from 0", list.len()),
        Some(Value::Table(entries)) => {
            let keys: Vec<_> = entries.iter().map(|e: &Entry| e.key.as_str()).collect();
            match closest(&step, &keys) {
                Some(meant) => format!("{within} has no `{step}`; did you mean `{meant}`?"),
                None => format!("{within} has no `{step}`; give it a value there, which the track then changes"),
            }
        }
        _ => format!("{within} has no `{step}`"),
    }
}

/// Whether one of two dotted paths leads to the other or to a part of it.
fn overlap(a: &str, b: &str) -> bool {
    a.split('.').zip(b.split('.')).all(|(a, b)| a.trim() == b.trim())
}

/// Whether a value is a number, or a list of what is.
fn numeric(node: &Node) -> bool {
    match &node.value {
        Value::Whole(_) | Value::Number(_) => true,
        Value::List(nodes) => nodes.iter().all(numeric),
        _ => false,
    }
}

/// Refuses what is neither a finite number nor a list of what is.
fn numbers(field: &Field<'_>) -> Result<(), Fault> {
    match &field.node().value {
        Value::List(_) => field.list()?.iter().try_for_each(numbers),
        _ => field.number().map(drop),
    }
}

/// Whether two values of numbers have as many of them in the same lists.
fn alike(a: &Node, b: &Node) -> bool {
    match (&a.value, &b.value) {
        (Value::List(a), Value::List(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| alike(a, b)),
        (Value::List(_), _) | (_, Value::List(_)) => false,
        _ => true,
    }
}

/// The numbers of a value, in their order.
fn leaves(node: &Node, out: &mut Vec<f64>) {
    match &node.value {
        Value::List(nodes) => nodes.iter().for_each(|node| leaves(node, out)),
        Value::Whole(v) => out.push(*v as f64),
        Value::Number(v) => out.push(*v),
        _ => {}
    }
}

/// A value of the form and at the place of `node` with other numbers.
fn filled(node: &Node, numbers: &mut impl Iterator<Item = f64>) -> Node {
    let value = match &node.value {
        Value::List(nodes) => Value::List(nodes.iter().map(|node| filled(node, numbers)).collect()),
        other => numbers.next().map_or_else(|| other.clone(), Value::Number),
    };
    Node { origin: node.origin, value }
}

impl Animation {
    /// Puts the values of a frame into the scene that the tracks were made for.
    pub(super) fn apply(&self, root: &mut Node, frame: u32) {
        for track in &self.tracks {
            let steps: Vec<_> = track.key.split('.').collect();
            if let Some(node) = root.at_mut(&steps) {
                *node = track.value(frame);
            }
        }
    }
}

impl Track {
    /// The value at a frame. It stands in the file where the last one that was given stands.
    fn value(&self, frame: u32) -> Node {
        let after = self.frames.partition_point(|f| *f <= frame);
        let Some(before) = after.checked_sub(1) else { return self.values[0].clone() };
        let from = &self.values[before];
        // Numbers that do not change stay as they were written.
        let rests = after == self.frames.len() || self.frames[before] == frame || *from == self.values[after];
        if rests || self.curve == Curve::Step {
            return from.clone();
        }
        let numbers = |n: usize| {
            let mut out = Vec::new();
            leaves(&self.values[n], &mut out);
            out
        };
        let (a, b) = (numbers(before), numbers(after));
        let smooth = self.curve == Curve::Smooth;
        let ends = [smooth.then(|| before.checked_sub(1)).flatten(), smooth.then_some(after + 1)];
        let [earlier, later] = ends.map(|n| n.filter(|n| *n < self.values.len()).map(|n| (n, numbers(n))));
        let time = |n: usize| f64::from(self.frames[n]);
        let span = time(after) - time(before);
        let elapsed = f64::from(frame) - time(before);
        let mut mixed = (0..a.len()).map(|i| {
            let rise = (b[i] - a[i]) / span;
            let between = if smooth {
                let start = earlier.as_ref().map_or(0.0, |(n, e)| {
                    let width = time(before) - time(*n);
                    speed((width, (a[i] - e[i]) / width), (span, rise))
                });
                let end = later.as_ref().map_or(0.0, |(n, l)| {
                    let width = time(*n) - time(after);
                    speed((span, rise), (width, (l[i] - b[i]) / width))
                });
                hermite(a[i], b[i], start * span, end * span, elapsed / span)
            } else {
                // Multiplied first, so that what counts frames stays whole.
                a[i] + (b[i] - a[i]) * elapsed / span
            };
            between.clamp(a[i].min(b[i]), a[i].max(b[i]))
        });
        filled(from, &mut mixed)
    }
}

/// The speed at a frame between two spans of time, each with its mean speed: their harmonic mean, the shorter one counting
/// more; 0 where the value turns.
fn speed((w0, d0): (f64, f64), (w1, d1): (f64, f64)) -> f64 {
    if d0 == 0.0 || d1 == 0.0 || (d0 > 0.0) != (d1 > 0.0) {
        return 0.0;
    }
    let (a, b) = (2.0 * w1 + w0, w1 + 2.0 * w0);
    (a + b) / (a / d0 + b / d1)
}

/// The cubic from `a` to `b` over t from 0 to 1 with the speeds `p` and `q` at its ends.
fn hermite(a: f64, b: f64, p: f64, q: f64, t: f64) -> f64 {
    let s = 1.0 - t;
    a + (b - a) * t * t * (3.0 - 2.0 * t) + p * t * s * s - q * t * t * s
}
