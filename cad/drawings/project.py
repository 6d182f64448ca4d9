"""Lines of a solid seen from one side, hidden ones marked: straight lines, arcs, and chains of points. Millimetres.

The kernel's hidden-line removal takes 8.6 s if edges are exactly behind one another and 0.1 s if not, so the view is
turned by a small angle. At one angle in a hundred it returns no lines, or only some: then the next angle is used. Lines
within TOLERANCE_MM are drawn once, and no hidden line under a visible one.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cadquery as cq
import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepLib import BRepLib
from OCP.GeomAbs import GeomAbs_Line
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.HLRAlgo import HLRAlgo_Projector
from OCP.HLRBRep import HLRBRep_Algo, HLRBRep_HLRToShape
from OCP.TopoDS import TopoDS_Shape

from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError

SKEWS_RAD = (  # about the two axes of the view, the next ones if the kernel fails with the first
    (1.0e-4, 0.6e-4),
    (-0.9e-4, 0.7e-4),
    (1.1e-4, -0.5e-4),
    (0.7e-4, 1.2e-4),
    (-0.6e-4, -0.8e-4),
    (1.3e-4, 0.9e-4),
)
MISSING_MM = 0.2  # corners may be outside the lines: by more, lines are missing
TOLERANCE_MM = 0.03  # between lines that are drawn once: a quarter of the thinnest line
SAMPLES = 49  # of a curved edge: the chords of a circle seen tilted, 100 mm across on paper, stay within 0.1 mm
SHORTEST_MM = 0.05  # line that is drawn: shorter than half a line is wide

Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Arc:
    """A piece of a circle, counter-clockwise; angles in rad, a full turn for a circle."""

    centre: tuple[float, float]
    radius: float
    start: float
    end: float
    hidden: bool

    @property
    def points(self) -> list[tuple[float, float]]:
        """Points on it, close together."""
        (x, y), turns = self.centre, np.linspace(self.start, self.end, 17).tolist()
        return [(x + self.radius * math.cos(turn), y + self.radius * math.sin(turn)) for turn in turns]


@dataclass(frozen=True, slots=True)
class Chain:
    """A straight piece by its two ends, or another curve by points close together."""

    points: tuple[tuple[float, float], ...]
    hidden: bool


Curve = Arc | Chain


def project(solid: cq.Shape, right: Array, up: Array, zero: Array, *, hidden: bool = True) -> list[Curve]:
    """Return the lines of a solid in the plane of a view, in a fixed order; `zero` is at the zero of the plane.

    Raises:
        BuildError: the kernel finds no lines.
    """
    corners = np.array([vertex.toTuple() for vertex in solid.Vertices()]) - zero
    flat = corners @ np.stack([right, up], axis=1)
    for skew in SKEWS_RAD:
        pieces = _pieces(solid, right, up, zero, skew, hidden=hidden)
        if pieces and _covers(np.concatenate([points for points, _ in pieces]), flat):
            return _drawn_once(pieces)
    raise BuildError(f"no drawing: the CAD kernel finds no lines of a part seen along {np.cross(up, right).round(4)}")


def _covers(points: Array, corners: Array) -> bool:
    """Return whether the extent of points contains all corners, both shape (n, 2)."""
    low, high = points.min(axis=0) - MISSING_MM, points.max(axis=0) + MISSING_MM
    return bool(((corners >= low) & (corners <= high)).all())


def _pieces(
    solid: cq.Shape, right: Array, up: Array, zero: Array, skew: tuple[float, float], *, hidden: bool
) -> list[tuple[Array, bool]]:
    """Return points along each line, and whether it is hidden; arguments as for `project`."""
    middle = np.array(solid.BoundingBox().center.toTuple())
    skewed = np.cross(right, up) + skew[0] * right + skew[1] * up
    algorithm = HLRBRep_Algo()
    algorithm.Add(solid.wrapped)
    axes = gp_Ax2(gp_Pnt(*middle.tolist()), gp_Dir(*skewed.tolist()), gp_Dir(*right.tolist()))
    algorithm.Projector(HLRAlgo_Projector(axes))
    algorithm.Update()
    algorithm.Hide()
    shapes = HLRBRep_HLRToShape(algorithm)
    origin = np.array([(middle - zero) @ right, (middle - zero) @ up])
    pieces: list[tuple[Array, bool]] = []
    for compound in (shapes.VCompound(), shapes.OutLineVCompound()):
        pieces += [(points + origin, False) for points in _edges(compound)]
    if hidden:
        for compound in (shapes.HCompound(), shapes.OutLineHCompound()):
            pieces += [(points + origin, True) for points in _edges(compound)]
    return pieces


def _edges(compound: TopoDS_Shape | None) -> Iterator[Array]:
    """Yield points along every edge: the ends of a straight one, shape (2, 2), of others shape (SAMPLES, 2)."""
    if compound is None or compound.IsNull():
        return
    BRepLib.BuildCurves3d_s(compound)
    for edge in cq.Shape.cast(compound).Edges():
        curve = BRepAdaptor_Curve(edge.wrapped)
        samples = 2 if curve.GetType() == GeomAbs_Line else SAMPLES
        at = np.linspace(curve.FirstParameter(), curve.LastParameter(), samples)
        points = [curve.Value(float(t)) for t in at]
        yield np.array([(p.X(), p.Y()) for p in points])


def _drawn_once(pieces: list[tuple[Array, bool]]) -> list[Curve]:
    lines: list[tuple[Array, bool]] = []
    arcs: list[tuple[Array, float, Span, bool]] = []
    chains: list[Chain] = []
    for points, hidden in pieces:
        if float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) < SHORTEST_MM:
            continue
        if _is_straight(points):
            lines.append((points[[0, -1]], hidden))
        elif (circle := _circle(points)) is not None:
            arcs.append((*circle, hidden))
        else:
            corners = [_point(point) for point in points]
            chains.append(Chain(tuple(min(corners, corners[::-1])), hidden))
    once = {chain.points: chain for chain in sorted(chains, key=lambda chain: not chain.hidden)}  # visible ones win
    straight_first = sorted((*_lines(lines), *once.values()), key=lambda c: (len(c.points), c.hidden, c.points))
    return [*straight_first, *sorted(_arcs(arcs), key=lambda arc: (arc.hidden, arc.centre, arc.radius, arc.start))]


def _is_straight(points: Array) -> bool:
    along = points[-1] - points[0]
    length = float(np.linalg.norm(along))
    if length < SHORTEST_MM / 2:
        return False
    aside = (points - points[0]) @ np.array([-along[1], along[0]]) / length
    return bool(np.abs(aside).max() < TOLERANCE_MM / 10)


def _circle(points: Array) -> tuple[Array, float, Span] | None:
    """Return the centre, radius and angles of the circle through points; None if there is none."""
    system = np.column_stack([2 * points, np.ones(len(points))])
    middle = points.mean(axis=0)
    solved, *_ = np.linalg.lstsq(system - [*(2 * middle), 0.0], ((points - middle) ** 2).sum(axis=1), rcond=None)
    centre = solved[:2] + middle
    radii = np.linalg.norm(points - centre, axis=1)
    radius = float(radii.mean())
    if radius > 1000 or np.abs(radii - radius).max() > TOLERANCE_MM / 3:
        return None
    turns = np.unwrap(np.arctan2(*(points - centre).T[::-1]))
    low, high = sorted((float(turns[0]), float(turns[-1])))
    return centre, radius, (low, high)


def _lines(pieces: list[tuple[Array, bool]]) -> Iterator[Chain]:
    """Join lines that lie on one another, the visible part first."""
    order = sorted(pieces, key=lambda piece: -round(float(np.linalg.norm(piece[0][1] - piece[0][0])), 3))
    starts, alongs = np.zeros((len(order), 2)), np.zeros((len(order), 2))
    groups: list[tuple[list[Span], list[Span]]] = []
    for ends, hidden in order:
        n = len(groups)
        across = np.stack([-alongs[:n, 1], alongs[:n, 0]], axis=1)
        off = [np.abs(np.einsum("ij,ij->i", end - starts[:n], across)) for end in ends]
        same = np.flatnonzero(np.maximum(*off) < TOLERANCE_MM).tolist() if n else []
        if same:
            i = same[0]
        else:
            i = n
            along = ends[1] - ends[0]
            along = along / np.linalg.norm(along)
            starts[n], alongs[n] = ends[0], along if tuple(np.round(along, 6)) > (0.0, 0.0) else -along
            groups.append(([], []))
        low, high = sorted(float((end - starts[i]) @ alongs[i]) for end in ends)
        groups[i][hidden].append((low, high))
    for start, along, spans in zip(starts, alongs, groups, strict=False):
        for hidden, shown in _shown(*spans):
            for low, high in shown:
                if high - low > SHORTEST_MM:
                    yield Chain((_point(start + low * along), _point(start + high * along)), hidden)


def _arcs(pieces: list[tuple[Array, float, Span, bool]]) -> Iterator[Arc]:
    """Join arcs of one circle likewise."""
    groups: list[tuple[Array, float, tuple[list[Span], list[Span]]]] = []
    for centre, radius, (low, high), hidden in sorted(pieces, key=lambda piece: (*np.round(piece[0], 2), piece[1])):
        i = 0
        while i < len(groups) and np.abs([*(groups[i][0] - centre), groups[i][1] - radius]).max() >= TOLERANCE_MM:
            i += 1
        if i == len(groups):
            groups.append((centre, radius, ([], [])))
        turns = math.floor(low / (2 * math.pi)) * 2 * math.pi
        groups[i][2][hidden].extend(_within_turn(low - turns, high - turns))
    for centre, radius, spans in groups:
        for hidden, shown in _shown(*spans):
            for low, high in _closed(shown):
                if (high - low) * radius > SHORTEST_MM:
                    yield Arc(_point(centre), round(radius, 3), round(low, 5) + 0.0, round(high, 5) + 0.0, hidden)


def _within_turn(low: float, high: float) -> list[Span]:
    turn = 2 * math.pi
    if high - low >= turn - 1e-3:
        return [(0.0, turn)]
    return [(low, high)] if high <= turn else [(low, turn), (0.0, high - turn)]


def _closed(spans: list[Span]) -> list[Span]:
    """Join the spans of a circle that meet at angle zero."""
    if len(spans) > 1 and spans[0][0] < 1e-3 and spans[-1][1] > 2 * math.pi - 1e-3:
        return [*spans[1:-1], (spans[-1][0], spans[0][1] + 2 * math.pi)]
    return spans


def _shown(seen: list[Span], behind: list[Span]) -> tuple[tuple[bool, list[Span]], ...]:
    """Return the visible spans, and the hidden ones that no visible one covers."""
    seen = _union(seen)
    return (False, seen), (True, _minus(_union(behind), seen))


def _union(spans: Iterable[Span]) -> list[Span]:
    joined: list[Span] = []
    for low, high in sorted(spans):
        if joined and low <= joined[-1][1] + TOLERANCE_MM:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return joined


def _minus(spans: list[Span], covered: list[Span]) -> list[Span]:
    for low, high in covered:
        low, high = low - TOLERANCE_MM, high + TOLERANCE_MM
        spans = [
            piece
            for start, end in spans
            for piece in ((start, min(end, low)), (max(start, high), end))
            if piece[1] - piece[0] > 1e-9
        ]
    return spans


def _point(point: Array) -> tuple[float, float]:
    return round(float(point[0]), 3) + 0.0, round(float(point[1]), 3) + 0.0
