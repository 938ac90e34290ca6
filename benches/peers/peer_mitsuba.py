"""Mitsuba 3: volpath, one scattering, on the processor by LLVM.

As a program it renders in a process of its own: peer_mitsuba.py FOLDER SAMPLES..., JSON on standard output.
"""

import glob
import json
import re
import sys
from pathlib import Path

import numpy as np

from measure import Absent, Cost, Failed, Row, own, process, since
from noise import Run, extrapolate
from scene import Scene, read

# The scene is grey, and so is the variant.
VARIANT = "llvm_ad_mono"
# Older ones cannot compile all that Dr.Jit 1.5 asks for.
OLDEST_LLVM = 16


def llvm() -> tuple[int, str] | None:
    """The newest version of LLVM that will do, and its library."""
    found = {}
    for path in glob.glob("/usr/lib/*/libLLVM*.so*") + glob.glob("/usr/lib/llvm-*/lib/libLLVM*.so*"):
        version = re.search(r"libLLVM(?:-|\.so\.)(\d+)", path)
        if version and int(version[1]) >= OLDEST_LLVM:
            found[int(version[1])] = path
    return max(found.items(), default=None)


def load(mi, scene: Scene):
    to_world = mi.ScalarTransform4f
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 2, "rr_depth": 100, "hide_emitters": True},
            "sensor": {
                "type": "perspective",
                "fov": scene.fov,
                "fov_axis": "y",
                "to_world": to_world().look_at(origin=scene.origin, target=scene.target, up=[0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": scene.size,
                    "height": scene.size,
                    "pixel_format": "luminance",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},
                },
                "sampler": {"type": "independent"},
            },
            "light": {
                "type": "directional",
                "direction": [-x for x in scene.lights[0]],
                "irradiance": {"type": "uniform", "value": scene.irradiance},
            },
            "box": {
                "type": "cube",
                "to_world": to_world().translate([0.5] * 3).scale(0.5),
                "bsdf": {"type": "null"},
                "interior": {
                    "type": "heterogeneous",
                    "albedo": scene.albedo,
                    "scale": scene.extinction,
                    "sigma_t": {"type": "gridvolume", "filename": str(scene.vol), "use_grid_bbox": True, "raw": True},
                },
            },
        }
    )


def work(folder: Path, counts: list[int]) -> None:
    import mitsuba as mi

    mi.set_variant(VARIANT)
    scene = read(folder)
    loaded = load(mi, scene)
    # Compiles the kernel, which is kept for the pictures.
    np.array(mi.render(loaded, spp=counts[0], seed=0))
    told = {"start": own().cpu, "version": mi.__version__, "runs": []}
    for samples in counts:
        before = own()
        picture = np.array(mi.render(loaded, spp=samples, seed=samples))[..., 0]
        cost = since(before)
        np.save(folder / f"mitsuba-{samples}.npy", picture)
        told["runs"].append([samples, cost.cpu, cost.wall])
    json.dump(told, sys.stdout)


def rows(scene: Scene, truth: np.ndarray, counts: list[int], reason: str | None) -> list[Row | Absent]:
    if reason is not None:
        return [Absent("Mitsuba 3", reason)]
    compiler = llvm()
    if compiler is None:
        return [Absent("Mitsuba 3", f"no library of LLVM {OLDEST_LLVM} or newer; Debian has one in libllvm19")]
    version, library = compiler
    try:
        _, out = process([sys.executable, __file__, scene.folder, *counts], {"DRJIT_LIBLLVM_PATH": library})
    except Failed as failed:
        return [Absent("Mitsuba 3", str(failed))]
    told = json.loads(out)
    runs = []
    for samples, cpu, wall in told["runs"]:
        picture = np.load(scene.folder / f"mitsuba-{samples}.npy").astype(np.float64)
        runs.append(Run(samples, picture, Cost(cpu, wall)))
    program = f"Mitsuba {told['version']}, {VARIANT}, LLVM {version}"
    return extrapolate(program, "volpath", runs, truth, told["start"])


if __name__ == "__main__":
    work(Path(sys.argv[1]), [int(n) for n in sys.argv[2:]])
