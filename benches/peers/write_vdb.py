"""Writes a density on [0, 1]^3 as a fog volume, by OpenVDB's own module: write_vdb.py IN.npy OUT.vdb."""

import sys

import numpy as np
import pyopenvdb as vdb

density = np.load(sys.argv[1]).transpose(2, 1, 0)
h = 1.0 / density.shape[0]
grid = vdb.FloatGrid()
grid.copyFromArray(np.ascontiguousarray(density))
# Rows are images of the axes, then that of the origin: index (0, 0, 0) is the center of the first voxel.
grid.transform = vdb.createLinearTransform([[h, 0, 0, 0], [0, h, 0, 0], [0, 0, h, 0], [h / 2, h / 2, h / 2, 1]])
grid.name = "density"
grid.gridClass = vdb.GridClass.FOG_VOLUME
vdb.write(sys.argv[2], grids=[grid])
