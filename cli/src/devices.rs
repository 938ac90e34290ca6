//! `airlight devices`

use airlight::device::{Bytes, DeviceInfo};
use serde_json::{Value, json};

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
    format!(
        "{:<10} {}\n           {}, memory {memory}, largest buffer {}, longest field side {}\n           {}",
        info.id(),
        info.name,
        info.kind.as_str(),
        Bytes(info.limits.buffer_bytes),
        info.limits.field_side,
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
        },
        "features": info.features,
        "filter_bits": info.filter_bits,
        "unusable": info.unusable,
    })
}
