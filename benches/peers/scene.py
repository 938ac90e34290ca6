"""The scene that all programs render, read from cloud.toml, and its cloud in the files that they read."""

import struct
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cloud import SIDE, cloud

HERE = Path(__file__).parent


@dataclass
class Scene:
    """What cloud.toml says, and where its files are."""

    folder: Path
    origin: list[float]
    target: list[float]
    fov: float
    size: int
    extinction: float
    albedo: float
    irradiance: float
    # Toward the light, of each frame; the first is the picture's.
    lights: list[list[float]]

    @property
    def toml(self) -> Path:
        return self.folder / "cloud.toml"

    @property
    def vol(self) -> Path:
        return self.folder / "cloud.vol"

    @property
    def vdb(self) -> Path:
        return self.folder / "cloud.vdb"

    @property
    def density(self) -> Path:
        return self.folder / "cloud.npy"

    @property
    def voxel(self) -> float:
        """Edge of a voxel, m: the box is [0, 1]^3."""
        return 1.0 / SIDE


def read(folder: Path) -> Scene:
    """The scene whose files lie, or will lie, in `folder`."""
    text = tomllib.loads((HERE / "cloud.toml").read_text())
    camera, medium, light = text["camera"], text["medium"], text["light"][0]
    track = text["animation"]["track"][0]
    share = np.linspace(0.0, 1.0, track["frames"][1] + 1)[:, None]
    first, last = np.array(track["values"])
    return Scene(
        folder=folder,
        origin=camera["origin"],
        target=camera["target"],
        fov=camera["fov"],
        size=camera["size"][0],
        extinction=medium["extinction"],
        albedo=medium["albedo"],
        irradiance=light["irradiance"],
        lights=(first + (last - first) * share).tolist(),
    )


def write(scene: Scene) -> str | None:
    """Writes the cloud as .npy, .vol and, where OpenVDB's Python module is there, as .vdb; else why it is not."""
    scene.folder.mkdir(parents=True, exist_ok=True)
    scene.toml.write_text((HERE / "cloud.toml").read_text())
    density = cloud()
    np.save(scene.density, density)
    header = b"VOL\x03" + struct.pack("<5i6f", 1, SIDE, SIDE, SIDE, 1, 0, 0, 0, 1, 1, 1)
    scene.vol.write_bytes(header + density.tobytes())
    scene.vdb.unlink(missing_ok=True)
    # Debian's module belongs to Debian's Python, not to that of the virtual environment.
    command = ["/usr/bin/python3", HERE / "write_vdb.py", scene.density, scene.vdb]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return None if done.returncode == 0 else (done.stderr.strip().splitlines() or ["write_vdb.py failed"])[-1]
