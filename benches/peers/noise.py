"""Pictures with noise: how their error falls with samples, and what a given error would cost."""

import math
from dataclasses import dataclass

import numpy as np

from measure import Cost, Row, relative, row

# The error that costs are extrapolated to.
GOAL = 0.02


@dataclass
class Run:
    """A picture of so many samples a pixel, and what rendering it took."""

    samples: int
    picture: np.ndarray
    cost: Cost


def extrapolate(
    program: str, settings: str, runs: list[Run], truth: np.ndarray, start: float | None = None
) -> list[Row]:
    """A row for each run, and one for `GOAL`, by N^-1/2 from the last.

    The exponent between the first and the last run is told, so that a reader sees how far N^-1/2 holds. A sample costs
    what the last run took more than the first, so that nothing that is paid once is multiplied.
    """
    found = [
        row(program, f"{settings}, {r.samples} spp", r.picture, truth, cpu=r.cost.cpu, wall=r.cost.wall, start=start)
        for r in runs
    ]
    first, last = runs[0], runs[-1]
    errors = [relative(r.picture, truth) for r in (first, last)]
    exponent = math.log(errors[1] / errors[0]) / math.log(last.samples / first.samples)
    samples = last.samples * (errors[1] / GOAL) ** 2
    share = (samples - last.samples) / (last.samples - first.samples)
    cpu = last.cost.cpu + (last.cost.cpu - first.cost.cpu) * share
    wall = last.cost.wall + (last.cost.wall - first.cost.wall) * share
    blocks = found[-1].blocks * GOAL / errors[1]
    text = f"{settings}, extrapolated to {samples:.0f} spp; measured exponent {exponent:.3f}"
    found.append(Row(program, text, GOAL, GOAL, blocks, 1.0, cpu, wall, start, extrapolated=True))
    return found
