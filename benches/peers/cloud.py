"""A cloud of 96^3 voxels from a formula: lumps eaten by noise, nowhere symmetric, zero at the box's faces."""

import numpy as np

SIDE = 96
# Center in units of the box, radius, weight.
LUMPS = [
    ((0.30, 0.31, 0.42), 0.170, 1.00),
    ((0.52, 0.34, 0.55), 0.195, 0.90),
    ((0.71, 0.29, 0.45), 0.150, 1.10),
    ((0.44, 0.53, 0.47), 0.165, 0.95),
    ((0.61, 0.56, 0.63), 0.140, 1.20),
    ((0.37, 0.71, 0.38), 0.115, 1.10),
    ((0.25, 0.42, 0.68), 0.115, 1.30),
    ((0.76, 0.45, 0.71), 0.100, 1.00),
    ((0.56, 0.76, 0.53), 0.090, 1.30),
]


def hashed(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """Values in [-1, 1) by an integer hash of their place."""
    h = (np.arange(np.prod(shape), dtype=np.uint64) + seed * 0x9E3779B1) & 0xFFFFFFFF
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B), (16, 1)):
        h = ((h ^ (h >> shift)) * factor) & 0xFFFFFFFF
    return ((h >> 8) / 2.0**23 - 1.0).reshape(shape)


def noise(place: np.ndarray, octaves: int, width: float) -> np.ndarray:
    """Fractal value noise on the lattice of `place` along each axis, its largest features `width` wide."""
    total = 0.0
    for octave in range(octaves):
        q = place / width * 2**octave
        knots = np.arange(int(q.max()) + 2)
        share = np.clip(1.0 - np.abs(q[:, None] - knots), 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        values = hashed((len(knots),) * 3, octave)
        for _ in range(3):
            # Along the last axis, which becomes the first.
            values = np.tensordot(share, values, axes=(1, 2))
        total = total + values / 2**octave
    return total


def cloud() -> np.ndarray:
    """Density, f32, 1 at its largest, indexed [z, y, x]: a voxel's value is that at its center."""
    place = (np.arange(SIDE) + 0.5) / SIDE
    z, y, x = np.meshgrid(place, place, place, indexing="ij", sparse=True)
    lumps = sum(w * np.exp(-((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2) / r**2) for (cx, cy, cz), r, w in LUMPS)
    density = lumps * (1.0 + 1.1 * noise(place, 4, 0.14)) - 0.22
    # A voxel of zeros at the faces, then a rise over a tenth of the box.
    edge = np.clip((np.minimum(place, 1.0 - place) - 1.0 / SIDE) / 0.1, 0.0, 1.0)
    density = np.clip(density, 0.0, None) * edge[:, None, None] * edge[:, None] * edge
    return (density / density.max()).astype(np.float32)
