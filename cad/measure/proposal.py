"""Values of a product file from a maker's model. All are unverified: a person compares them with the device."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scanwright.cad.measure.bores import Bore, Wall, bores_of, likely_screws, walls_of
from scanwright.design.arrays import Array
from scanwright.design.catalogue.catalogue import KINDS
from scanwright.design.catalogue.holes import Hole
from scanwright.design.errors import SceneError

DEEP = 8.0  # times the diameter: such a deep hole is that of a case screw
LEAST_TURN = 0.9  # of the wall of a horn
OVERHANG_MM = 1.0  # least overhang of an ear of the body
SAME_MM = 0.1  # between holes of one pattern
PLANE_SHARE = 0.03  # of the surface: facets in such a large plane are no part of a round window
STEEP = 0.6  # largest z of the normal of a window
ABOVE = 0.3  # of the height: least middle of a window
CELL_MM = 0.5  # of the histogram of intersections
ON_AXIS_MM = 0.1  # between the normal of a facet and the axis
TRIES = 4000  # pairs of normals; most of them intersect at the axis
LEAST_SHARE = 0.01  # of the surface, round about the axis


@dataclass(frozen=True, slots=True)
class ScanWindow:
    """A band about the optical axis: place of the axis, largest radius, lower and upper edge."""

    axis: tuple[float, float]
    radius: float
    low: float
    high: float


def window_of(triangles: Array) -> ScanWindow | None:
    """Return the largest band that is round about an upright axis, in the upper part; None if there is none.

    Corners with z up [mm], shape (t, 3, 3).
    """
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    area = np.linalg.norm(across, axis=1)
    low, high = triangles[..., 2].min(), triangles[..., 2].max()
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = across / area[:, None]
    offsets = np.einsum("ij,ij->i", normals, triangles[:, 0])
    planes = np.unique(np.round(np.column_stack([normals, offsets]), 2), axis=0, return_inverse=True)[1].reshape(-1)
    in_plane = np.bincount(planes, area)[planes]
    upper = triangles.mean(axis=1)[:, 2] > low + ABOVE * (high - low)
    chosen = (area > 1e-9) & (in_plane < PLANE_SHARE * area.sum()) & upper & (np.abs(normals[:, 2]) < STEEP)
    if chosen.sum() < 8:
        return None
    triangles, area, total = triangles[chosen], area[chosen], area.sum()
    level = normals[chosen, :2] / np.linalg.norm(normals[chosen, :2], axis=1)[:, None]
    aside = np.stack([-level[:, 1], level[:, 0]], axis=1)
    reach = np.einsum("ijk,ik->ij", triangles[..., :2], aside)
    offset = (reach.min(axis=1) + reach.max(axis=1)) / 2  # the normal of a chord meets the axis from its middle
    axis = _meeting_point(aside, offset, area)
    outwards = np.einsum("ij,ij->i", triangles.mean(axis=1)[:, :2] - axis, level) > 0
    round_ = (np.abs(aside @ axis - offset) < ON_AXIS_MM) & outwards
    if area[round_].sum() < LEAST_SHARE * total:
        return None
    bands = np.round(np.stack([triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)], axis=1)[round_], 1)
    edges, index = np.unique(bands, axis=0, return_inverse=True)
    best = int(np.argmax(np.bincount(index.reshape(-1), area[round_])))
    inside = triangles[round_][index.reshape(-1) == best]
    radius = float(np.linalg.norm(inside[..., :2] - axis, axis=2).max())
    return ScanWindow((float(axis[0]), float(axis[1])), radius, float(edges[best, 0]), float(edges[best, 1]))


def _meeting_point(aside: Array, offset: Array, area: Array) -> Array:
    """Return the point (2,) on most of the lines `aside . point = offset`, weighted by area."""
    random = np.random.default_rng(0)
    a, b = random.choice(len(area), (2, TRIES), p=area / area.sum())
    turn = aside[a, 0] * aside[b, 1] - aside[a, 1] * aside[b, 0]
    a, b, turn = a[np.abs(turn) > 0.2], b[np.abs(turn) > 0.2], turn[np.abs(turn) > 0.2]
    if not len(turn):
        return np.zeros(2)
    points = np.stack(
        [offset[a] * aside[b, 1] - offset[b] * aside[a, 1], offset[b] * aside[a, 0] - offset[a] * aside[b, 0]], axis=1
    )
    points /= turn[:, None]
    cells, index = np.unique(np.round(points / CELL_MM), axis=0, return_inverse=True)
    best = cells[int(np.argmax(np.bincount(index.reshape(-1))))] * CELL_MM
    return np.asarray(np.median(points[np.abs(points - best).max(axis=1) < CELL_MM], axis=0))


@dataclass(frozen=True, slots=True)
class Proposal:
    """Values for a product file."""

    kind: Literal["lidar", "servo"]  # of product
    values: dict[str, Any]  # by field
    notes: tuple[str, ...]  # remarks for a person: alternative screws of a hole, dropped holes
    triangles: Array  # of the model in the frame of the device, corners [mm], shape (t, 3, 3)

    @property
    def holes(self) -> list[Hole]:
        """Proposed holes."""
        return [Hole.model_validate(each) for each in self.values["holes"]]


def propose(triangles: Array, kind: Literal["lidar", "servo"], origin: Sequence[float] | None = None) -> Proposal:
    """Measure a model; corners with z up (out of the servo's horn) and x to the front [mm], shape (t, 3, 3).

    Without an origin of the device's frame it is detected: the axis of the lidar's window and its lowest point, or the
    face of the servo's horn.

    Raises:
        SceneError: no servo's horn was detected.
    """
    walls = walls_of(triangles)
    preferred = (0.0, 0.0, -1.0 if kind == "lidar" else 1.0)
    bores = bores_of(triangles, walls, preferred)
    measure = _lidar if kind == "lidar" else _servo
    at, values, notes, used = measure(triangles, walls, bores, None if origin is None else np.asarray(origin))
    holes: list[dict[str, Any]] = []
    dropped: list[str] = []
    for bore in (bore for bore in bores if bore not in used):
        hole, note = _hole(bore, at)
        if hole is None:
            dropped.append(note)
        else:
            holes.append(hole)
            notes += [note] if note else []
    values["holes"] = holes
    if dropped:
        notes.append(f"dropped, no screw M1.6 to M6 fits: {'; '.join(dropped)}")
    return Proposal(kind, values, tuple(dict.fromkeys(notes)), triangles - at)


def _hole(bore: Bore, at: Array) -> tuple[dict[str, Any] | None, str]:
    """Return the record of a hole, and alternative screws; or None, and a description of the hole."""
    mouth = [round(c, 2) + 0.0 for c in (np.asarray(bore.mouth) - at).tolist()]
    screws = likely_screws(bore)
    size = f"{bore.diameter:g} mm at {mouth}, {bore.depth:g} deep"
    if not screws:
        return None, size
    kind, screw = screws[0]
    if bore.slot:
        kind = "slot"
    elif not bore.free and bore.depth > DEEP * bore.diameter:
        kind = "case_screw"
    hole: dict[str, Any] = {
        "at_mm": mouth,
        "axis": _face(bore.out),
        "kind": kind,
        "size": screw,
        "depth_mm": round(bore.depth, 2),
    }
    if kind == "through" and math.isfinite(bore.free):
        hole["head_space_mm"] = round(bore.free, 1)
    others = [f"{name} {word}" for word, name in screws[1:]]
    return hole, f"{hole['axis']}, {bore.diameter:g} mm: {screw} {kind}, or {' or '.join(others)}" if others else ""


def _face(out: tuple[float, float, float]) -> Any:
    direction = np.asarray(out)
    i = int(np.argmax(np.abs(direction)))
    if abs(direction[i]) > 1 - 1e-4:
        return f"{'+' if direction[i] > 0 else '-'}{'xyz'[i]}"
    return [round(c, 4) for c in out]


_Measured = tuple[Array, dict[str, Any], list[str], list[Bore]]
"""Origin of the device's frame, values, notes, and the holes described by other values."""


def _lidar(triangles: Array, _walls: list[Wall], _bores: list[Bore], origin: Array | None) -> _Measured:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    window, notes = window_of(triangles), []
    if origin is None:
        notes.append("the origin is below the middle of the window, on the lowest point: check that this is the base")
        middle = (low + high)[:2] / 2 if window is None else np.asarray(window.axis)
        origin = np.array([*middle, low[2]])
    values: dict[str, Any] = {}
    low, high = low - origin, high - origin
    half = np.minimum(-low, high)[:2]
    values["body_mm"] = _rounded([2 * half[0], 2 * half[1], high[2]])
    ears = []
    for i, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        reach = high[i] if sign > 0 else -low[i]
        if reach > half[i] + OVERHANG_MM:
            corners = (triangles.reshape(-1, 3) - origin)[sign * (triangles.reshape(-1, 3) - origin)[:, i] > half[i]]
            first, last = corners.min(axis=0), corners.max(axis=0)
            (first if sign > 0 else last)[i] = sign * half[i]
            ears.append([_rounded(first), _rounded(last)])
    if ears:
        values["ears_mm"] = ears
    if window is None:
        notes.append("no round window or head was detected")
    else:
        edges = np.array([window.low, window.high]) - origin[2]
        values |= {"window_z_mm": _rounded(edges), "window_radius_mm": round(window.radius, 2)}
        values["optical_height_mm"] = round(float(edges.mean()), 1)
        notes.append("optical_height_mm is the middle of the window: assumed, no model shows it")
    return origin, values, notes, []


def _servo(triangles: Array, walls: list[Wall], bores: list[Bore], origin: Array | None) -> _Measured:
    """Measure horn and case: the horn is the largest round boss that carries a circle of equal holes."""
    best: tuple[float, Wall, list[Bore]] | None = None
    for wall in walls:
        if wall.hole or abs(wall.axis[2]) < 1 - 1e-4 or wall.around < LEAST_TURN:
            continue
        axis = np.asarray(wall.middle)[:2]
        if origin is not None and np.linalg.norm(axis - origin[:2]) > SAME_MM:
            continue
        circle = _circle_of_holes(bores, axis, wall)
        if len(circle) > 1 and (best is None or (len(circle), wall.radius) > (best[0], best[1].radius)):
            best = len(circle), wall, circle
    if best is None:
        raise SceneError("no horn was detected: no round boss with a circle of equal holes faces up")
    _, horn, circle = best
    top = circle[0].mouth[2]
    if origin is None:
        origin = np.array([horn.middle[0], horn.middle[1], top])
    values: dict[str, Any] = {}
    points = triangles.reshape(-1, 3) - origin
    case_top = _case_top(triangles - origin, top - origin[2])
    case = points[points[:, 2] <= case_top + SAME_MM]
    values["case_min_mm"] = _rounded(case.min(axis=0))
    values["case_max_mm"] = _rounded([*case.max(axis=0)[:2], case_top])
    away = np.array([bore.mouth[:2] for bore in circle]) - origin[:2]
    turns = np.degrees(np.arctan2(-away[:, 0], away[:, 1])) % 360  # from +y, counter-clockwise from above
    step = 360 / len(circle)
    values["horn_diameter_mm"] = round(2 * horn.radius, 2)
    values["horn_thickness_mm"] = round(float(top - origin[2] - case_top), 2)
    values["horn_circle_mm"] = round(float(2 * np.linalg.norm(away, axis=1).mean()), 2)
    values["horn_holes"] = len(circle)
    values["horn_first_hole_deg"] = round(float(turns.min() % step), 2)
    screws = likely_screws(circle[0])
    notes = [f"horn: holes of {circle[0].diameter:g} mm; screws {', '.join(name for _, name in screws) or 'unknown'}"]
    if screws:
        values["horn_screw"] = screws[0][1]
    values["horn_thread_depth_mm"] = round(min(bore.depth for bore in circle), 2)
    boss = [
        wall
        for wall in walls
        if not wall.hole
        and abs(wall.axis[2]) > 1 - 1e-4
        and np.linalg.norm(np.asarray(wall.middle)[:2] - origin[:2]) < SAME_MM
        and max(wall.low * wall.axis[2], wall.high * wall.axis[2]) > top + SAME_MM
    ]
    values["horn_boss_diameter_mm"] = round(2 * max((wall.radius for wall in boss), default=0.0), 2)
    values["horn_boss_height_mm"] = round(max(0.0, float(points[:, 2].max())) if boss else 0.0, 2)
    on_horn = [
        bore
        for bore in bores
        if bore.out[2] > 1 - 1e-4
        and np.linalg.norm(np.asarray(bore.mouth)[:2] - origin[:2]) < horn.radius
        and abs(bore.mouth[2] - top) < SAME_MM
    ]
    others = [bore for bore in on_horn if bore not in circle]
    if others:
        notes.append(f"horn: {len(others)} more holes of {sorted({bore.diameter for bore in others})} mm")
    return origin, values, notes, on_horn


def _circle_of_holes(bores: list[Bore], axis: Array, wall: Wall) -> list[Bore]:
    """Return the most equal holes that face up, in one plane and on one circle about the axis within a wall."""
    groups: dict[tuple[float, ...], list[Bore]] = {}
    for bore in bores:
        radius = float(np.linalg.norm(np.asarray(bore.mouth)[:2] - axis))
        inside = 2 * bore.diameter / 2 < radius < wall.radius and wall.low - 3.0 < bore.mouth[2] < wall.high + 3.0
        if bore.out[2] > 1 - 1e-4 and inside:
            key = (round(radius, 1), round(bore.mouth[2], 1), round(bore.diameter, 1))
            groups.setdefault(key, []).append(bore)
    # of equally many the narrower ones: threads next to plain holes for the same screw
    return max(groups.values(), key=lambda group: (len(group), -group[0].diameter), default=[])


def _case_top(triangles: Array, horn: float) -> float:
    """Return the height of the largest plane that faces up below the horn's face."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(across, axis=1)
    up = (across[:, 2] > (1 - 1e-6) * area) & (triangles[..., 2].max(axis=1) < horn - SAME_MM)
    if not up.any():
        return float(triangles[..., 2].min())
    heights, index = np.unique(np.round(triangles[up, 0, 2], 2), return_inverse=True)
    return float(heights[int(np.argmax(np.bincount(index.reshape(-1), area[up])))])


def _rounded(values: Sequence[float] | Array) -> list[float]:
    return [round(float(value), 2) + 0.0 for value in values]


def toml_text(proposal: Proposal, model: str, digest: str) -> str:
    """Return the lines for a product file; `model` is the name of the file, `digest` its SHA-256."""
    source = f"measured by scanwright in {model} (sha256 {digest[:12]})"
    record = KINDS[proposal.kind]
    missing = [
        name
        for name, field in record.model_fields.items()
        if field.is_required() and name not in proposal.values and name not in ("kind", "name", "maker")
    ]
    lines = [
        f"# Proposed by `scanwright measure` from {model}.",
        "# Compare each value with the device, then set verified = true.",
        *(f"# {note}" for note in proposal.notes),
        f'kind = "{proposal.kind}"',
        f"name = {json.dumps(model.rpartition('.')[0] or model)}",
        'maker = "?"',
    ]
    for field, value in proposal.values.items():
        lines.append(f"{field} = {{ value = {_toml(value)}, source = {json.dumps(source)}, verified = false }}")
    lines += ["# The model does not show these; take them from the data sheet:", *(f"# {name} =" for name in missing)]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value)
