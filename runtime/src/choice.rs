//! Choosing a device at run time.

use crate::device::{Device, DeviceInfo, DeviceKind, Provider, Unavailable};
use crate::providers;

/// No device answers to a choice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoDevice {
    /// What was asked for.
    pub choice: String,
    /// Why, and what there is.
    pub reason: String,
}

impl std::fmt::Display for NoDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "no device \"{}\": {}", self.choice, self.reason)
    }
}

impl std::error::Error for NoDevice {}

/// A device that was chosen and opened.
pub struct Chosen {
    /// The device.
    pub device: Box<dyn Device>,
    /// A line for each device that `auto` would have preferred, but that could not be opened: which one, and why.
    pub passed_over: Vec<String>,
}

impl std::fmt::Debug for Chosen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let id = self.device.info().id();
        f.debug_struct("Chosen").field("device", &id).field("passed_over", &self.passed_over).finish()
    }
}

/// Opens a device: `auto`, a backend (`cpu`), an index (`cpu:0`) or part of a device's name.
///
/// `auto` takes a hardware GPU where there is one, one of its own before one that shares the processor's memory, and
/// else the processor's cores. Where one that it prefers cannot be opened it takes the next; [`choose`] tells of that.
/// What imitates another interface on the processor (a software GPU, an OpenCL platform like PoCL), and anything else
/// that is neither, is taken only when its backend or name is given. Of a backend that is named, the best device is
/// taken by the same order.
///
/// # Errors
/// No device answers to the choice, or it cannot be opened; the text lists what there is.
pub fn open(choice: &str) -> Result<Box<dyn Device>, NoDevice> {
    open_among(&providers(), choice)
}

/// [`open`] among backends of one's own choosing.
///
/// # Errors
/// As [`open`].
pub fn open_among(providers: &[Provider], choice: &str) -> Result<Box<dyn Device>, NoDevice> {
    choose_among(providers, choice).map(|chosen| chosen.device)
}

/// As [`open`], and tells which devices were passed over.
///
/// # Errors
/// As [`open`].
pub fn choose(choice: &str) -> Result<Chosen, NoDevice> {
    choose_among(&providers(), choice)
}

/// [`choose`] among backends of one's own choosing.
///
/// # Errors
/// As [`open`].
pub fn choose_among(providers: &[Provider], choice: &str) -> Result<Chosen, NoDevice> {
    let fail = |reason: String| NoDevice { choice: choice.to_owned(), reason };
    let wanted = choice.trim().to_lowercase();
    // A choice that names its backend asks no other: opening the processor loads no graphics library.
    let names = |p: &Provider| wanted.strip_prefix(p.name).is_some_and(|rest| rest.is_empty() || rest.starts_with(':'));
    let named = providers.iter().any(names);
    let listed: Vec<(&Provider, Result<Vec<DeviceInfo>, Unavailable>)> =
        providers.iter().filter(|p| !named || names(p)).map(|p| (p, (p.enumerate)())).collect();
    if let (true, Some((_, Err(reason)))) = (named, listed.first()) {
        return Err(fail(reason.to_string()));
    }
    let all = || listed.iter().flat_map(|(p, found)| found.iter().flatten().map(move |info| (*p, info)));
    let mut candidates: Vec<_> = if wanted == "auto" {
        all().filter(|(_, info)| automatic(info.kind)).collect()
    } else if named && !wanted.contains(':') {
        all().collect()
    } else {
        let by_id = all().find(|(_, info)| info.id() == wanted);
        let by_name = || all().find(|(_, info)| !wanted.is_empty() && info.name.to_lowercase().contains(&wanted));
        by_id.or_else(by_name).into_iter().collect()
    };
    // Among equals the order of the backends and of their devices stays.
    candidates.sort_by_key(|(_, info)| (info.unusable.is_some(), rank(info.kind)));
    if wanted != "auto" {
        candidates.truncate(1);
    }
    let mut passed_over = Vec::new();
    for (provider, info) in candidates {
        match (provider.open)(info.index) {
            Ok(device) => return Ok(Chosen { device, passed_over }),
            Err(reason) if wanted == "auto" => passed_over.push(format!("{} is passed over: {reason}", info.id())),
            Err(reason) => return Err(fail(reason.to_string())),
        }
    }
    let there: Vec<_> = all().map(|(_, info)| format!("{} ({})", info.id(), info.name)).collect();
    let none = listed.iter().filter_map(|(p, found)| Some(format!("{} has none: {}", p.name, found.as_ref().err()?)));
    let there = (!there.is_empty()).then(|| format!("there are {}", there.join(", ")));
    let reasons: Vec<_> = passed_over.into_iter().chain(there).chain(none).collect();
    Err(fail(reasons.join("; ")))
}

/// Whether a device is taken without being named.
fn automatic(kind: DeviceKind) -> bool {
    match kind {
        DeviceKind::DiscreteGpu | DeviceKind::IntegratedGpu | DeviceKind::Cpu => true,
        DeviceKind::SoftwareGpu | DeviceKind::Other => false,
    }
}

/// The best kind has the lowest.
fn rank(kind: DeviceKind) -> u8 {
    match kind {
        DeviceKind::DiscreteGpu => 0,
        DeviceKind::IntegratedGpu => 1,
        DeviceKind::Cpu => 2,
        DeviceKind::Other => 3,
        DeviceKind::SoftwareGpu => 4,
    }
}

#[cfg(test)]
mod tests;
