"""The table and the ratios, as Markdown."""

from dataclasses import dataclass

from measure import Absent, Row

# The error at or under which settings are compared.
GOAL = 0.01


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

Written by `benches/peers/run --write` on {date}, at {commit}; its [README](../benches/peers/README.md) says what is compared
and how fairly. One cloud of 96³ voxels (depth 6 along an axis, albedo 0.9, isotropic), one directional light, single
scattering, 256 × 256 pixels.

- **Machine**: {machine}. Load average before: {load:.1f}.
- **Truth**: brute force in f64 with {truth} positions a pixel; with {coarser} it differs by {coarser_error:.3%}.
- **Error**: relative L2 of linear radiance over the picture; *fitted*, after one factor for the whole picture, which stands
  beside it; *blocks*, of means of 8 × 8 pixels, where noise fades and bias stays.
- **CPU s**: user and system. Of airlight and vdb_render the whole process, reading and writing files included, least of
  {repeats}; *start* is the part that a picture of one pixel takes as well. Of Mitsuba and VTK the call that renders alone,
  with everything compiled; *start* is what came before, loading and compiling.
- **Wall s**: the clock beside it. **Frame s**: one more frame with the light elsewhere, by the clock, least of several.
"""


def text(about: About, rows: list[Row | Absent]) -> str:
    parts = [INTRODUCTION.format(**vars(about), repeats="several runs")]
    parts.append("| program | settings | error | fitted | factor | blocks | CPU s | start | wall s | frame s |")
    parts.append("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    parts += [line(r) for r in rows]
    parts += ["", "*Extrapolated* rows were not rendered: noise falls as N^-1/2, and the exponent that was measured stands with them.", ""]
    parts += ["## Ratios", "", *ratios([r for r in rows if isinstance(r, Row)])]
    return "\n".join(parts) + "\n"


def line(r: Row | Absent) -> str:
    if isinstance(r, Absent):
        return f"| {r.program} | not measured: {r.reason.replace('|', '/')} | | | | | | | | |"
    start = "" if r.extrapolated else number(r.start)
    frame = "" if r.frame is None else number(r.frame)
    seconds = f"{number(r.cpu)} | {start} | {number(r.wall)} | {frame}"
    if r.extrapolated:
        return f"| {r.program} | *{r.settings}* | {r.error:.2%} | | | {r.blocks:.2%} | {seconds} |"
    errors = f"{r.error:.2%} | {r.fitted:.2%} | {r.factor:.3f} | {r.blocks:.2%}"
    return f"| {r.program} | {r.settings} | {errors} | {seconds} |"


def number(x: float) -> str:
    """Three digits that count."""
    return f"{x:.0f}" if x >= 100 else f"{x:.3g}" if x >= 0.1 else f"{x:.2g}"


def ratios(rows: list[Row]) -> list[str]:
    """The three goals, each with what it is a ratio of."""
    of = lambda name: [r for r in rows if r.program.startswith(name)]
    ours = [r for r in rows if r.program == "airlight, cpu" and r.error <= GOAL]
    if not ours:
        return [f"No setting of airlight is at or under {GOAL:.0%}: there is nothing to compare."]
    whole = min(ours, key=lambda r: r.cpu)
    steady = min(ours, key=lambda r: r.frame)
    parts = [
        f"airlight at or under {GOAL:.0%}: whole picture {number(whole.cpu)} CPU s ({whole.settings}, {whole.error:.2%}); steady",
        f"frame {number(steady.frame)} s ({steady.settings}, {steady.error:.2%}). Of a peer, *cheapest* is its cheapest setting whose error is",
        f"at or under {GOAL:.0%} after the fit, else the one of the least error; *finest* is the one of the least error.",
        "",
        "| goal | peer | airlight | ratio | wanted | met |",
        "| --- | ---: | ---: | ---: | ---: | --- |",
    ]

    def goal(name: str, peer: float, own: float, wanted: float) -> None:
        met = "yes" if peer / own >= wanted else "no"
        parts.append(f"| {name} | {number(peer)} | {number(own)} | {peer / own:.0f} | {wanted:.0f} | {met} |")

    def two(name: str, wanted: float, cost, own: float) -> None:
        found = of(name)
        if not found:
            parts.append(f"| {name} | not measured | | | {wanted:.0f} | |")
            return
        finest = min(found, key=lambda r: r.fitted)
        good = [r for r in found if r.fitted <= GOAL] or [finest]
        cheapest = min(good, key=cost)
        for word, r in (("cheapest", cheapest), ("finest", finest)):
            goal(f"{name}, {word}: {r.settings} ({r.error:.2%}, fitted {r.fitted:.2%})", cost(r), own, wanted)

    extrapolated = [r for r in of("Mitsuba") if r.extrapolated]
    if extrapolated:
        goal("Mitsuba, CPU s at 2 %, extrapolated", extrapolated[0].cpu, whole.cpu, 1000)
    else:
        parts.append("| Mitsuba | not measured | | | 1000 | |")
    two("vdb_render", 20, lambda r: r.cpu, whole.cpu)
    two("VTK", 50, lambda r: r.frame, steady.frame)
    return parts
