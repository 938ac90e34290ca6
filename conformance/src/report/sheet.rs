//! Pictures beside their truth: one self-contained HTML file.

use std::io::Write;
use std::path::Path;

use airlight_formats::FormatError;
use airlight_formats::output::write_atomically;
use maud::{Markup, html};

use super::page::{difference, document, expected, head, image};
use super::picture::Shown;
use crate::record::{Picture, Place};

/// A table of ways to a picture, the picture as it should be, and what each way makes of it.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// What it is about.
    pub title: String,
    /// Paragraphs below the title.
    pub about: Vec<String>,
    /// Columns of the table.
    pub columns: Vec<&'static str>,
    /// Columns and rows of the pictures.
    pub size: [u32; 2],
    /// The truth in linear RGB, rows from the top.
    pub truth: Vec<[f32; 3]>,
    /// The ways, a row of the table each.
    pub entries: Vec<SheetEntry>,
}

/// A way to a picture.
#[derive(Clone, Debug)]
pub struct SheetEntry {
    /// What stands over its picture.
    pub name: String,
    /// A text for each column.
    pub cells: Vec<String>,
    /// Linear RGB, rows from the top; none where there is no picture.
    pub found: Option<Vec<[f32; 3]>>,
}

/// Writes a sheet.
///
/// # Errors
/// A file that cannot be written.
pub fn write_sheet(path: &Path, sheet: &Sheet) -> Result<(), FormatError> {
    let page = document(&sheet.title, &body(sheet)).into_string();
    write_atomically(path, |file| file.write_all(page.as_bytes()).map_err(FormatError::io(path)))
}

fn body(sheet: &Sheet) -> Markup {
    let picture = |name: &str, found: &[[f32; 3]]| Picture {
        name: name.to_owned(),
        at: Place::new(),
        size: sheet.size,
        found: found.to_vec(),
        expected: sheet.truth.clone(),
    };
    let truth = picture("truth", &sheet.truth);
    html! {
        @for text in &sheet.about { p { (text) } }
        div.scroll { table {
            (head(&sheet.columns))
            tbody { @for entry in &sheet.entries { tr { @for cell in &entry.cells { td { (cell) } } } } }
        } }
        h2 { "Truth" }
        div.pictures { (expected(&truth, &Shown::new(&truth))) }
        h2 { "Pictures" }
        @for entry in &sheet.entries {
            @if let Some(found) = &entry.found {
                section {
                    h3 { (entry.name) }
                    (beside(&picture(&entry.name, found)))
                }
            }
        }
    }
}

fn beside(picture: &Picture) -> Markup {
    let shown = Shown::new(picture);
    html! {
        div.pictures {
            figure { (image(picture, &shown.found, "found")) }
            (difference(picture, &shown))
        }
    }
}
