//! `airlight devices`

use airlight::device::{Bytes, DeviceInfo};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::{Done, output};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Print JSON (see docs/json.md).
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> Done {
    let backends = airlight::devices();
    if options.json {
        let list: Vec<Value> = backends
            .iter()
            .map(|backend| match &backend.devices {
                Ok(devices) => {
                    json!({ "backend": backend.name, "devices": devices.iter().map(device).collect::<Vec<_>>() })
                }
                Err(reason) => json!({ "backend": backend.name, "devices": [], "reason": reason.to_string() }),
            })
            .collect();
        return output::json(&json!({ "version": env!("CARGO_PKG_VERSION"), "backends": list }));
    }
    for backend in &backends {
        match &backend.devices {
            Ok(devices) if devices.is_empty() => output::line(&format!("{}: no devices", backend.name))?,
            Ok(devices) => devices.iter().try_for_each(|info| output::line(&text(info)))?,
            Err(reason) => output::line(&format!("{}: none: {reason}", backend.name))?,
        }
    }
    Ok(())
}

fn text(info: &DeviceInfo) -> String {
    let memory = info.memory_bytes.map_or("unknown".into(), |n| Bytes(n).to_string());
    let limits = &info.limits;
    let mut bounds = format!("buffers to {}", Bytes(limits.buffer_bytes));
    if limits.binding_bytes < limits.buffer_bytes {
        bounds += &format!(", {} of them at a time", Bytes(limits.binding_bytes));
    }
    bounds += &format!(", fields to {} a side", limits.field_side);
    if let Some(turns) = limits.loop_turns {
        bounds += &format!(", loops to {turns} turns");
    }
    format!(
        "{:<10} {}\n           {}, memory {memory}, {bounds}\n           {}",
        info.id(),
        info.name,
        info.kind.as_str(),
        info.features.join(", "),
    ) + &info.unusable.as_ref().map(|reason| format!("\n           cannot be opened: {reason}")).unwrap_or_default()
}

/// A device as JSON.
pub(crate) fn device(info: &DeviceInfo) -> Value {
    json!({
        "id": info.id(),
        "name": info.name,
        "kind": info.kind.as_str(),
        "memory_bytes": info.memory_bytes,
        "limits": {
            "buffer_bytes": info.limits.buffer_bytes,
            "binding_bytes": info.limits.binding_bytes,
            "field_side": info.limits.field_side,
            "loop_turns": info.limits.loop_turns,
        },
        "features": info.features,
        "filter_bits": info.filter_bits,
        "contracts": info.contracts,
        "unusable": info.unusable,
    })
}

/// The devices that were asked for, or all. Backends without one are said and listed in `absent`.
pub(crate) fn subjects(choices: &[String], absent: &mut Vec<Value>) -> Result<Vec<DeviceInfo>, Failure> {
    let mut subjects: Vec<DeviceInfo> = Vec::new();
    for choice in choices {
        let airlight::Chosen { device, passed_over } = airlight::choose(choice)?;
        passed_over.iter().for_each(|line| output::remark(&format!("warning: {line}")));
        // Two choices may mean the same device.
        if subjects.iter().all(|info| info.id() != device.info().id()) {
            subjects.push(device.info().clone());
        }
    }
    if choices.is_empty() {
        for backend in airlight::devices() {
            match backend.devices {
                Ok(devices) => {
                    for info in devices {
                        if let Some(reason) = &info.unusable {
                            output::remark(&format!("{} cannot be opened: {reason}", info.id()));
                            absent.push(json!({ "backend": backend.name, "device": info.id(), "reason": reason }));
                        } else {
                            subjects.push(info);
                        }
                    }
                }
                Err(reason) => {
                    output::remark(&format!("{} has no device: {reason}", backend.name));
                    absent.push(json!({ "backend": backend.name, "device": null, "reason": reason.to_string() }));
                }
            }
        }
        // The processor, which every machine has, is what the others are compared with.
        subjects.sort_by_key(|info| info.backend != "cpu");
    }
    Ok(subjects)
}
