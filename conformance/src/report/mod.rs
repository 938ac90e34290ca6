//! A report of a folder of results: one self-contained HTML file.

mod page;
mod picture;
mod sheet;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use airlight_formats::FormatError;
use airlight_formats::output::write_atomically;

pub use sheet::{Sheet, SheetEntry, write_sheet};

use crate::case::group_of;
use crate::sidecar::{DeviceRecord, Sidecar};

/// What a report was made of.
#[derive(Clone, Debug)]
pub struct Reported {
    /// The report.
    pub path: PathBuf,
    /// Results in it, of every device and case the latest.
    pub results: usize,
    /// Files that could not be read as results, in words.
    pub damaged: Vec<String>,
}

/// Results by device and case.
#[derive(Default)]
struct Results {
    devices: Vec<DeviceRecord>,
    /// Case, and device by its place in `devices`.
    cases: BTreeMap<String, BTreeMap<usize, Sidecar>>,
    damaged: Vec<String>,
}

/// Makes `results/index.html` of all results in the folder `results` and in the folders there, whatever machine they
/// were copied from. Pictures are shown of failed cases and of those whose name, `device::group::case`, holds one of
/// `pictures`.
///
/// A damaged result is named in the report and does not end it.
///
/// # Errors
/// A folder that cannot be read; a report that cannot be written.
pub fn write_report(results: &Path, pictures: &[String]) -> Result<Reported, FormatError> {
    let all = Results::gather(results, pictures)?;
    let path = results.join("index.html");
    let page = page::page(&all, pictures).into_string();
    write_atomically(&path, |file| file.write_all(page.as_bytes()).map_err(FormatError::io(&path)))?;
    let count = all.cases.values().map(BTreeMap::len).sum();
    Ok(Reported { path, results: count, damaged: all.damaged })
}

/// The entries of a folder in the order of their names.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, FormatError> {
    let entries = std::fs::read_dir(folder).map_err(FormatError::io(folder))?;
    let paths: Result<Vec<_>, _> = entries.map(|entry| entry.map(|e| e.path())).collect();
    let mut paths = paths.map_err(FormatError::io(folder))?;
    paths.sort();
    Ok(paths)
}

impl Results {
    fn gather(folder: &Path, pictures: &[String]) -> Result<Self, FormatError> {
        let mut all = Self::default();
        for path in entries(folder)? {
            if path.is_dir() {
                for path in entries(&path)? {
                    all.take(&path, pictures);
                }
            } else {
                all.take(&path, pictures);
            }
        }
        Ok(all)
    }

    fn take(&mut self, path: &Path, pictures: &[String]) {
        if path.extension().is_none_or(|e| e != "json") {
            return;
        }
        let mut result = match Sidecar::read(path) {
            Ok(result) => result,
            Err(error) => return self.damaged.push(error.to_string()),
        };
        if !shows(&result, pictures) {
            result.pictures.clear();
        }
        let known = self.devices.iter().position(|d| d.folder() == result.device.folder());
        let device = known.unwrap_or_else(|| {
            self.devices.push(result.device.clone());
            self.devices.len() - 1
        });
        let of_case = self.cases.entry(result.case.clone()).or_default();
        if of_case.get(&device).is_none_or(|earlier| earlier.unix_time <= result.unix_time) {
            of_case.insert(device, result);
        }
    }

    /// Every result of a device.
    fn of(&self, device: usize) -> impl Iterator<Item = &Sidecar> {
        self.cases.values().filter_map(move |of_case| of_case.get(&device))
    }

    fn groups(&self) -> Vec<&str> {
        let mut groups: Vec<_> = self.cases.keys().map(|case| group_of(case)).collect();
        groups.dedup();
        groups
    }
}

/// Whether a report shows a result's pictures and values.
fn shows(result: &Sidecar, pictures: &[String]) -> bool {
    let name = format!("{}::{}", result.device.id, result.case);
    result.outcome.failed() || pictures.iter().any(|pattern| name.contains(pattern))
}
