"""The table and the ratios, as Markdown."""

from collections.abc import Callable
from dataclasses import dataclass

from measure import Absent, Row

# The error at or under which settings are compared.
GOAL = 0.01
# What a peer is to take more than airlight: Mitsuba at 2 %, vdb_render and VTK at or under `GOAL`.
MITSUBA, VDB_RENDER, VTK = 1000, 20, 50


@dataclass
class About:
    """What stands above the table."""

    machine: str
    date: str
    commit: str
    load: float
    truth: int
    coarser: int
    coarser_error: float


INTRODUCTION = """# Peers side by side

Written by `benches/peers/run --write` on {date}, at {commit}; what is compared, and how fairly, stands in the
[README](../benches/peers/README.md) there. One cloud of 96³ voxels (depth 6 along an axis, albedo 0.9, isotropic), one
directional light, single scattering, 256 × 256 pixels.

- **Machine**: {machine}. Load average before: {load:.1f}.
- **Truth**: brute force in f64 with {truth} positions a pixel. With {coarser}, its center, it differs by
  {coarser_error:.2%}: most programs send one ray through it.
- **Error**: relative L2 of linear radiance over the picture; *fitted*, after one factor for the whole picture, which
  stands beside it; *blocks*, of means of 8 × 8 pixels, where noise fades and bias stays.
- **CPU s**: user and system. Of airlight and vdb_render the whole process, with reading and writing of files, least of
  several; *start* is what a picture of one pixel takes, cells of shadow included. Of Mitsuba and VTK the call that
  renders alone, with everything compiled; *start* is what came before, loading and compiling.
- **Wall s**: the clock beside it, which other work on the machine holds up.
- **Frame**: one more frame with the light elsewhere, least of several.

"""
HEADER = """| program | settings | error | fitted | factor | blocks | CPU s | start | wall s | frame, CPU s | wall s |
| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |
"""
NOTE = """
*Rows in italics* were not rendered: noise falls as N^-1/2, and the exponent that was measured stands with them.

## Ratios

"""
RATIOS = """Of airlight, the setting of least cost whose error is at or under {goal:.0%}. Of a peer, *cheapest* is the
setting of least cost whose error after the fit is, else that of the least error; *finest* is that of the least error.

| peer | cost | airlight | ratio | wanted | met |
| --- | ---: | ---: | ---: | ---: | --- |
"""


def text(about: About, rows: list[Row | Absent]) -> str:
    """The whole page."""
    table = "".join(line(r) for r in rows)
    return INTRODUCTION.format(**vars(about)) + HEADER + table + NOTE + ratios([r for r in rows if isinstance(r, Row)])


def line(r: Row | Absent) -> str:
    """A row of the table."""
    if isinstance(r, Absent):
        return f"| {r.program} | not measured: {r.reason.replace('|', '/')} | | | | | | | | | |\n"
    if r.extrapolated:
        shown = [r.program, f"*{r.settings}*", f"{r.error:.2%}", "", "", f"{r.blocks:.2%}"]
    else:
        shown = [r.program, r.settings, f"{r.error:.2%}", f"{r.fitted:.2%}", f"{r.factor:.3f}", f"{r.blocks:.2%}"]
    seconds = [r.cpu, r.start, r.wall, r.frame_cpu, r.frame]
    return f"| {' | '.join(shown + ['' if s is None else number(s) for s in seconds])} |\n"


def number(x: float) -> str:
    """Three digits that count, two of what is small."""
    return f"{x:.0f}" if x >= 100 else f"{x:.3g}" if x >= 0.1 else f"{x:.2g}"


def ratios(rows: list[Row]) -> str:
    """What peers cost over what airlight does."""
    ours = [r for r in rows if r.program == "airlight, cpu" and r.error <= GOAL]
    if not ours:
        return f"No setting of airlight is at or under {GOAL:.0%}: there is nothing to compare.\n"
    found = RATIOS.format(goal=GOAL)
    extrapolated = [r for r in rows if r.program.startswith("Mitsuba") and r.extrapolated]
    if extrapolated:
        found += ratio("Mitsuba, extrapolated to 2 %, CPU s", extrapolated[0], ours, lambda r: r.cpu, MITSUBA)
    else:
        found += f"| Mitsuba | not measured | | | {MITSUBA} | |\n"
    found += of_settings("vdb_render", "CPU s", rows, ours, lambda r: r.cpu, VDB_RENDER)
    found += of_settings("VTK", "CPU s of a frame", rows, ours, lambda r: r.frame_cpu, VTK)
    return found + of_settings("VTK", "wall s of a frame", rows, ours, lambda r: r.frame, VTK)


def ratio(name: str, peer: Row, ours: list[Row], cost: Callable[[Row], float], wanted: float) -> str:
    own = min(ours, key=cost)
    times = cost(peer) / cost(own)
    shown = f"{number(cost(own))} ({own.settings}; {own.error:.2%})"
    return (
        f"| {name} | {number(cost(peer))} | {shown} | {times:.0f} | {wanted} | {'yes' if times >= wanted else 'no'} |\n"
    )


def of_settings(
    name: str, unit: str, rows: list[Row], ours: list[Row], cost: Callable[[Row], float], wanted: float
) -> str:
    """The ratios to the cheapest and to the finest setting of a program."""
    found = [r for r in rows if r.program.startswith(name)]
    if not found:
        return f"| {name} | not measured | | | {wanted} | |\n"
    finest = min(found, key=lambda r: r.fitted)
    cheapest = min((r for r in found if r.fitted <= GOAL), key=cost, default=finest)

    def told(word: str, r: Row) -> str:
        what = f"{name}, {unit}, {word}: {r.settings}; {r.error:.2%}, fitted {r.fitted:.2%}"
        return ratio(what, r, ours, cost, wanted)

    return told("cheapest", cheapest) + told("finest", finest)
