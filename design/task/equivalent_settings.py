"""Mounting angles that see the same: rotations and a mirror that map angles into their ranges.

With the chain of frames of `design/angles.py` and gamma for the angle of the servo, these pairs are the same poses:

- any angle and that 360 further;
- (alpha_rot, beta_rot) and (alpha_rot + 180, 180 - beta_rot), gamma 180 further, as Rx(180) Ry(180) = Rz(180);
- (alpha_laser, beta_laser) and (alpha_laser + 180, 180 - beta_laser), gamma 180 further, likewise;
- the axis turned round: alpha_rot and alpha_laser 180 further, both beta and gamma with the other sign.

And alpha_laser and 180 - alpha_laser mirror the scan about a plane through the axis: density and J are equal for any
field of view, if the lines go all around the axis. A sweep differs then (docs/definitions.md, Equivalent settings).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import product

Span = tuple[float, float]
Setting = Mapping[str, Span]
"""Range of each of the four angles in degrees, by name; both ends are equal if it is fixed."""

BOUNDS = {"alpha_rot": 180.0, "beta_rot": 90.0, "alpha_laser": 90.0, "beta_laser": 90.0}
"""Largest magnitude of each angle in degrees."""

FARTHEST_DEG = 3600.0  # larger angles are typing errors


@dataclass(frozen=True, slots=True)
class _Symmetry:
    """A map to an equivalent setting: for each angle in the order of BOUNDS a sign and an offset [deg]."""

    signs: tuple[int, ...]
    added: tuple[float, ...]
    gamma_sign: int = 1
    gamma_added: float = 0.0
    mirrored: bool = False

    def then(self, other: _Symmetry) -> _Symmetry:
        """Return the composition of this map and then another."""
        return _Symmetry(
            tuple(a * b for a, b in zip(self.signs, other.signs, strict=True)),
            tuple(s * a + b for s, a, b in zip(other.signs, self.added, other.added, strict=True)),
            self.gamma_sign * other.gamma_sign,
            (self.gamma_added + other.gamma_added) % 360.0,
            self.mirrored != other.mirrored,
        )

    def of(self, setting: Setting) -> dict[str, Span] | None:
        """Return the mapped setting; None if it is outside a range."""
        within = {}
        for (name, bound), sign, added in zip(BOUNDS.items(), self.signs, self.added, strict=True):
            ends = sorted(sign * end + added for end in setting[name])
            if ends[1] - ends[0] >= 360.0:
                ends = [-180.0, 180.0]
            turns_deg = 360.0 * math.floor((sum(ends) / 2 + 180.0) / 360.0)
            low, high = (round(end - turns_deg, 9) + 0.0 for end in ends)
            if low == high == -bound == -180.0:
                low = high = bound
            if not -bound <= low <= high <= bound:
                return None
            within[name] = (low, high)
        return within


_NOTHING = _Symmetry((1, 1, 1, 1), (0.0, 0.0, 0.0, 0.0))
_AXIS = _Symmetry((1, -1, 1, 1), (180.0, 180.0, 0.0, 0.0), gamma_added=180.0)
_LASER = _Symmetry((1, 1, 1, -1), (0.0, 0.0, 180.0, 180.0), gamma_added=180.0)
_ROUND = _Symmetry((1, -1, 1, -1), (180.0, 0.0, 180.0, 0.0), gamma_sign=-1)
_MIRROR = _Symmetry((1, 1, -1, 1), (0.0, 0.0, 180.0, 0.0), mirrored=True)
_SYMMETRIES = tuple(
    reduce(_Symmetry.then, chain, _NOTHING)
    for chain in product(*((_NOTHING, symmetry) for symmetry in (_AXIS, _LASER, _ROUND, _MIRROR)))
)


@dataclass(frozen=True, slots=True)
class Equivalent:
    """A setting within the ranges that sees the same as one outside."""

    setting: dict[str, Span]  # range of each angle in degrees
    gamma_sign: int  # sign of the servo's angle, relative to the original
    gamma_added_deg: float  # added to the servo's angle after that
    mirrored: bool  # whether the scan is the mirror image: equal J for full turns, another scan in a sweep


def equivalents_within(setting: Setting) -> list[Equivalent]:
    """Return the settings within the ranges that are equivalent to one of any size, fewest changes first."""
    equivalents = [
        Equivalent(inside, symmetry.gamma_sign, symmetry.gamma_added, symmetry.mirrored)
        for symmetry in _SYMMETRIES
        if (inside := symmetry.of(setting)) is not None
    ]

    def order(each: Equivalent) -> tuple[int, bool, bool, float]:
        changed = sum(each.setting[name] != tuple(setting[name]) for name in BOUNDS)
        return changed, each.gamma_sign < 0, each.mirrored, each.gamma_added_deg

    return sorted(equivalents, key=order)


def advice(setting: Setting, name: str) -> str:
    """Return text on the equivalents of the part of a setting in which angle `name` is outside its range."""
    if max(abs(end) for span in setting.values() for end in span) > FARTHEST_DEG:
        return ""
    return "".join(_advice(setting, name, beyond) for beyond in _beyond(setting[name], BOUNDS[name]))


def _beyond(span: Span, bound: float) -> Iterator[Span]:
    """Yield the parts of a range outside -bound .. bound."""
    low, high = span
    if low < -bound:
        yield low, min(high, -bound)
    if high > bound:
        yield max(low, bound), high


def _advice(setting: Setting, name: str, beyond: Span) -> str:
    original = dict(setting) | {name: beyond}
    equivalents = equivalents_within(original)
    if not equivalents:
        return ""
    first = equivalents[0]
    part = "" if beyond == tuple(setting[name]) else f"what lies in {_shown(beyond)} "
    text = f"; {part}sees the same as {_changed(first, original)}"
    same_turn = next((each for each in equivalents if not each.mirrored), None)
    if same_turn is first and not _limits(first):
        return text
    text += ", if the servo turns all around"
    return text if same_turn is None else f"{text}; in a sweep as {_changed(same_turn, original)}{_limits(same_turn)}"


def _limits(equivalent: Equivalent) -> str:
    """Return how the limits of a sweep change."""
    turned = [f"{equivalent.gamma_added_deg:g} deg further"] if equivalent.gamma_added_deg else []
    signed = ["with the other sign"] if equivalent.gamma_sign < 0 else []
    return f" and limits_deg {' and '.join(signed + turned)}" if signed or turned else ""


def _changed(equivalent: Equivalent, original: Setting) -> str:
    """Return the keys of a task that it changes."""
    return ", ".join(
        f"{name}_deg = {_shown(span)}" for name, span in equivalent.setting.items() if span != tuple(original[name])
    )


def _shown(span: Span) -> str:
    return f"{span[0]:g}" if span[0] == span[1] else f"[{span[0]:g}, {span[1]:g}]"
