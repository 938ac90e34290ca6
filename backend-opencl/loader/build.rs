//! Puts an empty library OpenCL where linkers look first. cl-sys asks for that library without condition; its
//! functions are defined in this crate instead.

use std::{env, fs, path::PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // The framework exists on every such system.
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "macos") {
        return;
    }
    let msvc = env::var("CARGO_CFG_TARGET_ENV").is_ok_and(|env| env == "msvc");
    let folder = PathBuf::from(env::var_os("OUT_DIR").expect("cargo gives a build script its folder"));
    let file = folder.join(if msvc { "OpenCL.lib" } else { "libOpenCL.a" });
    // An archive without members is its signature alone.
    fs::write(&file, b"!<arch>\n").unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    println!("cargo::rustc-link-search=native={}", folder.display());
}
