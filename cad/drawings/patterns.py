"""Holes that belong together, and what a drawing says of them. Millimetres, rotation frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cad.geometry.holes import Round
from design.arrays import Array


@dataclass(frozen=True, slots=True)
class Pattern:
    """Equal parallel holes.

    Attributes:
        holes: all of one diameter, direction and height along it.
        circle: diameter of the circle that they share at equal steps; 0 if none.
        heads: diameter of the recesses of their screws' heads; 0 if none.
    """

    holes: tuple[Round, ...]
    circle: float
    heads: float = 0.0

    @property
    def direction(self) -> Array:
        """Along the holes."""
        return np.array(self.holes[0].direction)

    @property
    def centre(self) -> Array:
        """Middle of the holes' lower ends."""
        return np.array([hole.low for hole in self.holes]).mean(axis=0)

    def words(self) -> str:
        """The call-out."""
        hole = self.holes[0]
        depth = "THRU" if hole.through else f"x {number(hole.length)} DEEP"
        circle = f" ON Ø{number(self.circle)}" if self.circle else ""
        heads = f", Ø{number(self.heads)} FOR HEADS" if self.heads else ""
        return f"{counted(len(self.holes))}Ø{number(hole.diameter)} {depth}{circle}{heads}"


def number(value: float) -> str:
    """A length or an angle as drawings write it: two decimals at most, no trailing zeros."""
    text = f"{round(value, 2) + 0.0:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def counted(count: int) -> str:
    """How often, where it is more than once, before the words for one."""
    return f"{count}x " if count > 1 else ""


def patterns_of(rounds: list[Round]) -> list[Pattern]:
    """Holes grouped by diameter, direction and height; those about the rotation axis left out."""
    groups: dict[tuple[float, ...], list[Round]] = {}
    for hole in rounds:
        if hole.hole and not on_axis(hole):
            direction = np.array(hole.direction)
            height = round(float(np.array(hole.low) @ direction), 1) + 0.0
            key = (hole.diameter, *np.round(direction, 3).tolist(), height, hole.through)
            groups.setdefault(key, []).append(hole)
    return _with_heads([Pattern(tuple(holes), _circle(holes)) for _, holes in sorted(groups.items())])


def _with_heads(patterns: list[Pattern]) -> list[Pattern]:
    """Patterns of screw holes take in the wider holes in line with them."""
    out: list[Pattern] = []
    for pattern in patterns:  # by diameter, smallest first
        carrier = next((other for other in out if all(_in_line(hole, other) for hole in pattern.holes)), None)
        hole = pattern.holes[0]
        if carrier is None:
            out.append(pattern)
        elif hole.diameter > carrier.holes[0].diameter:
            wider = max(carrier.heads, hole.diameter)
            out[out.index(carrier)] = replace(carrier, heads=wider)
        elif not hole.through:  # else one drill makes both
            out.append(pattern)
    return sorted(out, key=lambda pattern: -len(pattern.holes))


def _in_line(hole: Round, pattern: Pattern) -> bool:
    direction = pattern.direction
    if float(direction @ hole.direction) < 1 - 1e-5:
        return False
    aside = [np.array(hole.low) - other.low for other in pattern.holes]
    return min(float(np.linalg.norm(a - (a @ direction) * direction)) for a in aside) < 0.01


def on_axis(item: Round) -> bool:
    """Whether a cylinder lies about the rotation axis."""
    return abs(item.direction[2]) > 1 - 1e-6 and math.hypot(item.low[0], item.low[1]) < 1e-3


def along_pattern(pattern: Pattern, towards: Array) -> Array:
    """The direction of the nearest two holes: a rectangle then lies straight."""
    points = [np.array(hole.low) for hole in pattern.holes]
    pairs = [(a, b) for i, a in enumerate(points) for b in points[i + 1 :]]
    a, b = min(pairs, key=lambda pair: round(float(np.linalg.norm(pair[1] - pair[0])), 3))
    side = (b - a) - ((b - a) @ towards) * towards
    side /= np.linalg.norm(side)
    level = np.cross([0.0, 0.0, 1.0], towards)
    turned = [side, np.cross(towards, side), -side, -np.cross(towards, side)]
    return max(turned, key=lambda v: round(float(v @ level), 6))


def _circle(holes: list[Round]) -> float:
    if len(holes) < 3:
        return 0.0
    points = np.array([hole.low for hole in holes])
    centre = points.mean(axis=0)
    arms = points - centre
    radii = np.linalg.norm(arms, axis=1)
    if np.ptp(radii) > 0.01:
        return 0.0
    first = arms[0] / radii[0]
    second = np.cross(holes[0].direction, first)
    turns = np.sort(np.arctan2(arms @ second, arms @ first))
    steps = np.diff([*turns, turns[0] + 2 * math.pi])
    # four on a square are told by their sides
    return float(2 * radii.mean()) if np.ptp(steps) < 1e-3 and len(holes) != 4 else 0.0
