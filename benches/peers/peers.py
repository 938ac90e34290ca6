"""Renders one scene with airlight and with other programs, and tells error and cost of each in one table.

`./run` calls it with what it has installed; README.md says what is compared.
"""

import argparse
import datetime
import hashlib
import os
import platform
import subprocess
from pathlib import Path

import numpy as np

import peer_airlight
import peer_mitsuba
import peer_vdb_render
import peer_vtk
import report
from measure import process, read_exr, relative
from scene import HERE, Scene, read, write

# Sub-pixel positions of the truth, and of a coarser one that tells how good it is.
TRUTH, COARSER = 4, 1
# Samples a pixel of pictures with noise.
COUNTS = [8, 32, 128]


def truth(program: Path, scene: Scene, samples: int) -> np.ndarray:
    """Brute force in f64, kept beside the cloud for as long as the scene stands."""
    key = hashlib.sha256(scene.toml.read_bytes() + scene.vol.read_bytes()).hexdigest()[:12]
    picture = scene.folder / f"truth-{samples}-{key}.exr"
    if not picture.exists():
        process([program, scene.toml, samples, picture])
    return read_exr(picture)


def machine() -> str:
    """The machine in words."""
    info = Path("/proc/cpuinfo").read_text().splitlines()
    name = next((line.split(":")[1].strip() for line in info if line.startswith("model name")), platform.machine())
    flags = next((line.split() for line in info if line.startswith("flags")), [])
    widest = "AVX-512" if "avx512f" in flags else "AVX2" if "avx2" in flags else "neither AVX2 nor AVX-512"
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    release = platform.freedesktop_os_release().get("PRETTY_NAME", "Linux")
    return f"{name}, {os.cpu_count()} cores, {widest}, {memory:.0f} GiB, {release}, Linux {platform.release()}"


def reason(folder: Path, name: str) -> str | None:
    """Why a package could not be installed, as `run` has left it."""
    path = folder / f"{name}.absent"
    return (path.read_text().strip() or "could not be installed") if path.exists() else None


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--airlight", type=Path, required=True, help="the program")
    options.add_argument("--truth", type=Path, required=True, help="the example `truth` of airlight-formats")
    options.add_argument("--folder", type=Path, required=True, help="where files go")
    options.add_argument("--write", action="store_true", help="write docs/peers.md")
    options.add_argument("--quick", action="store_true", help="few samples and settings, to see whether it works")
    given = options.parse_args()

    scene = read(given.folder)
    no_vdb = write(scene)
    held = truth(given.truth, scene, TRUTH)
    coarser = relative(truth(given.truth, scene, COARSER), held)
    load = os.getloadavg()[0]
    counts = COUNTS[:2] if given.quick else COUNTS
    rows = peer_airlight.rows(given.airlight, scene, held, counts, given.quick)
    rows += peer_vdb_render.rows(scene, held, no_vdb, given.quick)
    rows += peer_vtk.rows(scene, held, reason(given.folder, "vtk"), given.quick)
    rows += peer_mitsuba.rows(scene, held, counts, reason(given.folder, "mitsuba"))

    describe = ["git", "-C", HERE, "describe", "--always", "--dirty"]
    commit = subprocess.run(describe, capture_output=True, text=True, check=False)
    about = report.About(
        machine=machine(),
        date=datetime.date.today().isoformat(),
        commit=commit.stdout.strip(),
        load=load,
        truth=TRUTH,
        coarser=COARSER,
        coarser_error=coarser,
    )
    text = report.text(about, rows)
    print(text)
    if given.write:
        (HERE.parents[1] / "docs" / "peers.md").write_text(text)


if __name__ == "__main__":
    main()
