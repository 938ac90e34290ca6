#!/usr/bin/env bash
# Runs every test. On a bare Debian or Ubuntu, as root, it first installs the software devices that the tests of the
# other backends run on (lavapipe for Vulkan, PoCL for OpenCL: about 110 MB); elsewhere, tests of a device that is not
# there say aloud that they are skipped.
#
#   ./test.sh            all tests
#   ./test.sh ARGS...    passed on to `cargo test`
set -euo pipefail
cd "$(dirname "$0")"

if ! command -v cargo >/dev/null; then
    echo "Rust is needed: see https://rustup.rs" >&2
    exit 1
fi

vulkan_driver() {
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
}
opencl_driver() {
    compgen -G '/etc/OpenCL/vendors/*.icd' >/dev/null
}
install() {
    echo "Installing $*" >&2
    # A second try mends what a broken download left unpacked.
    apt-get install -y -qq --no-install-recommends "$@" >/dev/null || apt-get install -y -qq -f >/dev/null
}
missing=()
vulkan_driver || missing+=(mesa-vulkan-drivers libvulkan1)
opencl_driver || missing+=(pocl-opencl-icd ocl-icd-libopencl1)
if [ ${#missing[@]} -gt 0 ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    export DEBIAN_FRONTEND=noninteractive
    { apt-get update -qq && install "${missing[@]}"; } || echo "Not all of it could be installed" >&2
fi

if [ $# -gt 0 ]; then
    exec cargo test --workspace "$@"
fi

# A device that is required and cannot be had is a failure; one that is not is skipped aloud.
others=(--exclude airlight-wgpu --exclude airlight-opencl --exclude airlight-opencl-loader)
AIRLIGHT_REQUIRE=cpu cargo test --workspace "${others[@]}" --all-targets
AIRLIGHT_REQUIRE=$(vulkan_driver && echo wgpu || true) cargo test -p airlight-wgpu --all-targets
# Without --all-targets, which would build the loader's example libraries as tests and not as libraries.
AIRLIGHT_REQUIRE=$(opencl_driver && echo opencl || true) cargo test -p airlight-opencl -p airlight-opencl-loader
if opencl_driver; then
    # The whole suite on a device that is not the processor itself.
    AIRLIGHT_DEVICES=opencl AIRLIGHT_REQUIRE=opencl \
        cargo test -p airlight-conformance --features opencl --test devices
fi
cargo test --workspace "${others[@]}" --doc
