"""The triangles of a mesh file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.errors import SceneError

SUFFIXES = (".stl", ".ply", ".obj", ".dae", ".glb")


def mesh_file(path: Path) -> tuple[Float[ndarray, "t 3 3"], float | None]:
    """Return the corners of a mesh in units of its file, shape (t, 3, 3), and the unit that it states [m], if any.

    Raises:
        SceneError: the file is missing or is not a mesh.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise SceneError(f"{path}: not a mesh by its name; a mesh is one of {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise SceneError(f"{path}: {'this is a folder, not a mesh' if path.is_dir() else 'no such file'}")
    import trimesh

    try:
        loaded = trimesh.load_scene(path, process=False)
        triangles = np.asarray(loaded.to_mesh().triangles, dtype=float).reshape(-1, 3, 3)
        return triangles, trimesh.units.unit_conversion(loaded.units, "meters") if loaded.units else None
    except Exception as error:  # readers of a dozen formats fail with as many types
        raise SceneError(f"{path}: not a readable {path.suffix[1:].upper()} mesh: {type(error).__name__}") from error
