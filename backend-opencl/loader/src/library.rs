//! The library, loaded once and for as long as the program runs.

use std::env;
use std::ffi::OsString;
use std::sync::OnceLock;

use libloading::Library;

use crate::LIBRARY_VARIABLE;

/// Names of the library, the best one first.
const NAMES: &[&str] = if cfg!(windows) {
    &["OpenCL.dll"]
} else if cfg!(target_os = "android") {
    &["libOpenCL.so"]
} else {
    &["libOpenCL.so.1", "libOpenCL.so"]
};

/// The library, or why it cannot be loaded.
pub(crate) fn library() -> Result<&'static Library, &'static str> {
    static LIBRARY: OnceLock<Result<Library, String>> = OnceLock::new();
    LIBRARY
        .get_or_init(|| open(env::var_os(LIBRARY_VARIABLE).filter(|name| !name.is_empty())))
        .as_ref()
        .map_err(String::as_str)
}

fn open(chosen: Option<OsString>) -> Result<Library, String> {
    let from = if chosen.is_some() { format!(" (named by {LIBRARY_VARIABLE})") } else { String::new() };
    let names: Vec<OsString> = chosen.map_or_else(|| NAMES.iter().map(OsString::from).collect(), |name| vec![name]);
    let mut spoilt = None;
    for name in &names {
        // SAFETY: what the library does when it is loaded is what OpenCL's loader does, or the user's own choice.
        match unsafe { Library::new(name) } {
            Ok(library) => return Ok(library),
            Err(error) => {
                let (name, error) = (name.to_string_lossy(), error.to_string());
                if !is_missing(&name, &error) {
                    spoilt.get_or_insert(format!("{name} cannot be loaded{from}: {error}"));
                }
            }
        }
    }
    Err(spoilt.unwrap_or_else(|| format!("{} not found{from}", names[0].to_string_lossy())))
}

/// Whether the system says that there is no such file. Of a library that the file itself needs it says the same under
/// another name.
fn is_missing(name: &str, error: &str) -> bool {
    // The words of glibc and of musl.
    ["cannot open shared object file: No such file", "No such file"]
        .iter()
        .any(|words| error.contains(&format!("{name}: {words}")))
}

/// The library's function of a name that ends in a zero.
///
/// # Safety
/// `F` must be the type of that function.
pub(crate) unsafe fn find<F: Copy>(name: &[u8]) -> Option<F> {
    // SAFETY: as the caller promises. The library is never unloaded, so that a copy stays good.
    library().ok().and_then(|library| unsafe { library.get::<F>(name) }.ok().map(|symbol| *symbol))
}
