#!/usr/bin/env python3
"""Makes the .vdb files of this folder with OpenVDB's own library.

Needs Debian's python3-openvdb, libopenvdb-dev and g++; run it with /usr/bin/python3 in this folder. README.md says
what each file is for. The library puts a fresh UUID into each file, so that a second run gives other bytes.
"""
import math
import subprocess
import tempfile

import numpy as np
import pyopenvdb as vdb


def ramp(nx, ny, nz):
    """values[i, j, k] = (1 + i + 10 j + 100 k) / 8: exact as half, and different at every voxel."""
    i, j, k = np.meshgrid(np.arange(nx), np.arange(ny), np.arange(nz), indexing="ij")
    return ((1 + i + 10 * j + 100 * k) / 8).astype(np.float32)


def fog(name, shape=(7, 5, 9), first=(-3, 2, 4), background=0.0):
    grid = vdb.FloatGrid(background)
    grid.copyFromArray(ramp(*shape), ijk=first)
    grid.name = name
    grid.gridClass = vdb.GridClass.FOG_VOLUME
    return grid


# An affine map that turns, scales and shifts, in this order: the library turns before what is there.
affine = fog("density")
turn = vdb.createLinearTransform([[0.5, 0, 0, 0], [0, 0.25, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
turn.rotate(math.radians(30), vdb.Axis.Z)
turn.translate((1, -2, 3))
affine.transform = turn
vdb.write("affine.vdb", affine)

# Several grids, of which two can be used, and a third name that two grids share.
temperature = fog("temperature", (3, 4, 2), (10, -20, 30))
temperature.gridClass = vdb.GridClass.UNKNOWN
velocity = vdb.Vec3SGrid((0, 0, 0))
velocity.fill((0, 0, 0), (3, 3, 3), (1, 2, 3))
velocity.name = "velocity"
mask = vdb.BoolGrid()
mask.fill((0, 0, 0), (3, 3, 3), True)
mask.name = "mask"
vdb.write("several.vdb", [velocity, mask, temperature, fog("density"), fog("twin", (1, 2, 3)), fog("twin", (2, 2, 2))])
vdb.write("vec3.vdb", velocity)

# A level set beside a fog volume of another name.
sphere = vdb.createLevelSetSphere(radius=1.5, center=(20, 20, 20), voxelSize=1.0, halfWidth=1.5)
sphere.name = "surface"
vdb.write("levelset-and-fog.vdb", [sphere, fog("smoke")])

# Tiles: 4096³ in the root, 128³ and 8³ below, and voxels far from them.
tiles = vdb.FloatGrid(0.0)
tiles.name = "density"
tiles.gridClass = vdb.GridClass.FOG_VOLUME
tiles.fill((0, 0, 0), (4095, 4095, 4095), 0.5)
tiles.fill((-4096 + 128, 0, 0), (-4096 + 255, 127, 127), 0.25)
tiles.fill((-8, -8, 16), (-1, -1, 23), 0.125)
accessor = tiles.getAccessor()
accessor.setValueOn((-5000, 7, 9), 3.0)
vdb.write("tiles.vdb", tiles)

# Half values with Blosc.
half = fog("density", (17, 9, 6))
half.saveFloatAsHalf = True
vdb.write("half-blosc.vdb", half)

# A grid in a camera's frustum.
frustum = fog("density", (2, 2, 2))
frustum.transform = vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 1.0, 1.0)
vdb.write("frustum.vdb", frustum)

# Nothing active.
empty = vdb.FloatGrid(0.0)
empty.name = "density"
empty.gridClass = vdb.GridClass.FOG_VOLUME
vdb.write("empty.vdb", empty)

# What only the library's C++ reaches.
with tempfile.TemporaryDirectory() as folder:
    program = folder + "/make"
    subprocess.run(["g++", "-O1", "-std=c++17", "make.cc", "-o", program, "-lopenvdb", "-ltbb", "-lImath-3_1"], check=True)
    subprocess.run([program], check=True)
