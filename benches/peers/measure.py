"""Costs of processes, errors of pictures, and the rows that come of them."""

import os
import resource
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

# Side of the blocks whose means are compared as well, pixels: noise fades there, bias does not.
BLOCK = 8


class Failed(Exception):
    """A program that could not be run; its text is the reason."""


@dataclass
class Cost:
    """Seconds of processor, user and system, and of the clock."""

    cpu: float
    wall: float


@dataclass
class Row:
    """A program at one setting."""

    program: str
    settings: str
    # Relative L2: as it is, with one factor fitted over the picture, of means of blocks.
    error: float
    fitted: float
    blocks: float
    factor: float
    # Of the whole picture; what of it is not rendering; a frame after the first.
    cpu: float
    wall: float
    start: float | None
    frame_cpu: float | None = None
    frame: float | None = None
    extrapolated: bool = False


@dataclass
class Absent:
    """A program that is not here."""

    program: str
    reason: str


def own() -> Cost:
    """What this process has spent."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return Cost(used.ru_utime + used.ru_stime, time.perf_counter())


def since(then: Cost) -> Cost:
    """What this process has spent since."""
    now = own()
    return Cost(now.cpu - then.cpu, now.wall - then.wall)


def process(command: list, env: dict | None = None) -> tuple[Cost, str]:
    """Runs a command to its end: what it took with all its children, and its standard output."""
    command = [str(word) for word in command]
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        begun = time.perf_counter()
        try:
            child = subprocess.Popen(command, stdout=out, stderr=err, env={**os.environ, **(env or {})})
        except OSError as error:
            raise Failed(f"{command[0]}: {error.strerror}") from error
        _, status, used = os.wait4(child.pid, 0)
        wall = time.perf_counter() - begun
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        if child.returncode != 0:
            lines = err.read().decode(errors="replace").strip().splitlines() or ["no word"]
            told = lines[-1] if lines[0].startswith("Traceback") else lines[0]
            raise Failed(f"{Path(command[0]).name} ended with {child.returncode}: {told[:200]}")
        return Cost(used.ru_utime + used.ru_stime, wall), out.read().decode()


def best(repeats: int, command: list, env: dict | None = None) -> tuple[Cost, str]:
    """The least of several runs, seconds of processor and of the clock each, and the last output."""
    runs = [process(command, env) for _ in range(repeats)]
    return Cost(min(c.cpu for c, _ in runs), min(c.wall for c, _ in runs)), runs[-1][1]


def read_exr(path: Path) -> np.ndarray:
    """The red channel, f64, row 0 at the top: the scene is grey."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return file.channels()["R"].pixels.astype(np.float64)


def block_means(picture: np.ndarray) -> np.ndarray:
    h, w = (n // BLOCK for n in picture.shape)
    return picture[: h * BLOCK, : w * BLOCK].reshape(h, BLOCK, w, BLOCK).mean(axis=(1, 3))


def relative(picture: np.ndarray, truth: np.ndarray) -> float:
    """Relative L2 difference."""
    return float(np.sqrt(((picture - truth) ** 2).sum() / (truth**2).sum()))


def row(program: str, settings: str, picture: np.ndarray, truth: np.ndarray, **costs) -> Row:
    """The row of a picture, linear radiance, held to the truth."""
    factor = float((picture * truth).sum() / (picture**2).sum())
    return Row(
        program,
        settings,
        error=relative(picture, truth),
        fitted=relative(factor * picture, truth),
        blocks=relative(block_means(picture), block_means(truth)),
        factor=factor,
        **costs,
    )
