//! `airlight conformance`

use std::path::PathBuf;

use airlight_conformance::{Case, Failed, Labels, Outcome, Sidecar, Subject, cases, listed, try_all, write_report};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::{Done, output};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// A device to try: a backend (cpu), an index (cpu:0) or part of a device's name. May repeat. Without it, every
    /// device that can be opened.
    #[arg(long, value_name = "ID")]
    device: Vec<String>,
    /// Only cases whose name, device::group::case, holds this text.
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// A device that must be there; others that cannot be had are skipped. May repeat. The environment variable
    /// AIRLIGHT_REQUIRE lists more, separated by commas.
    #[arg(long, value_name = "ID")]
    require: Vec<String>,
    /// Write results into this folder, and a report of all results there into its index.html.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Show the pictures of cases whose name holds this text in the report, not only those of failed cases. May repeat.
    #[arg(long, value_name = "TEXT", requires = "report")]
    pictures: Vec<String>,
    /// Try nothing; only make the report of the results that are in its folder.
    #[arg(long, requires = "report", conflicts_with_all = ["device", "filter", "require", "list", "json"])]
    no_run: bool,
    /// List the cases instead of trying them.
    #[arg(long, conflicts_with_all = ["report"])]
    list: bool,
    /// Print JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> Done {
    if let Some(folder) = &options.report {
        if folder.exists() && !folder.is_dir() {
            return Err(Failure::input(format!("{}: is not a folder", folder.display())));
        }
        if options.no_run {
            if !folder.is_dir() {
                return Err(Failure::input(format!("{}: the folder does not exist", folder.display())));
            }
            return report(options);
        }
        let failed = |e| Failure::running(format!("{}: {e}", folder.display()));
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let work = work(options)?;
    if options.list {
        return list(options, &work);
    }
    let all = try_all(&work, |result| told(options, result))?;
    report(options)?;
    let (total, failed) = (all.len(), all.iter().filter(|r| r.outcome.failed()).count());
    let passed = all.iter().filter(|r| r.outcome.passed()).count();
    if options.json {
        output::json(&summary(all)?)?;
    } else {
        output::line(&format!("{passed} passed, {failed} failed, {} skipped", total - passed - failed))?;
    }
    match failed {
        0 => Ok(()),
        _ => Err(Failure::short(format!("{failed} of {total} cases failed"))),
    }
}

/// Every case on every device that is asked for.
fn work(options: &Options) -> Result<Vec<(Subject, Case)>, Failure> {
    let subjects = subjects(options)?;
    let mut work = Vec::new();
    // Of some devices kernels are compiled one at a time: a case goes round all devices, which leaves no core idle.
    for case in cases() {
        work.extend(subjects.iter().map(|subject| (subject.clone(), case.clone())));
    }
    if let Some(text) = &options.filter {
        work.retain(|(subject, case)| name(subject, case).contains(text));
        if work.is_empty() {
            let devices = subjects.iter().map(Subject::name).collect::<Vec<_>>().join(", ");
            let what = format!("no case holds \"{text}\" in its name; --list lists those of {devices}");
            return Err(Failure::input(what));
        }
    }
    Ok(work)
}

fn name(subject: &Subject, case: &Case) -> String {
    format!("{}::{}", subject.name(), case.name())
}

/// The devices, each once and under its id.
fn subjects(options: &Options) -> Result<Vec<Subject>, Failure> {
    let mut found: Vec<Subject> = Vec::new();
    let mut add = |choice: &str| -> Result<(), Failed> {
        let id = Subject::of_choice(choice).info()?.id();
        if found.iter().all(|subject| subject.name() != id) {
            found.push(Subject::of_choice(&id));
        }
        Ok(())
    };
    let why = |failed: Failed| failed.message().unwrap_or("no reason given").to_owned();
    let skipped = |what: &str, reason: &str| output::remark(&format!("skipped: {what}: {reason}"));
    for choice in options.require.iter().cloned().chain(listed("AIRLIGHT_REQUIRE")) {
        add(&choice).map_err(|reason| Failure::input(format!("a required device is not there: {}", why(reason))))?;
    }
    for choice in &options.device {
        let Err(reason) = add(choice) else { continue };
        let names = |backend: &str| choice.split(':').next().is_some_and(|b| b.eq_ignore_ascii_case(backend));
        // A backend without its loader, driver or devices is an absent device; all else is a wrong name.
        let none = |backend: &airlight::Backend| backend.devices.as_ref().map_or(true, Vec::is_empty);
        if !airlight::devices().iter().any(|backend| names(backend.name) && none(backend)) {
            return Err(Failure::input(why(reason)));
        }
        skipped(choice, &why(reason));
    }
    if options.device.is_empty() {
        for backend in airlight::devices() {
            match backend.devices {
                Err(reason) => skipped(backend.name, &reason.to_string()),
                Ok(devices) if devices.is_empty() => skipped(backend.name, "no devices"),
                Ok(devices) => devices.iter().for_each(|info| {
                    add(&info.id()).unwrap_or_else(|reason| skipped(&info.id(), &why(reason)));
                }),
            }
        }
    }
    if found.is_empty() {
        return Err(Failure::input("there is no device to try"));
    }
    Ok(found)
}

fn list(options: &Options, work: &[(Subject, Case)]) -> Done {
    if options.json {
        let list: Vec<Value> = work.iter().map(|(subject, case)| described(subject, case)).collect();
        return output::json(&json!({ "version": env!("CARGO_PKG_VERSION"), "cases": list }));
    }
    work.iter().try_for_each(|(subject, case)| output::line(&format!("{}: {}", name(subject, case), case.checks())))
}

fn described(subject: &Subject, case: &Case) -> Value {
    let axes = |axes: &[Labels]| -> Vec<Value> {
        axes.iter().map(|a| json!({ "axis": a.axis, "values": a.values })).collect()
    };
    let parameters: serde_json::Map<_, _> =
        case.parameters().iter().map(|(axis, choice)| ((*axis).to_owned(), choice.as_str().into())).collect();
    let tolerance = case.tolerance();
    json!({
        "device": subject.name(),
        "case": case.name(),
        "checks": case.checks(),
        "parameters": parameters,
        "permutations": axes(case.permutations()),
        "variants": axes(case.variants()),
        "needs": case.needed().iter().map(ToString::to_string).collect::<Vec<_>>(),
        "tolerance": {
            "name": tolerance.name,
            "relative_l2": output::number(tolerance.relative_l2),
            "peak": output::number(tolerance.peak),
            "reason": tolerance.reason,
        },
    })
}

/// Says how a case ended, and writes its result.
fn told(options: &Options, result: &Sidecar) -> Done {
    if let Some(folder) = &options.report {
        result.write(folder).map_err(Failure::output)?;
    }
    let name = format!("{}::{}", result.device.id, result.case);
    if let Outcome::Skipped(reason) = &result.outcome {
        output::remark(&format!("skipped: {name}: {reason}"));
    }
    if options.json {
        return Ok(());
    }
    output::line(&format!("{:<7} {name} ({:.2} s)", result.outcome.word(), result.seconds))?;
    match &result.outcome {
        Outcome::Failed(reason) => output::line(&format!("        {}", reason.replace('\n', "\n        "))),
        Outcome::Passed | Outcome::Skipped(_) => Ok(()),
    }
}

fn report(options: &Options) -> Done {
    let Some(folder) = &options.report else { return Ok(()) };
    let reported = write_report(folder, &options.pictures).map_err(Failure::output)?;
    reported.damaged.iter().for_each(|what| output::remark(&format!("warning: {what}")));
    if options.json {
        return Ok(());
    }
    output::line(&format!("{} ({} results)", reported.path.display(), reported.results))
}

/// Numbers, and the results as their files have them, but without pictures.
fn summary(all: Vec<Sidecar>) -> Result<Value, Failure> {
    let count = |word: &str| all.iter().filter(|r| r.outcome.word() == word).count();
    let [passed, failed, skipped] = ["passed", "failed", "skipped"].map(count);
    let results: Result<Vec<_>, _> =
        all.into_iter().map(|r| serde_json::to_value(Sidecar { pictures: Vec::new(), ..r })).collect();
    let results = results.map_err(|e| Failure::running(format!("the results cannot be written as JSON: {e}")))?;
    let version = env!("CARGO_PKG_VERSION");
    Ok(json!({ "version": version, "passed": passed, "failed": failed, "skipped": skipped, "results": results }))
}
