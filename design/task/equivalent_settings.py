"""Settings that see the same: turns and a mirror that take mounting angles back into their ranges.

With the chain of frames of `design/angles.py` and gamma for the angle of the servo, these pairs are the same poses:

- any angle and that 360 further;
- (alpha_rot, beta_rot) and (alpha_rot + 180, 180 - beta_rot), gamma 180 further, as Rx(180) Ry(180) = Rz(180);
- (alpha_laser, beta_laser) and (alpha_laser + 180, 180 - beta_laser), gamma 180 further, likewise;
- the axis turned round: alpha_rot and alpha_laser 180 further, both beta and gamma with the other sign.

And alpha_laser and 180 - alpha_laser mirror the scan about a plane through the axis: density and J stay equal for any
fan, where the lines go round the whole axis. A sweep is another one then (docs/definitions.md, Equivalent settings).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import product

Span = tuple[float, float]
Setting = Mapping[str, Span]
"""Range of each of the four angles in degrees, by name; both ends are equal where it is fixed."""

BOUNDS = {"alpha_rot": 180.0, "beta_rot": 90.0, "alpha_laser": 90.0, "beta_laser": 90.0}
"""Largest magnitude of each angle in degrees."""

FARTHEST_DEG = 3600.0  # an angle beyond it is no angle but a slip of the keys


@dataclass(frozen=True, slots=True)
class _Way:
    """One way to an equivalent setting: of each angle in the order of BOUNDS a sign, and what is added; [deg]."""

    signs: tuple[int, ...]
    added: tuple[float, ...]
    gamma_sign: int = 1
    gamma_added: float = 0.0
    mirrored: bool = False

    def then(self, other: _Way) -> _Way:
        """This one, and then another."""
        return _Way(
            tuple(a * b for a, b in zip(self.signs, other.signs, strict=True)),
            tuple(s * a + b for s, a, b in zip(other.signs, self.added, other.added, strict=True)),
            self.gamma_sign * other.gamma_sign,
            (self.gamma_added + other.gamma_added) % 360.0,
            self.mirrored != other.mirrored,
        )

    def of(self, setting: Setting) -> dict[str, Span] | None:
        """Where it takes a setting; None where that leaves a range."""
        found = {}
        for (name, bound), sign, added in zip(BOUNDS.items(), self.signs, self.added, strict=True):
            ends = sorted(sign * end + added for end in setting[name])
            if ends[1] - ends[0] >= 360.0:
                ends = [-180.0, 180.0]
            whole = 360.0 * math.floor((sum(ends) / 2 + 180.0) / 360.0)
            low, high = (round(end - whole, 9) + 0.0 for end in ends)
            if low == high == -bound == -180.0:
                low = high = bound
            if not -bound <= low <= high <= bound:
                return None
            found[name] = (low, high)
        return found


_NOTHING = _Way((1, 1, 1, 1), (0.0, 0.0, 0.0, 0.0))
_AXIS = _Way((1, -1, 1, 1), (180.0, 180.0, 0.0, 0.0), gamma_added=180.0)
_LASER = _Way((1, 1, 1, -1), (0.0, 0.0, 180.0, 180.0), gamma_added=180.0)
_ROUND = _Way((1, -1, 1, -1), (180.0, 0.0, 180.0, 0.0), gamma_sign=-1)
_MIRROR = _Way((1, 1, -1, 1), (0.0, 0.0, 180.0, 0.0), mirrored=True)
_WAYS = tuple(
    reduce(_Way.then, taken, _NOTHING)
    for taken in product(*((_NOTHING, way) for way in (_AXIS, _LASER, _ROUND, _MIRROR)))
)


@dataclass(frozen=True, slots=True)
class Equivalent:
    """A setting within the ranges that sees the same as one beyond them.

    Attributes:
        setting: range of each angle in degrees.
        gamma_sign: of the servo's angle in it, against that of the other one.
        gamma_added_deg: to the servo's angle after that.
        mirrored: whether the scan is the mirror image: of equal J where the servo goes round, another scan in a sweep.
    """

    setting: dict[str, Span]
    gamma_sign: int
    gamma_added_deg: float
    mirrored: bool


def equivalents_within(setting: Setting) -> list[Equivalent]:
    """The settings within the ranges that see the same; those that change fewest angles first.

    Args:
        setting: all four angles, by the names of `BOUNDS`, wherever they lie.
    """
    found = [
        Equivalent(inside, way.gamma_sign, way.gamma_added, way.mirrored)
        for way in _WAYS
        if (inside := way.of(setting)) is not None
    ]
    return sorted(
        found, key=lambda each: (_count(each, setting), each.gamma_sign < 0, each.mirrored, each.gamma_added_deg)
    )


def _count(found: Equivalent, asked: Setting) -> int:
    """How many angles it changes."""
    return sum(found.setting[name] != tuple(asked[name]) for name in BOUNDS)


def advice(setting: Setting, name: str) -> str:
    """Words that name what is equivalent to the part of a setting in which one angle is beyond its range.

    Args:
        setting: all four angles.
        name: of the one.
    """
    if max(abs(end) for span in setting.values() for end in span) > FARTHEST_DEG:
        return ""
    return "".join(_words(setting, name, beyond) for beyond in _beyond(setting[name], BOUNDS[name]))


def _beyond(span: Span, bound: float) -> Iterator[Span]:
    """The pieces of a range outside -bound .. bound."""
    low, high = span
    if low < -bound:
        yield low, min(high, -bound)
    if high > bound:
        yield max(low, bound), high


def _words(setting: Setting, name: str, beyond: Span) -> str:
    asked = dict(setting) | {name: beyond}
    found = equivalents_within(asked)
    if not found:
        return ""
    part = "" if beyond == tuple(setting[name]) else f"what lies in {_shown(beyond)} "
    said = f"; {part}sees the same as {_changed(found[0], asked)}"
    same_turn = next((each for each in found if not each.mirrored), None)
    if same_turn is found[0] and not _limits(found[0]):
        return said
    said += ", where the servo goes round"
    return said if same_turn is None else f"{said}; in a sweep as {_changed(same_turn, asked)}{_limits(same_turn)}"


def _limits(found: Equivalent) -> str:
    """What becomes of the limits of a sweep."""
    turned = [f"{found.gamma_added_deg:g} deg further"] if found.gamma_added_deg else []
    signed = ["with the other sign"] if found.gamma_sign < 0 else []
    return f" and limits_deg {' and '.join(signed + turned)}" if signed or turned else ""


def _changed(found: Equivalent, asked: Setting) -> str:
    """The keys of a task that it changes."""
    return ", ".join(
        f"{name}_deg = {_shown(span)}" for name, span in found.setting.items() if span != tuple(asked[name])
    )


def _shown(span: Span) -> str:
    return f"{span[0]:g}" if span[0] == span[1] else f"[{span[0]:g}, {span[1]:g}]"
