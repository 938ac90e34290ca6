//! The page. Everything is text to [`html!`], which escapes it.

use airlight::device::Bytes;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::picture::Shown;
use super::{Results, shows};
use crate::case::group_of;
use crate::record::{Mismatches, Picture, Place, Score, short};
use crate::sidecar::{AxisRecord, DeviceRecord, Outcome, Sidecar, ToleranceRecord};

/// Pictures are enlarged by whole numbers to about so many pixels.
const WIDTH: u32 = 320;

pub(super) fn page(all: &Results, pictures: &[String]) -> Markup {
    let results = || all.cases.values().flat_map(|of_case| of_case.values());
    let failed: Vec<_> = results().filter(|r| r.outcome.failed()).collect();
    let chosen: Vec<_> = results().filter(|r| !r.outcome.failed() && shows(r, pictures)).collect();
    let body = html! {
        p { (counts(results())) " on " (number(all.devices.len(), "device", "devices")) ". " (versions(all)) }
        @if !all.damaged.is_empty() {
            h2 { "Files that could not be read" }
            ul { @for what in &all.damaged { li.failed { (what) } } }
        }
        h2 { "Devices" }
        (devices(all))
        h2 { "By group" }
        (groups(all))
        @if !failed.is_empty() {
            h2 { "Failed" }
            @for result in &failed { (detail(all, result)) }
        }
        @if !chosen.is_empty() {
            h2 { "Chosen" }
            @for result in &chosen { (detail(all, result)) }
        }
        h2 { "All cases" }
        p.dim { "Per cent are the largest share that a score takes of what it may be." }
        (cases(all, pictures))
        h2 { "Tolerances" }
        (tolerances(all))
    };
    document("airlight conformance", &body)
}

/// A page with its style in it.
pub(super) fn document(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                h1 { (title) }
                (body)
            }
        }
    }
}

/// The first row of a table.
pub(super) fn head(columns: &[&str]) -> Markup {
    html! { thead { tr { @for column in columns { th { (column) } } } } }
}

/// A device over its column.
fn over(device: &DeviceRecord) -> Markup {
    html! { th { span.name { (device.id) } br; span.dim { (device.name) } } }
}

fn number(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// Passed, failed and skipped.
fn tally<'a>(results: impl Iterator<Item = &'a Sidecar>) -> [usize; 3] {
    results.fold([0; 3], |mut n, result| {
        n[match result.outcome {
            Outcome::Passed => 0,
            Outcome::Failed(_) => 1,
            Outcome::Skipped(_) => 2,
        }] += 1;
        n
    })
}

fn counts<'a>(results: impl Iterator<Item = &'a Sidecar>) -> Markup {
    let [passed, failed, skipped] = tally(results);
    html! {
        span.passed { (passed) " passed" }
        @if failed > 0 { ", " span.failed { (failed) " failed" } }
        @if skipped > 0 { ", " span.skipped { (skipped) " skipped" } }
    }
}

fn versions(all: &Results) -> String {
    let mut versions: Vec<_> =
        all.cases.values().flat_map(|of_case| of_case.values().map(|r| &r.airlight_version[..])).collect();
    versions.sort_unstable();
    versions.dedup();
    format!("airlight {}.", versions.join(", "))
}

fn devices(all: &Results) -> Markup {
    html! {
        div.scroll { table {
            (head(&["device", "name", "kind", "features", "limits", "result", "seconds"]))
            tbody { @for (i, device) in all.devices.iter().enumerate() { tr {
                td.name { (device.id) }
                td { (device.name) }
                td { (device.kind) }
                td { (device.features.join(", ")) }
                td.dim {
                    "buffers " (Bytes(device.limits.buffer_bytes)) ", bindings " (Bytes(device.limits.binding_bytes)) ", fields "
                    (device.limits.field_side) " a side, filter " (device.filter_bits) " bits"
                }
                td { (counts(all.of(i))) }
                td.number { (format!("{:.1}", all.of(i).map(|r| r.seconds).sum::<f64>())) }
            } } }
        } }
    }
}

fn groups(all: &Results) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th { "group" } @for device in &all.devices { (over(device)) } } }
            tbody { @for group in all.groups() { tr {
                td.name { (group) }
                @for i in 0..all.devices.len() {
                    td { (counts(all.of(i).filter(|r| group_of(&r.case) == group))) }
                }
            } } }
        } }
    }
}

/// The place in the page where a result is shown in detail.
fn anchor(all: &Results, result: &Sidecar) -> String {
    let device = all.devices.iter().position(|d| d.folder() == result.device.folder());
    format!("{}-{}", device.unwrap_or_default(), result.case)
}

fn cases(all: &Results, pictures: &[String]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th { "case" } @for device in &all.devices { (over(device)) } th { "checks" } } }
            tbody { @for (case, of_case) in &all.cases { tr {
                td.name { (case) }
                @for i in 0..all.devices.len() {
                    td { @if let Some(result) = of_case.get(&i) {
                        @if shows(result, pictures) {
                            a href={ "#" (anchor(all, result)) } { (outcome(result)) }
                        } @else {
                            (outcome(result))
                        }
                    } }
                }
                td.dim { (of_case.values().next().map_or("", |r| &r.checks)) }
            } } }
        } }
    }
}

fn outcome(result: &Sidecar) -> Markup {
    let used = result.scores.iter().filter(|s| s.threshold > 0.0).map(|s| s.value / s.threshold).fold(0.0, f64::max);
    html! {
        span class=(result.outcome.word()) title=[result.outcome.reason()] { (result.outcome.word()) }
        @if used > 0.0 && used.is_finite() { " " span.dim { (format!("{:.0} %", 100.0 * used)) } }
    }
}

fn place(at: &Place) -> String {
    at.iter().map(|(axis, choice)| format!("{axis} {choice}")).collect::<Vec<_>>().join(", ")
}

fn detail(all: &Results, result: &Sidecar) -> Markup {
    let axes = |axes: &[AxisRecord]| {
        axes.iter().map(|a| format!("{}: {}", a.axis, a.values.join(", "))).collect::<Vec<_>>().join("; ")
    };
    html! {
        section id=(anchor(all, result)) {
            h3 {
                span.name { (result.device.id) "::" (result.case) } " "
                span class=(result.outcome.word()) { (result.outcome.word()) }
            }
            p { (result.checks) }
            p.dim {
                "On " (result.device.name) ", " (format!("{:.2}", result.seconds)) " s."
                @if !result.parameters.is_empty() { " At " (place(&result.parameters)) "." }
                @if !result.permutations.is_empty() { " Permutations: " (axes(&result.permutations)) "." }
                @if !result.variants.is_empty() { " Variants: " (axes(&result.variants)) "." }
            }
            @if let Some(reason) = result.outcome.reason() { p.reason { (reason) } }
            @for picture in &result.pictures { (shown(picture)) }
            @for set in &result.mismatches { (mismatches(set)) }
            (scores(&result.scores))
        }
    }
}

fn mismatches(set: &Mismatches) -> Markup {
    html! {
        p { "First values of " (set.name) " that differ" @if !set.at.is_empty() { " (" (place(&set.at)) ")" } }
        table {
            (head(&["index", "found", "expected", "difference"]))
            tbody { @for m in &set.values { tr {
                td.number { (m.index) }
                td.number { (short(m.found)) }
                td.number { (short(m.expected)) }
                td.number { (format!("{:.3e}", m.found - m.expected)) }
            } } }
        }
    }
}

/// Scores above their thresholds, and the others behind a lid.
fn scores(scores: &[Score]) -> Markup {
    let (wrong, right): (Vec<_>, Vec<_>) = scores.iter().partition(|s| !s.holds());
    let table = |scores: &[&Score]| {
        html! {
            div.scroll { table {
                (head(&["what", "where", "measure", "value", "at most", "tolerance"]))
                tbody { @for s in scores { tr {
                    td { (s.name) }
                    td { (place(&s.at)) }
                    td { (s.measure) }
                    td.number {
                        span class=(if s.holds() { "passed" } else { "failed" }) { (format!("{:.3e}", s.value)) }
                    }
                    td.number { (format!("{:.3e}", s.threshold)) }
                    td.name { @if let Some(name) = &s.tolerance { a href={ "#tolerance-" (name) } { (name) } } }
                } } }
            } }
        }
    };
    html! {
        @if !wrong.is_empty() { (table(&wrong)) }
        @if !right.is_empty() {
            details {
                summary { (number(right.len(), "score that holds", "scores that hold")) }
                (table(&right))
            }
        }
    }
}

fn shown(picture: &Picture) -> Markup {
    let shown = Shown::new(picture);
    let [width, height] = picture.size;
    html! {
        p {
            (picture.name)
            @if !picture.at.is_empty() { " (" (place(&picture.at)) ")" }
            span.dim { ", " (width) " × " (height) " pixels" }
        }
        div.pictures {
            figure { (image(picture, &shown.found, "found")) figcaption { "found" } }
            (expected(picture, &shown))
            (difference(picture, &shown))
        }
    }
}

/// A picture by its address, enlarged.
pub(super) fn image(picture: &Picture, address: &str, what: &str) -> Markup {
    let [width, height] = picture.size;
    let times = (WIDTH / width.max(1)).max(1);
    let alt = format!("{}, {what}", picture.name);
    html! { img src=(address) alt=(alt) width=(width.saturating_mul(times)) height=(height.saturating_mul(times)); }
}

/// The truth, and how both are shown.
pub(super) fn expected(picture: &Picture, shown: &Shown) -> Markup {
    html! {
        figure { (image(picture, &shown.expected, "expected")) figcaption {
            "expected; tone mapping of both: times " (format!("{:.3e}", shown.exposure)) ", clipped at 1, encoded as sRGB; \
            a hundredth of the expected values is brighter than white. What is no number is magenta."
        } }
    }
}

/// The difference, with its scale.
pub(super) fn difference(picture: &Picture, shown: &Shown) -> Markup {
    html! {
        figure {
            (image(picture, &shown.difference, "difference"))
            div.scale { "0" div.ramp {} (format!("{:.3e}", shown.scale)) }
            figcaption {
                "largest difference of a channel; white is " (format!("{:.3} %", 100.0 * shown.share)) " of the largest \
                expected value"
            }
        }
    }
}

fn tolerances(all: &Results) -> Markup {
    let mut used: Vec<&ToleranceRecord> = Vec::new();
    for tolerance in all.cases.values().flat_map(|of_case| of_case.values()).flat_map(|r| &r.tolerances) {
        // The plainest of those that were widened for a device.
        match used.iter_mut().find(|t| t.name == tolerance.name) {
            Some(known) if known.relative_l2 > tolerance.relative_l2 => *known = tolerance,
            Some(_) => (),
            None => used.push(tolerance),
        }
    }
    used.sort_by(|a, b| a.name.cmp(&b.name));
    html! {
        div.scroll { table {
            (head(&["name", "relative L2", "largest error", "why"]))
            tbody { @for t in used { tr id={ "tolerance-" (t.name) } {
                td.name { (t.name) }
                td.number { (format!("{:.1e}", t.relative_l2)) }
                td.number { @if t.peak.is_finite() { (format!("{:.1e}", t.peak)) } @else { "any" } }
                td { (t.reason) }
            } } }
        } }
    }
}
