//! Finding and opening devices.

use std::sync::{Mutex, PoisonError};

use airlight_core::device::{DeviceInfo, DeviceKind, Limits, Unavailable};
use ocl::core::{self, DeviceId, DeviceInfo as Query, DeviceType, PlatformId, PlatformInfo};

use crate::OpenclDevice;
use crate::cl::{Cl, Fault};
use crate::source::Lanes;
use crate::store::ROOM;

/// Held while devices are looked for and opened: drivers that set themselves up on their first use do not all expect
/// two threads at once (PoCL 3.1 does not).
static FIRST_USE: Mutex<()> = Mutex::new(());

/// Division and square root can be correctly rounded where a build asks for it (`CL_DEVICE_SINGLE_FP_CONFIG`).
const CORRECTLY_ROUNDED: u64 = 1 << 7;
/// OpenCL C 1.2, and nothing that trades accuracy for speed.
const OPTIONS: &str = "-cl-std=CL1.2";
const ROUNDED_OPTIONS: &str = "-cl-std=CL1.2 -cl-fp32-correctly-rounded-divide-sqrt";

/// A device that can run kernels.
#[derive(Debug)]
struct Found {
    id: DeviceId,
    platform: String,
}

/// Bytes of a property of a device.
fn raw(device: DeviceId, query: Query) -> Option<Vec<u8>> {
    core::get_device_info_raw(device, query as u32).ok()
}

/// A whole number of a device, of whatever width.
fn number(device: DeviceId, query: Query) -> Option<u64> {
    let bytes = raw(device, query)?;
    match bytes.len() {
        4 => bytes.try_into().ok().map(|bytes| u32::from_ne_bytes(bytes).into()),
        8 => bytes.try_into().ok().map(u64::from_ne_bytes),
        _ => None,
    }
}

/// Words of a device.
fn words(device: DeviceId, query: Query) -> String {
    let bytes = raw(device, query).unwrap_or_default();
    String::from_utf8_lossy(&bytes).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
}

/// Whether a device can run kernels, or why it cannot.
fn usable(device: DeviceId) -> Result<(), String> {
    let no = |query| number(device, query) == Some(0);
    let name = || words(device, Query::Name);
    if no(Query::Available) {
        return Err(format!("{} is not available", name()));
    }
    if no(Query::CompilerAvailable) {
        return Err(format!("{} has no compiler", name()));
    }
    if no(Query::EndianLittle) {
        return Err(format!("{} stores numbers with the highest byte first", name()));
    }
    // "OpenCL 1.2 and the driver's own words"
    let version = words(device, Query::Version);
    let number = version.split_whitespace().nth(1).and_then(|v| v.split_once('.'));
    let number = number.and_then(|(major, minor)| Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?)));
    if number.is_some_and(|number| number < (1, 2)) {
        return Err(format!("{} has {version}, and 1.2 is needed", name()));
    }
    Ok(())
}

fn devices_of(platform: PlatformId) -> Result<Vec<DeviceId>, Fault> {
    match core::get_device_ids(platform, Some(DeviceType::ALL), None) {
        Ok(devices) => Ok(devices),
        Err(error) => {
            let fault = Fault::new("clGetDeviceIDs", &error);
            if fault.is_none_found() { Ok(Vec::new()) } else { Err(fault) }
        }
    }
}

/// The devices of all platforms. The caller holds [`FIRST_USE`].
fn devices() -> Result<Vec<Found>, Unavailable> {
    airlight_opencl_loader::load().map_err(|reason| {
        let advice = "install an OpenCL loader (ocl-icd-libopencl1 or the graphics driver's) and a driver, such as \
                      pocl-opencl-icd for the processor";
        Unavailable(format!("{reason}; {advice}"))
    })?;
    let platforms =
        core::get_platform_ids().map_err(|error| Unavailable(Fault::new("clGetPlatformIDs", &error).to_string()))?;
    if platforms.is_empty() {
        let reason = "the OpenCL loader knows no driver; install one for the graphics card, or pocl-opencl-icd for the \
                      processor";
        return Err(Unavailable(reason.into()));
    }
    let (mut found, mut refused) = (Vec::new(), Vec::new());
    for platform in platforms {
        let name = core::get_platform_info(platform, PlatformInfo::Name).map(|name| name.to_string());
        let name = name.unwrap_or_else(|_| "a platform without a name".into());
        match devices_of(platform) {
            Ok(devices) if devices.is_empty() => refused.push(format!("{name} has no device")),
            Ok(devices) => {
                for id in devices {
                    match usable(id) {
                        Ok(()) => found.push(Found { id, platform: name.clone() }),
                        Err(reason) => refused.push(reason),
                    }
                }
            }
            Err(fault) => refused.push(format!("{name}: {fault}")),
        }
    }
    if found.is_empty() { Err(Unavailable(refused.join("; "))) } else { Ok(found) }
}

/// The devices, or why there are none.
pub(crate) fn enumerate() -> Result<Vec<DeviceInfo>, Unavailable> {
    let _alone = FIRST_USE.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(devices()?.iter().enumerate().map(|(index, found)| describe(index, found)).collect())
}

/// Opens a device, with so many lanes or as many as suit it.
pub(crate) fn open(index: usize, lanes: Option<Lanes>) -> Result<OpenclDevice, Unavailable> {
    let _alone = FIRST_USE.lock().unwrap_or_else(PoisonError::into_inner);
    let devices = devices()?;
    let Some(found) = devices.get(index) else {
        let last = devices.len() - 1;
        return Err(Unavailable(format!("there is no opencl:{index}; the last one is opencl:{last}")));
    };
    let info = describe(index, found);
    let rounded = number(found.id, Query::SingleFpConfig).is_some_and(|config| config & CORRECTLY_ROUNDED != 0);
    let cl = Cl::open(found.id).map_err(|fault| Unavailable(format!("{} cannot be opened: {fault}", info.name)))?;
    let options = if rounded { ROUNDED_OPTIONS } else { OPTIONS };
    Ok(OpenclDevice::new(info, cl, options, lanes.unwrap_or_else(|| suitable(found.id))))
}

/// The lanes that suit a device: graphics processors run scalars side by side, and processors' cores vectors, two registers of four where
/// they have no wider, and of eight where kernels look up fields.
fn suitable(device: DeviceId) -> Lanes {
    let kind = DeviceType::from_bits_truncate(number(device, Query::Type).unwrap_or(0));
    match number(device, Query::NativeVectorWidthFloat) {
        Some(16..) if kind.contains(DeviceType::CPU) => Lanes::Sixteen,
        Some(8..) if kind.contains(DeviceType::CPU) => Lanes::EightOrSixteen,
        Some(4..) if kind.contains(DeviceType::CPU) => Lanes::Eight,
        _ => Lanes::One,
    }
}

fn describe(index: usize, found: &Found) -> DeviceInfo {
    let device = found.id;
    let kind = DeviceType::from_bits_truncate(number(device, Query::Type).unwrap_or(0));
    // A device that says both is a processor that imitates a graphics card.
    let gpu = kind.contains(DeviceType::GPU) && !kind.contains(DeviceType::CPU);
    let shares = number(device, Query::HostUnifiedMemory).is_some_and(|shares| shares != 0);
    let memory_bytes = number(device, Query::GlobalMemSize);
    // OpenCL promises that much where a driver says nothing.
    let largest = number(device, Query::MaxMemAllocSize).unwrap_or(128 << 20);
    let mut features = vec![found.platform.clone(), words(device, Query::Version)];
    features.push(format!("driver {}", words(device, Query::DriverVersion)));
    features.extend(number(device, Query::MaxComputeUnits).map(|units| format!("{units} compute units")));
    DeviceInfo {
        backend: "opencl",
        index,
        name: words(device, Query::Name),
        kind: match () {
            () if gpu && shares => DeviceKind::IntegratedGpu,
            () if gpu => DeviceKind::DiscreteGpu,
            // Processor cores too, so that a choice among devices takes the backend that is made for them.
            () => DeviceKind::Other,
        },
        memory_bytes,
        limits: Limits {
            buffer_bytes: largest,
            binding_bytes: largest - ROOM,
            // Kernels count texels of a slab with 31 bits; that product is checked where a field is made.
            field_side: i32::MAX as u32,
            loop_turns: None,
        },
        features,
        filter_bits: 24,
        contracts: false,
        unusable: None,
    }
}
