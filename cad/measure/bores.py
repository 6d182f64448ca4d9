"""Holes of a device: walls of one axis joined, with mouth, depth and likely screw. Millimetres."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.cad.geometry.holes import triple
from scanwright.cad.measure.walls import SAME_MM, Wall
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.scene.ray_caster import Scene, build_scene, cast

CLOSED = 0.95  # share of the full turn: least of the wall of a hole
TIP = 0.6  # times the diameter: a surface so near beyond the wall is the hole's bottom (a drill's tip is 0.3)
RIM_MM = 0.8  # beyond the wall, for detecting the face about the mouth
CHAMFER = 1.2  # times the diameter: largest distance of that face from the end of the wall
CORE_SHARE, CORE_MM = 0.02, 0.07  # of a modelled core from ISO 2306
MODELLED_MM = 0.07  # of a thread that is modelled with its outer diameter
PASSING = (0.07, 0.1, 0.2)  # a hole that a screw passes is wider by at least a, at most b + c times the screw


@dataclass(frozen=True, slots=True)
class Bore:
    """A hole that opens to the outside."""

    mouth: tuple[float, float, float]  # middle of its mouth, in the face about it
    out: tuple[float, float, float]  # unit vector out of the device
    diameter: float  # of its narrowest wall
    depth: float  # from the face to the end of that wall
    # height beyond the other end of a hole that goes through, inf if it opens to the outside; 0 if it is blind
    free: float
    slot: float  # length of a slot, 0 for a round hole


def bores_of(triangles: Array, walls: Iterable[Wall], preferred: Sequence[float] = (0.0, 0.0, -1.0)) -> list[Bore]:
    """Return the holes that open to the outside, in a fixed order; corners of shape (t, 3, 3).

    A hole through the device opens on the side `preferred` if both sides are alike.
    """
    scene = build_scene(triangles)
    groups: dict[tuple[int, ...], list[Wall]] = {}
    for wall in walls:
        if wall.hole and wall.around >= CLOSED:
            key = tuple(np.round(np.array([*wall.axis, *wall.middle]) / (2 * SAME_MM)).astype(int).tolist())
            groups.setdefault(key, []).append(wall)
    bores = [bore for group in groups.values() for bore in _along_one_axis(scene, group, np.asarray(preferred))]
    return sorted(bores, key=lambda bore: (bore.out, bore.diameter, bore.mouth))


def _along_one_axis(scene: Scene, walls: list[Wall], preferred: Array) -> list[Bore]:
    """Return the holes of walls with a common axis."""
    walls = sorted(walls, key=lambda wall: wall.low + wall.high)
    axis = np.asarray(walls[0].axis)
    middles = np.array([wall.at((wall.low + wall.high) / 2) for wall in walls])
    up, down = (cast(scene, middles, np.broadcast_to(along, middles.shape)).range_m for along in (axis, -axis))
    runs: list[list[int]] = []
    for i, wall in enumerate(walls):
        below = walls[i - 1]
        if i and (wall.low + wall.high - below.low - below.high) / 2 < up[i - 1] + SAME_MM:
            runs[-1].append(i)
        else:
            runs.append([i])
    bores = []
    for run in runs:
        first, last = walls[run[0]], walls[run[-1]]
        beyond = {
            -1: down[run[0]] - (first.high - first.low) / 2,
            1: up[run[-1]] - (last.high - last.low) / 2,
        }
        bore = _bore(scene, [walls[i] for i in run], beyond, preferred)
        if bore is not None:
            bores.append(bore)
    return bores


def _bore(scene: Scene, walls: list[Wall], beyond: dict[int, float], preferred: Array) -> Bore | None:
    """Return the hole of a run of walls; `beyond` has the free height at its lower (-1) and upper end."""
    axis = np.asarray(walls[0].axis)
    narrow = min(walls, key=lambda wall: (wall.radius, wall.low))
    ends = {-1: walls[0], 1: walls[-1]}
    mouths = {sign: _face(scene, ends[sign], sign) for sign in ends if np.isinf(beyond[sign])}
    if not mouths:
        return None
    box = np.stack([scene.triangles_m.min(axis=(0, 1)), scene.triangles_m.max(axis=(0, 1))])

    def order(sign: int) -> tuple[float, float, float]:
        side = sign * axis
        extreme = (np.where(side > 0, box[1], box[0]) - ends[sign].at(mouths[sign])) @ side
        return round(ends[sign].radius - narrow.radius, 2), round(float(extreme), 1), -float(side @ preferred)

    sign = min(mouths, key=order)
    face, end = mouths[sign], narrow.low if sign > 0 else narrow.high
    free = beyond[-sign] if beyond[-sign] > TIP * 2 * narrow.radius else 0.0
    length = 2 * (float(np.linalg.norm(narrow.stretch)) + narrow.radius) if any(narrow.stretch) else 0.0
    out, mouth = triple(sign * axis), triple(np.round(narrow.at(face), 3))
    return Bore(mouth, out, round(2 * narrow.radius, 3), round(abs(face - end), 3), float(free), round(length, 3))


def _face(scene: Scene, wall: Wall, sign: int) -> float:
    """Return the height along the axis of the face about the mouth of a wall; that of its end if there is none."""
    axis, end = np.asarray(wall.axis), wall.high if sign > 0 else wall.low
    aside = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    aside /= np.linalg.norm(aside)
    turns = np.arange(8) * np.pi / 4
    around = np.outer(np.cos(turns), aside) + np.outer(np.sin(turns), np.cross(axis, aside))
    reach = CHAMFER * 2 * wall.radius
    heights = []
    for rim in (RIM_MM, 2 * RIM_MM):  # a second ring, outside of a chamfer
        starts = wall.at(end + sign * reach) + (wall.radius + rim) * around
        hits = cast(scene, starts, np.broadcast_to(-sign * axis, starts.shape)).range_m
        near = end + sign * (reach - hits[hits < 2 * reach])
        heights += [round(float(height), 3) for height in near if sign * (height - end) > -SAME_MM]
    if not heights:
        return end
    return max(set(heights), key=lambda height: (heights.count(height), sign * height))


def likely_screws(bore: Bore) -> list[tuple[str, str]]:
    """Return the kind of hole and size of screw, the likelier first; none if no screw fits.

    A blind hole is assumed to be a thread, modelled by its core (ISO 2306) or its outer diameter; a through hole may
    also be a clearance hole.
    """
    d = bore.diameter
    sizes = [(s.core, s.name) for s in SCREWS.values() if abs(d - s.core) < CORE_MM + CORE_SHARE * s.nominal]
    sizes += [(s.nominal, s.name) for s in SCREWS.values() if abs(d - s.nominal) < MODELLED_MM]
    threads = [("tapped", name) for _, name in sorted(sizes, key=lambda size: round(abs(d - size[0]), 2))]
    if not bore.free:
        return list(dict.fromkeys(threads))
    least, most, share = PASSING
    passing = [s for s in SCREWS.values() if least < d - s.nominal < most + share * s.nominal]
    return [*(("through", s.name) for s in reversed(passing)), *dict.fromkeys(threads)]
