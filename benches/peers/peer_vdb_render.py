"""OpenVDB's vdb_render: a march with a march toward the light from every sample."""

import shutil
from pathlib import Path

import numpy as np

from measure import Absent, Row, best, process, read_exr, row
from scene import Scene

# Steps of view and shadow rays, voxels; the first are the program's own.
LADDER = [(1, 3), (1, 1), (0.5, 0.5)]


def vector(values: list[float]) -> str:
    return ",".join(f"{x:.9g}" for x in values)


def command(scene: Scene, size: int, step: float, shadow: float, output: Path) -> list:
    """Coefficients are per voxel, a light's color is E p, and `gain` 0 leaves out what imitates further orders."""
    column = scene.extinction * scene.voxel
    light = scene.irradiance / (4 * np.pi)
    return [
        *["vdb_render", scene.vdb, output, "-res", f"{size}x{size}", "-fov", scene.fov],
        *["-translate", vector(scene.origin), "-lookat", vector(scene.target), "-up", "0,1,0"],
        *["-light", vector([*scene.lights[0], light, light, light])],
        *["-scatter", vector([scene.albedo * column] * 3), "-absorb", vector([(1 - scene.albedo) * column] * 3)],
        *["-gain", 0, "-cutoff", 1e-6, "-step", step, "-shadowstep", shadow],
    ]


def rows(scene: Scene, truth: np.ndarray, no_vdb: str | None, quick: bool) -> list[Row | Absent]:
    if shutil.which("vdb_render") is None:
        return [Absent("vdb_render", "not installed; Debian has it in libopenvdb-tools")]
    if no_vdb is not None:
        return [Absent("vdb_render", f"no .vdb could be written: {no_vdb}; Debian has the module in python3-openvdb")]
    found = []
    for step, shadow in LADDER[:2] if quick else LADDER:
        picture = scene.folder / "vdb_render.exr"
        cost, _ = best(1 if step < 1 else 3, command(scene, scene.size, step, shadow, picture))
        start, _ = process(command(scene, 1, step, shadow, scene.folder / "start.exr"))
        settings = f"-step {step:g} -shadowstep {shadow:g}"
        costs = {"cpu": cost.cpu, "wall": cost.wall, "start": start.cpu}
        found.append(row("vdb_render", settings, read_exr(picture), truth, **costs))
    return found
