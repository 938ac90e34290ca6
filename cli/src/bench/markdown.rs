//! Pages of the benchmarks: Markdown on the terminal.

use std::time::Duration;

use airlight::device::DeviceInfo;

use crate::{Done, output};

/// Prints what a page is of: its title, the option that made it, what its times are, what of the page has how much
/// time, and the devices.
pub(super) fn head(
    title: &str,
    option: &str,
    times: &str,
    (what, limit): (&str, Duration),
    subjects: &[DeviceInfo],
) -> Done {
    output::line(&format!("# {title}\n"))?;
    output::line(&format!(
        "By `airlight bench {option}`, version {}: {times}, in at most {} s {what}.\n",
        env!("CARGO_PKG_VERSION"),
        limit.as_secs_f64()
    ))?;
    subjects.iter().try_for_each(|info| output::line(&format!("- `{}`: {}", info.id(), info.name)))
}

/// The number of a note, which stands once.
pub(super) fn note(why: &str, notes: &mut Vec<String>) -> usize {
    let place = notes.iter().position(|note| note == why).unwrap_or_else(|| {
        notes.push(why.to_owned());
        notes.len() - 1
    });
    place + 1
}

/// The notes below a table; nothing where there are none.
pub(super) fn notes(notes: &[String]) -> Vec<String> {
    if notes.is_empty() {
        return Vec::new();
    }
    let numbered = notes.iter().zip(1..).map(|(note, number)| format!("{number}. {note}"));
    [String::new()].into_iter().chain(numbered).collect()
}

/// A Markdown table whose first row is its head, with columns of one width each.
pub(super) fn aligned(rows: &[Vec<String>]) -> Vec<String> {
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
    fn columns_have_one_width() {
        let row = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        let lines = aligned(&[row(["static", "a"]), row(["–", "bcde"])]);
        assert_eq!(lines, ["| static | a    |", "| ------ | ---- |", "| –      | bcde |"]);
    }

    #[test]
    fn notes_stand_below_an_empty_line_where_there_are_some() {
        assert!(notes(&[]).is_empty());
        let mut all = Vec::new();
        assert_eq!([note("a", &mut all), note("b", &mut all), note("a", &mut all)], [1, 2, 1]);
        assert_eq!(notes(&all), ["", "1. a", "2. b"]);
    }
}
