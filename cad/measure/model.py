"""A maker's model as triangles in the frame of its device. Millimetres."""

from pathlib import Path

import cadquery as cq
import numpy as np

from scanwright.cad.drawings.devices.outline import AXES
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.design.arrays import Array
from scanwright.design.errors import SceneError
from scanwright.design.scene.ray_caster import load_triangles

STEP_SUFFIXES = (".step", ".stp")
CHORD_ERROR, CHORD_ANGLE = 0.05, 0.15  # mm, rad: 42 sides to a hole, their corners on the true circle
SMALLEST_MM, LARGEST_MM = 5.0, 1000.0  # of a device
UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}


def read_model(path: Path, unit: str | None = None) -> Array:
    """Read the triangles of a model in its own axes.

    Args:
        path: STEP, which states its unit, or STL.
        unit: of an STL file; None for mm.

    Returns:
        Corners [mm], shape (t, 3, 3).

    Raises:
        SceneError: the file is missing or unreadable, or no device has its size.
    """
    if path.suffix.lower() in STEP_SUFFIXES:
        if unit is not None:
            raise SceneError(f"{path}: unit = {unit}: a STEP file states its own unit")
        triangles = _step_triangles(path)
    else:
        triangles = load_triangles(path, UNITS_MM[unit or "mm"] / 1000) * 1000
    if not len(triangles):
        raise SceneError(f"{path}: contains no surface")
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    if not SMALLEST_MM <= size <= LARGEST_MM:
        hint = "" if path.suffix.lower() in STEP_SUFFIXES else "; an STL file has no unit: try unit m, cm or inch"
        raise SceneError(
            f"{path}: its longest side is {size:.3g} mm, that of a device {SMALLEST_MM:g} to {LARGEST_MM:g} mm{hint}"
        )
    return triangles


def _step_triangles(path: Path) -> Array:
    if not path.is_file():
        raise SceneError(f"{path}: {'this is a folder, not a model' if path.is_dir() else 'no such file'}")
    try:
        shapes = cq.importers.importStep(str(path)).vals()
        compound = cq.Compound.makeCompound([shape for shape in shapes if isinstance(shape, cq.Shape)])
        mesh = mesh_of(compound, CHORD_ERROR, CHORD_ANGLE)
    except Exception as error:  # the kernel fails with types of its own
        raise SceneError(
            f"{path}: not a readable STEP model: export it again as STEP AP214 or AP242, or as STL"
        ) from error
    return mesh.vertices[mesh.faces]


def turned(triangles: Array, up: str, front: str) -> Array:
    """Return the triangles in axes with z up and x to the front of the device.

    Args:
        triangles: corners in the axes of the model, shape (t, 3, 3).
        up: axis of the model that points up, out of the base or out of the horn, such as "+y".
        front: axis of the model that points to the front.

    Raises:
        SceneError: the two axes are parallel.
    """
    if up[1] == front[1]:
        raise SceneError(f"up = {up}, front = {front}: two different axes of the model")
    z, x = AXES[up], AXES[front]
    return np.asarray(triangles @ np.stack([x, np.cross(z, x), z], axis=1))
