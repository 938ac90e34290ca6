//! Why there is no adapter: wgpu itself does not tell.

use airlight_core::device::Unavailable;
use libloading::Library;

/// Vulkan's loader under the name that wgpu opens it by.
const NAME: &str = if cfg!(windows) {
    "vulkan-1.dll"
} else if cfg!(target_vendor = "apple") {
    "libvulkan.dylib"
} else if cfg!(target_os = "android") {
    "libvulkan.so"
} else {
    "libvulkan.so.1"
};

/// The reason, once wgpu has found no adapter.
pub(crate) fn reason() -> Unavailable {
    let advice = "a Vulkan driver for the graphics card, or mesa-vulkan-drivers for a software one";
    #[allow(unsafe_code, reason = "a library's own code runs when it is loaded")]
    // SAFETY: it is the library that wgpu has loaded before, or could not load.
    let loaded = unsafe { Library::new(NAME) };
    Unavailable(match loaded {
        Ok(_) => format!("Vulkan's loader {NAME} finds no driver that works; install {advice}"),
        Err(error) if is_missing(&error.to_string()) => {
            format!("{NAME} not found; install Vulkan's loader (libvulkan1, or the graphics driver's) and {advice}")
        }
        Err(error) => format!("{NAME} cannot be loaded: {error}"),
    })
}

/// Whether the system says that there is no such file, and not that one which it needs is missing.
fn is_missing(error: &str) -> bool {
    // The words of glibc and of musl.
    ["cannot open shared object file: No such file", "No such file"]
        .iter()
        .any(|words| error.contains(&format!("{NAME}: {words}")))
}
