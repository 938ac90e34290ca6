#!/usr/bin/env bash
# Runs every test. On a bare Debian or Ubuntu, as root, it first installs the software devices that the tests of the
# other backends run on (lavapipe for Vulkan, PoCL for OpenCL: about 110 MB); elsewhere, tests of a device that is not
# there say aloud that they are skipped.
#
#   ./test.sh            all tests
#   ./test.sh ARGS...    passed on to `cargo test --workspace`
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

# The whole suite on every device. One whose driver is installed is required: that it cannot be had is then a failure.
required=cpu
vulkan_driver && required+=,wgpu
opencl_driver && required+=,opencl
export AIRLIGHT_DEVICES=${AIRLIGHT_DEVICES-cpu,wgpu,opencl} AIRLIGHT_REQUIRE=${AIRLIGHT_REQUIRE-$required}
# Mesa's layer that orders graphics cards complains where there is no desktop.
export NODEVICE_SELECT=1

if [ $# -gt 0 ]; then
    exec cargo test --workspace "$@"
fi
# All of it in one build: other choices of crates or targets have other features, or build the example libraries that
# tests load as programs. The benchmarks come last, each once.
cargo test --workspace
cargo test --workspace --bench devices
