#!/usr/bin/env bash
# Runs every test. On a bare Debian or Ubuntu, as root, it first installs the software Vulkan device that the tests of
# the wgpu backend run on; elsewhere those tests say aloud that they are skipped.
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
if ! vulkan_driver && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "Installing the software Vulkan driver (mesa-vulkan-drivers)" >&2
    export DEBIAN_FRONTEND=noninteractive
    install_driver() {
        apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1 >/dev/null || apt-get install -y -qq -f >/dev/null
    }
    { apt-get update -qq && install_driver; } || echo "It could not be installed; tests on wgpu will be skipped" >&2
fi

if [ $# -gt 0 ]; then
    exec cargo test --workspace "$@"
fi
# A device that is required and cannot be had is a failure; one that is not is skipped aloud.
AIRLIGHT_REQUIRE="${AIRLIGHT_REQUIRE:-cpu}" cargo test --workspace --exclude airlight-wgpu --all-targets
if vulkan_driver; then
    export AIRLIGHT_REQUIRE="${AIRLIGHT_REQUIRE:-wgpu}"
fi
cargo test -p airlight-wgpu --all-targets
cargo test --workspace --doc
