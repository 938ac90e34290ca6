"""VTK: vtkGPUVolumeRayCastMapper with volumetric scattering, by whatever OpenGL there is.

As a program it renders in a process of its own: peer_vtk.py FOLDER STEP..., JSON on standard output.
"""

import json
import re
import sys
from pathlib import Path

import numpy as np

from measure import Absent, Failed, Row, own, process, row, since
from scene import Scene, read

# Distances between samples, voxels, of view and shadow rays.
LADDER = [2.0, 1.0, 0.5]
# Points of the opacity's curve.
POINTS = 1024
FRAMES = 2


def volume(vtk, scene: Scene, step: float):
    """The cloud as a volume, and its mapper."""
    from vtk.util.numpy_support import numpy_to_vtk

    density = np.load(scene.density)
    h = scene.voxel
    image = vtk.vtkImageData()
    image.SetDimensions(density.shape[::-1])
    image.SetSpacing(h, h, h)
    image.SetOrigin(h / 2, h / 2, h / 2)
    image.GetPointData().SetScalars(numpy_to_vtk(density.ravel(), deep=True))
    mapper = vtk.vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.AutoAdjustSampleDistancesOff()
    mapper.UseJitteringOff()
    mapper.SetSampleDistance(step * h)
    # Shadows of the whole volume, and nothing of shading by the gradient.
    mapper.SetGlobalIlluminationReach(1.0)
    mapper.SetVolumetricScatteringBlending(2.0)
    # What a voxel's edge stops; VTK carries it over to its own step.
    opacity = vtk.vtkPiecewiseFunction()
    for value in np.linspace(0.0, 1.0, POINTS + 1):
        opacity.AddPoint(value, 1.0 - np.exp(-scene.extinction * value * h))
    color = vtk.vtkColorTransferFunction()
    color.AddRGBPoint(0.0, 1.0, 1.0, 1.0)
    look = vtk.vtkVolumeProperty()
    look.SetInterpolationTypeToLinear()
    look.SetScalarOpacity(opacity)
    look.SetScalarOpacityUnitDistance(h)
    look.SetColor(color)
    look.ShadeOn()
    look.SetAmbient(0.0)
    look.SetDiffuse(1.0)
    look.SetSpecular(0.0)
    look.SetScatteringAnisotropy(0.0)
    found = vtk.vtkVolume()
    found.SetMapper(mapper)
    found.SetProperty(look)
    return found, mapper


def window(vtk, scene: Scene, shown, light):
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(0.0, 0.0, 0.0)
    renderer.AutomaticLightCreationOff()
    renderer.AddLight(light)
    renderer.AddVolume(shown)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(scene.origin)
    camera.SetFocalPoint(scene.target)
    camera.SetViewUp(0.0, 1.0, 0.0)
    camera.SetViewAngle(scene.fov)
    camera.SetClippingRange(0.1, 10.0)
    found = vtk.vtkRenderWindow()
    found.OffScreenRenderingOn()
    found.SetMultiSamples(0)
    found.SetSize(scene.size, scene.size)
    found.AddRenderer(renderer)
    return found


def work(folder: Path, steps: list[float]) -> None:
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    scene = read(folder)
    light = vtk.vtkLight()
    light.SetLightTypeToSceneLight()
    light.PositionalOff()
    light.SetFocalPoint(0.0, 0.0, 0.0)
    shown, mapper = volume(vtk, scene, steps[0])
    target = window(vtk, scene, shown, light)
    pixels = vtk.vtkFloatArray()

    def frame(k: int):
        """Renders frame `k` and reads it back."""
        light.SetPosition(scene.lights[k])
        before = own()
        target.Render()
        target.GetRGBAPixelData(0, 0, scene.size - 1, scene.size - 1, 1, pixels)
        return since(before)

    # Compiles the shaders.
    frame(1)
    start = own().cpu
    driver = re.search(r"renderer string: *([^(\n]*)", target.ReportCapabilities())
    runs = []
    for step in steps:
        mapper.SetSampleDistance(step * scene.voxel)
        costs = [frame(1 + k) for k in range(FRAMES)]
        costs.append(frame(0))
        picture = vtk_to_numpy(pixels).reshape(scene.size, scene.size, 4)[::-1, :, 0]
        np.save(folder / f"vtk-{step:g}.npy", picture)
        runs.append([step, min(c.cpu for c in costs), min(c.wall for c in costs)])
    # Warnings of missing displays went elsewhere.
    version = vtk.vtkVersion().GetVTKVersion()
    print(json.dumps({"start": start, "version": version, "driver": driver[1].strip(), "runs": runs}))


def rows(scene: Scene, truth: np.ndarray, reason: str | None, quick: bool) -> list[Row | Absent]:
    if reason is not None:
        return [Absent("VTK", reason)]
    try:
        _, out = process([sys.executable, __file__, scene.folder, *(LADDER[:2] if quick else LADDER)])
    except Failed as failed:
        return [Absent("VTK", str(failed))]
    told = json.loads(out.strip().splitlines()[-1])
    found = []
    for step, cpu, wall in told["runs"]:
        # Light of 1 on a white medium: the phase function, the irradiance and the albedo come after.
        picture = np.load(scene.folder / f"vtk-{step:g}.npy") * (scene.albedo * scene.irradiance / (4 * np.pi))
        program = f"VTK {told['version']}, {told['driver']}"
        costs = {"cpu": cpu, "wall": wall, "start": told["start"], "frame_cpu": cpu, "frame": wall}
        found.append(row(program, f"sample distance {step:g}", picture, truth, **costs))
    return found


if __name__ == "__main__":
    work(Path(sys.argv[1]), [float(n) for n in sys.argv[2:]])
