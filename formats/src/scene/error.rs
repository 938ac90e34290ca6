//! Errors of scenes, with their place.

use std::fmt;
use std::path::{Path, PathBuf};

use super::tree::Origin;

/// A scene that cannot be used: where, and what would be right.
///
/// Displayed it is one line, `path:line:column: message`, or `--set KEY=VALUE: message` where an override of the
/// command line is at fault. The alternate form (`{:#}`, [`report`](Self::report)) adds the line itself with a mark.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct SceneFileError {
    /// The scene file.
    pub path: PathBuf,
    /// Line and column, both from 1 (columns in characters), where a place in the file is at fault.
    pub place: Option<(usize, usize)>,
    /// The override at fault, as `KEY=VALUE`.
    pub set: Option<String>,
    /// What is wrong, and what would be right.
    pub message: String,
    excerpt: Option<Box<Excerpt>>,
}

/// A line of the file, and the part of it to mark.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Excerpt {
    line: String,
    skip: usize,
    mark: usize,
}

impl SceneFileError {
    /// One line, and below it the line of the file with a mark under the place.
    pub fn report(&self) -> String {
        format!("{self:#}")
    }

    /// An error of the file as a whole.
    pub(super) fn whole(path: &Path, message: impl Into<String>) -> Self {
        Self { path: path.to_path_buf(), place: None, set: None, message: message.into(), excerpt: None }
    }
}

impl fmt::Display for SceneFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(set) = &self.set {
            return write!(f, "--set {set}: {}", self.message);
        }
        write!(f, "{}:", self.path.display())?;
        if let Some((line, column)) = self.place {
            write!(f, "{line}:{column}:")?;
        }
        write!(f, " {}", self.message)?;
        if let (true, Some((line, _)), Some(excerpt)) = (f.alternate(), self.place, &self.excerpt) {
            let gutter = " ".repeat(line.to_string().len());
            let (text, before, mark) = (&excerpt.line, " ".repeat(excerpt.skip), "^".repeat(excerpt.mark));
            write!(f, "\n{gutter} |\n{line} | {text}\n{gutter} | {before}{mark}")?;
        }
        Ok(())
    }
}

/// What is wrong with a value, before it is known which line that is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) origin: Origin,
    pub(super) message: String,
}

/// The most characters of a line that an excerpt shows, and how many of them before the mark.
const EXCERPT: usize = 110;
const BEFORE: usize = 60;

impl Fault {
    pub(super) fn new(origin: Origin, message: impl Into<String>) -> Self {
        Self { origin, message: message.into() }
    }

    /// The error with the place in `text`, or with the override's own words.
    pub(super) fn locate(self, path: &Path, text: &str, sets: &[(String, String)]) -> SceneFileError {
        let mut error = SceneFileError::whole(path, self.message);
        match self.origin {
            Origin::Document => {}
            Origin::Set(i) => error.set = sets.get(i).map(|(key, value)| format!("{key}={value}")),
            Origin::File { start, end } => {
                let (place, excerpt) = place(text, start, end);
                (error.place, error.excerpt) = (Some(place), Some(Box::new(excerpt)));
            }
        }
        error
    }
}

fn place(text: &str, start: usize, end: usize) -> ((usize, usize), Excerpt) {
    // Spans come from the parser and lie on characters; what does not is moved there.
    let mut start = start.min(text.len());
    while !text.is_char_boundary(start) {
        start -= 1;
    }
    let from = text[..start].rfind('\n').map_or(0, |i| i + 1);
    let line = text[from..].lines().next().unwrap_or_default();
    let number = text[..start].matches('\n').count() + 1;
    let column = text[from..start].chars().count();
    let marked = line.char_indices().skip(column).take_while(|(i, _)| from + i < end).count();
    let cut = if line.chars().count() > EXCERPT { column.saturating_sub(BEFORE) } else { 0 };
    // A tab is shown as one column, so that the mark stands below its character.
    let visible = line.chars().skip(cut).take(EXCERPT).map(|c| if c.is_control() { ' ' } else { c });
    let visible: String = visible.collect();
    let mark = marked.clamp(1, EXCERPT.saturating_sub(column - cut).max(1));
    ((number, column + 1), Excerpt { line: visible, skip: column - cut, mark })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_characters_and_marks_stay_in_the_line() {
        let text = "a = 1\n\tβ = \"x\ny\"\n";
        let at = text.find('"').unwrap();
        let fault = Fault::new(Origin::File { start: at, end: text.len() }, "wrong");
        let error = fault.locate(Path::new("s.toml"), text, &[]);
        assert_eq!(error.to_string(), "s.toml:2:6: wrong");
        assert_eq!(error.report(), "s.toml:2:6: wrong\n  |\n2 |  β = \"x\n  |      ^^");
    }

    #[test]
    fn long_lines_are_cut_around_the_mark() {
        let text = format!("{}x", "é".repeat(1000));
        let end = text.len();
        let report =
            Fault::new(Origin::File { start: end - 1, end }, "here").locate(Path::new("s"), &text, &[]).report();
        let lines: Vec<_> = report.lines().collect();
        assert_eq!(lines[0], "s:1:1001: here");
        let column = |line: &str, c: char| line.chars().position(|d| d == c).unwrap();
        assert_eq!(column(lines[2], 'x'), column(lines[3], '^'));
        assert!(lines[2].chars().count() < 120);
        // Any span gives some place.
        for (start, end) in [(5000, 1), (1, 1), (0, usize::MAX)] {
            Fault::new(Origin::File { start, end }, "").locate(Path::new("s"), &text, &[]).report();
        }
    }
}
