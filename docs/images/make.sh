#!/usr/bin/env bash
# Makes every picture of this folder from the scenes in the repository.
set -euo pipefail
cd "$(dirname "$0")/../.."
cargo build --release --quiet
airlight=target/release/airlight
out=docs/images

"$airlight" render scenes/cumulus.toml -o $out/cumulus.png
"$airlight" render scenes/head.toml -o $out/head.png
"$airlight" render scenes/box.toml -o $out/box.png
"$airlight" render scenes/colonnade.toml --size 720x480 --samples 4 -o $out/colonnade.png
"$airlight" render scenes/fog-room.toml --samples 4 -o $out/fog-room.png
"$airlight" render scenes/ember.toml -o $out/ember.png

# What single scattering leaves of a cumulus.
"$airlight" render scenes/cumulus.toml --set estimate.scattering=none -o $out/cumulus-single.png

# Figure 3 of Delalandre, Gautron and Marvie (2013): one cloud under a full sky, and under nine coefficients of it.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
sky=(--size 640x360 --set environment.file="$PWD/scenes/studio.exr" --set environment.scale=8 --set environment.visible=false
    --set medium.anisotropy=0 --set estimate.lights=none --set estimate.scattering=none --set estimate.environment.cells=64)
"$airlight" render scenes/cumulus.toml "${sky[@]}" --set estimate.environment.directions=768 \
    -o $out/figure-3-full-sky.png -o "$work/full.exr"
"$airlight" render scenes/cumulus.toml "${sky[@]}" --set estimate.environment.content=transmittance \
    --set estimate.environment.bands=3 --set estimate.environment.directions=192 \
    -o $out/figure-3-nine-coefficients.png -o "$work/nine.exr"
"$airlight" compare "$work/nine.exr" "$work/full.exr" -o $out/figure-3-flip.png

# Figure 4: cells along the longest side.
for cells in 10 25 50 100; do
    "$airlight" render scenes/cumulus.toml "${sky[@]}" --set estimate.environment.cells=$cells \
        --set estimate.environment.directions=192 -o $out/figure-4-$cells-cells.png
done

# Figures 7 and 8 of Zhang, Dong and Ma (2013): light, and a shadow, in spherical harmonics, radial and discrete functions.
cargo run --release --quiet -p airlight-conformance --bin figures -- --bases --images $out -o "$work/bases.md"

# Figures 10 to 15 of the same: precomputed transfer.
cargo run --release --quiet -p airlight-conformance --bin figures -- --transfers --images $out -o "$work/transfers.md"

# A sky that turns around a cloud, and a lamp and a studio around a head, each relit by one transfer.
for name in cumulus head; do
    "$airlight" precompute scenes/$name-turning.toml -o "$work/$name.transfer"
    for frame in 1 40 80 120; do
        "$airlight" render scenes/$name-turning.toml --set estimate.all.file="$work/$name.transfer" --size 240x160 --samples 4 \
            --frames $frame -o $out/$name-turning-###.png
    done
done
