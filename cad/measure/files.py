"""The files of a measured model: a proposal for a product file, and its picture."""

import hashlib
from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import cadquery as cq
import numpy as np
import shapely

from scanwright.cad.drawings.sketch import AXES, sketch_of, spots_of, views_of
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.measure.proposal import Proposal, propose, toml_text
from scanwright.design.arrays import Array
from scanwright.design.errors import SceneError, TaskError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.design.progress import Progress, no_progress
from scanwright.design.scene.ray_caster import load_triangles

GRID_MM = 0.01  # to which corners are snapped: edges of neighbours then meet
SMALLEST_MM2 = 2.0  # smaller gaps are those between the faces of a model
SIMPLER_MM = 0.05  # that an outline may leave the model by
STEP_SUFFIXES = (".step", ".stp")
CHORD_ERROR, CHORD_ANGLE = 0.05, 0.15  # mm, rad: 42 sides to a hole, their corners on the true circle
SMALLEST_MM, LARGEST_MM = 5.0, 1000.0  # of a device
UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}


def read_model(path: Path, unit: str | None = None) -> Array:
    """Read the corners of a model's triangles in its own axes [mm], shape (t, 3, 3); `unit` is that of an STL file.

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
    """Return the triangles in axes with z up, out of the base or horn, and x to the front; `up` and `front` as "+y".

    Raises:
        SceneError: the two axes are parallel.
    """
    if up[1] == front[1]:
        raise SceneError(f"up = {up}, front = {front}: two different axes of the model")
    z, x = AXES[up], AXES[front]
    return np.asarray(triangles @ np.stack([x, np.cross(z, x), z], axis=1))


def picture_svg(proposal: Proposal, model: str) -> bytes:
    """Return the views of a model with its dimensions and proposed holes, as SVG."""
    notes = [f"Measured in {model}: all values unverified.", *proposal.notes]

    @cache
    def seen(right: tuple[float, ...], up: tuple[float, ...]) -> list[Array]:
        return silhouette(proposal.triangles, np.array(right), np.array(up))

    def draw(right: Array, up: Array) -> list[Array]:  # from the opposite side the outline is mirrored
        sign = right.sum()
        return [ring * (sign, 1.0) for ring in seen(tuple(np.abs(right)), tuple(up))]

    return sketch_of(model, views_of(spots_of(proposal.holes, "?"), draw), notes)


def silhouette(triangles: Array, right: Array, up: Array) -> list[Array]:
    """Return the outlines of triangles (t, 3, 3) in a view, closed polygons with shape (n, 2) each."""
    flat = triangles @ np.stack([right, up], axis=1)
    flat = np.unique(np.round(flat / GRID_MM) * GRID_MM, axis=0)
    (ax, ay), (bx, by), (cx, cy) = np.moveaxis(flat, 0, -1)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    union = shapely.union_all(shapely.polygons(flat[np.abs(area) > GRID_MM**2]), grid_size=GRID_MM)
    shapes = [shape for shape in shapely.get_parts(union) if isinstance(shape, shapely.Polygon)]
    rings = [ring for shape in shapes for ring in (shape.exterior, *shape.interiors)]
    large = (ring for ring in rings if shapely.Polygon(ring).area > SMALLEST_MM2)
    return [np.asarray(shapely.simplify(ring, SIMPLER_MM).coords)[:-1] for ring in large]


@dataclass(frozen=True, slots=True)
class MeasuredFiles:
    """The proposal and its files."""

    proposal: Proposal
    toml: Path
    picture: Path

    def lines(self) -> list[str]:
        """Return holes by face, other values, and remarks."""
        holes = Counter((str(h.axis), h.kind.replace("_", " "), h.size) for h in self.proposal.holes)
        values = [f"{field}: {value}" for field, value in self.proposal.values.items() if field != "holes"]
        counts = [f"holes in {face}: {count} x {size} {kind}" for (face, kind, size), count in holes.items()]
        notes = [f"note: {note}" for note in self.proposal.notes]
        return [*(counts or ["holes: none"]), *values, *notes, f"wrote {self.toml} and {self.picture}"]


def measure_files(
    model: Path,
    out: Path,
    kind: Literal["lidar", "servo"],
    *,
    up: str = "+z",
    front: str = "+x",
    unit: str | None = None,
    progress: Progress = no_progress,
) -> MeasuredFiles:
    """Measure a maker's model, and write the proposal and the picture, whose suffix is .svg.

    The axes `up`, for a servo out of its horn, and `front` are those of the model; `unit` is that of an STL file.

    Raises:
        SceneError: the model is missing or unreadable, or shows no device.
        TaskError: `out` is not a TOML file, or exists and is no proposal.
    """
    if out.suffix != ".toml":
        raise TaskError(f"out = {out}: a proposal is a .toml file")
    if out.exists() and "scanwright measure" not in out.read_text(encoding="utf-8"):
        raise TaskError(f"out = {out}: exists and is no proposal: choose another name")
    check_place(out, TaskError)
    progress("reading the model")
    triangles = turned(read_model(model, unit), up, front)
    progress("measuring")
    proposal = propose(triangles, kind)
    digest = hashlib.sha256(model.read_bytes()).hexdigest()
    picture = out.with_suffix(".svg")
    with atomic_write(out, TaskError) as place:
        place.write_text(toml_text(proposal, model.name, digest), encoding="utf-8")
    progress("drawing")
    with atomic_write(picture, TaskError) as place:
        place.write_bytes(picture_svg(proposal, model.name))
    return MeasuredFiles(proposal, out, picture)
