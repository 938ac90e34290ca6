"""airlight: a ladder of settings, the same picture by paths, and its other devices."""

import json
from pathlib import Path

import numpy as np

from measure import Absent, Failed, Row, best, process, read_exr, row
from noise import Run, extrapolate
from scene import Scene

# Estimator of the light, view step in voxels, side of the pixels that a ray is marched for.
LADDER = [
    ('{ kind = "direct", shadow = "march" }', 0.5, 1),
    ('{ kind = "direct", shadow = "march" }', 1, 1),
    ('{ kind = "direct", shadow = "march" }', 2, 1),
    ('{ kind = "direct", shadow = "propagated" }', 2, 1),
    ('{ kind = "opacity", cells = 64 }', 1, 1),
    ('{ kind = "opacity", cells = 64 }', 2, 1),
    ('{ kind = "opacity", cells = 48 }', 2, 1),
    ('{ kind = "opacity", cells = 48 }', 3, 1),
    ('{ kind = "opacity", cells = 48 }', 2, 2),
    ('{ kind = "opacity", cells = 40 }', 2, 1),
    ('{ kind = "opacity", cells = 40 }', 2, 2),
    ('{ kind = "opacity", cells = 40 }', 3, 2),
    ('{ kind = "opacity", cells = 32 }', 3, 1),
]
# What the other devices render.
SHOWN = ('{ kind = "opacity", cells = 40 }', 2, 1)
REPEATS = 3


def words(lights: str, step: float, scale: int) -> str:
    """A setting as the table tells it."""
    kind = lights.strip("{ }").replace('"', "").replace("kind = ", "").replace(" = ", " ")
    return f"{kind}; step {step:g}" + (f"; scale {scale}" if scale > 1 else "")


def ladder_row(program: Path, scene: Scene, truth: np.ndarray, device: str, setting: tuple) -> Row:
    lights, step, scale = setting
    command = [program, "render", scene.toml, "--device", device, "--json"]
    for value in (f"estimate.lights={lights}", f"quality.step={step}", f"quality.scale={scale}"):
        command += ["--set", value]
    picture = scene.folder / "airlight.exr"
    cost, _ = best(REPEATS, [*command, "-o", picture])
    start, _ = best(REPEATS, [*command, "-o", scene.folder / "start.exr", "--size", "1x1"])
    last = len(scene.lights) - 1
    many = [*command, "-o", scene.folder / "airlight.#.exr", "--frames", f"0-{last}"]
    moving, out = best(REPEATS, many)
    # The same number of files, and nothing to render for them.
    still, _ = best(REPEATS, [*many, "--set", "animation.track=[]"])
    frames = json.loads(out)["frames"]
    return row(
        f"airlight, {device}",
        words(*setting),
        read_exr(picture),
        truth,
        cpu=cost.cpu,
        wall=cost.wall,
        start=start.cpu,
        frame_cpu=(moving.cpu - still.cpu) / last,
        frame=min(f["seconds"]["render"] for f in frames[1:]),
    )


def paths(program: Path, scene: Scene, truth: np.ndarray, counts: list[int]) -> list[Row]:
    """Its path tracer, which does what Mitsuba does."""

    def run(samples: int) -> Run:
        picture = scene.folder / "airlight.exr"
        estimate = f'estimate={{ all = {{ kind = "path", max_depth = 1, samples = {samples} }} }}'
        cost, _ = process([program, "render", scene.toml, "-o", picture, "--device", "cpu", "--set", estimate])
        return Run(samples, read_exr(picture), cost)

    return extrapolate("airlight, cpu, path", "max_depth 1", [run(n) for n in counts], truth)


def rows(program: Path, scene: Scene, truth: np.ndarray, counts: list[int], quick: bool) -> list[Row | Absent]:
    ladder = LADDER[-3:] if quick else LADDER
    found: list[Row | Absent] = [ladder_row(program, scene, truth, "cpu", setting) for setting in ladder]
    for device in ("opencl", "wgpu"):
        try:
            found.append(ladder_row(program, scene, truth, device, SHOWN))
        except Failed as reason:
            found.append(Absent(f"airlight, {device}", str(reason)))
    return found + paths(program, scene, truth, counts)
