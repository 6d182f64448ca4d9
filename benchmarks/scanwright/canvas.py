"""Pictures in three dimensions without a screen, by VTK: meshes, points and arrows on a white ground.

Needs OpenGL without a screen (Debian: libegl1).
"""

# The bridge of VTK to NumPy has no types.
# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkLight,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkWindowToImageFilter,
)
from vtkmodules.vtkRenderingOpenGL2 import vtkEGLRenderWindow

from scanwright.design.arrays import Array

Rgb = tuple[float, float, float]
SMOOTH_DEG = 30.0  # edges sharper than this stay sharp


class Canvas:
    """What is drawn, until `picture` is taken of it."""

    def __init__(self) -> None:
        self._renderer = vtkRenderer()
        self._renderer.SetBackground(1, 1, 1)
        self._renderer.SetAutomaticLightCreation(False)
        for position, strength in (((-2, -4, 9), 0.75), ((6, 3, 2), 0.35), ((-3, 6, 3), 0.25)):
            light = vtkLight()
            light.SetPosition(*position)
            light.SetFocalPoint(0, 0, 0)
            light.SetIntensity(strength)
            self._renderer.AddLight(light)

    def mesh(self, mesh: trimesh.Trimesh, colour: Rgb, opacity: float = 1.0, light: float = 0.25) -> None:
        """Add a body; `light` is how much of its colour it shows in the shade."""
        data = _polydata(mesh.vertices)
        corners = np.hstack([np.full((len(mesh.faces), 1), 3), mesh.faces]).astype(np.int64)
        data.SetPolys(_cells(len(mesh.faces), corners))
        shaded = vtkPolyDataNormals()
        shaded.SetInputData(data)
        shaded.SetFeatureAngle(SMOOTH_DEG)
        mapper = vtkPolyDataMapper()
        mapper.SetInputConnection(shaded.GetOutputPort())
        actor = self._added(mapper)
        actor.GetProperty().SetColor(*colour)
        actor.GetProperty().SetOpacity(opacity)
        actor.GetProperty().SetAmbient(light)
        actor.GetProperty().SetDiffuse(1 - light / 2)

    def points(self, points: Array, colours: Array, size_px: float) -> None:
        """Add points, shape (n, 3), with their colours, shape (n, 3), 0 to 1."""
        data = _polydata(points)
        data.SetVerts(_cells(len(points), np.column_stack([np.ones(len(points)), np.arange(len(points))])))
        data.GetPointData().SetScalars(numpy_to_vtk(np.rint(colours * 255).astype(np.uint8), deep=True))
        mapper = vtkPolyDataMapper()
        mapper.SetInputData(data)
        actor = self._added(mapper)
        actor.GetProperty().SetPointSize(size_px)
        actor.GetProperty().LightingOff()

    def line(self, points: Array, colour: Rgb, radius: float) -> None:
        """Add a line through points, shape (n, 3), as thick as a tube of that radius."""
        for start, end in pairwise(points):
            self.mesh(trimesh.creation.cylinder(radius, segment=[start, end], sections=16), colour, light=0.6)

    def arrow(self, start: Array, end: Array, colour: Rgb, radius: float) -> None:
        """Add an arrow."""
        along = (end - start) / np.linalg.norm(end - start)
        neck = end - 5 * radius * along
        self.line(np.array([start, neck]), colour, radius)
        head = trimesh.creation.cone(2.5 * radius, 5 * radius, sections=24)
        head.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], along))
        head.apply_translation(neck)
        self.mesh(head, colour, light=0.6)

    def picture(
        self, size: tuple[int, int], eye: Array, target: Array, *, degrees: float = 30.0, parallel: float | None = None
    ) -> Image.Image:
        """What is seen from `eye`, up being +z; `parallel` is half the height of the view without perspective."""
        window = vtkEGLRenderWindow()
        window.SetOffScreenRendering(1)
        window.SetMultiSamples(8)
        window.SetSize(*size)
        window.AddRenderer(self._renderer)
        camera = self._renderer.GetActiveCamera()
        camera.SetPosition(*eye)
        camera.SetFocalPoint(*target)
        camera.SetViewUp(0, 0, 1)
        camera.SetViewAngle(degrees)
        if parallel is not None:
            camera.ParallelProjectionOn()
            camera.SetParallelScale(parallel)
        self._renderer.ResetCameraClippingRange()
        window.Render()
        shot = vtkWindowToImageFilter()
        shot.SetInput(window)
        shot.ReadFrontBufferOff()
        shot.Update()
        pixels = vtk_to_numpy(shot.GetOutput().GetPointData().GetScalars()).reshape(size[1], size[0], -1)
        return Image.fromarray(np.ascontiguousarray(pixels[::-1, :, :3]))

    def _added(self, mapper: Any) -> Any:
        actor = vtkActor()
        actor.SetMapper(mapper)
        self._renderer.AddActor(actor)
        return actor


def _polydata(points: Array) -> Any:
    held = vtkPoints()
    held.SetData(numpy_to_vtk(np.ascontiguousarray(points, np.float64), deep=True))
    data = vtkPolyData()
    data.SetPoints(held)
    return data


def _cells(count: int, corners: Array) -> Any:
    cells = vtkCellArray()
    cells.SetCells(count, numpy_to_vtkIdTypeArray(np.ascontiguousarray(corners.ravel(), np.int64), deep=True))
    return cells
