"""Observability: free and fixed parameters, with reasons, and rejection of unsuitable recordings.

Least squares always has a result; this decides whether it is meaningful, for walls of realistic unevenness: parameters
that only perfect planes would show are not observable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.calibration import model
from scanwright.firmware_io.calibration.model import AT_REST_RAD_S, MOUNT, PARAMETERS, Mount, ReturnedBeams
from scanwright.firmware_io.calibration.solve import Grouping, Reduced, covariance, reduced
from scanwright.firmware_io.calibration.surfaces import seen_twice
from scanwright.firmware_io.calibration.tiles import FlatTiles

BUILDERS_BULGE_M = 5e-3  # permitted unevenness of walls over a metre (DIN 18202, finished walls)
FLATTEST_FAN_RAD = np.radians(3.0)  # a scan plane perpendicular to the axis shows no angle; near it, noise diverges
_TWICE = 0.05  # fraction of the beams
_ONE_LINE = 0.01  # fraction of the surface that faces across it
_JOINED = 0.5  # fraction of the flat patches; three of 100 furnished rooms have 0.57 or 0.58, with correct results


@dataclass(frozen=True, slots=True)
class Fixed:
    """A fixed parameter, and the reason."""

    names: tuple[str, ...]
    words: str
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """Free and fixed parameters."""

    free: Int64[ndarray, " free"]  # in the order of `PARAMETERS`
    fixed: tuple[Fixed, ...]
    notes: tuple[str, ...]  # further warnings


def check_fan(mount: Mount) -> None:
    """Raise RecordingError if the scan plane is (nearly) perpendicular to the axis."""
    tilt_rad = float(np.arccos(np.clip(abs(mount.designed[2, 2]), 0.0, 1.0)))
    if tilt_rad < FLATTEST_FAN_RAD:
        raise RecordingError(
            f"flat fan: the scan plane is {np.degrees(tilt_rad):.2f} deg from perpendicular to the axis: it sweeps one "
            "line of the scene, and surfaces need width; tilt the laser by "
            f"{np.degrees(FLATTEST_FAN_RAD):.0f} deg or more"
        )


def several_speeds(beams: ReturnedBeams) -> bool:
    """Whether the joint moved at speeds (with sign) that differ by a tenth or more."""
    low, high = np.percentile(beams.speed_rad_s, [2, 98])
    return not stood_still(beams) and bool(high - low > 0.1 * max(abs(low), abs(high)))


def stood_still(beams: ReturnedBeams) -> bool:
    """Whether the axis moves between scans only."""
    return bool(np.median(np.abs(beams.speed_rad_s)) < AT_REST_RAD_S)


def choose_observable(
    beams: ReturnedBeams,
    tiles: FlatTiles,
    grouping: Grouping,
    normal: Float64[ndarray, "tiles width width"],
    backlash_rad: float,
) -> Choice:
    """Choose the parameters that the recordings show, for a gear of that backlash.

    Raises:
        RecordingError: a mounting error is not observable; the message names it and the reason.
    """
    turned_deg = np.degrees(np.ptp(beams.joint_rad))
    twice = tiles.count[seen_twice(tiles, grouping)].sum() / tiles.count.sum()
    if twice < _TWICE:
        raise RecordingError(
            f"too little is seen twice: {twice:.1%} of the flat surface is seen by both sides of the fan (needed: "
            f"{_TWICE:.0%}); the axis turned {turned_deg:.0f} deg. Mounting errors then look like another shape of the "
            "scene: record a full turn. A scanner that can only tilt shows them only if both ends of its fan see the "
            f"same walls. The ranges scatter by {1e3 * tiles.noise_m:.1f} mm on flat patches: if that is far above the "
            "noise of the lidar, times or bearings were wrong, or the base moved; wrong angles or lever arms do not "
            "show in it"
        )
    free = np.array(MOUNT)
    sd = _sd(reduced(normal, grouping, free, BUILDERS_BULGE_M), free)
    weak = [k for k in MOUNT if not sd[k] <= PARAMETERS[k].limit]
    if weak:
        named = ", ".join(f"{PARAMETERS[k].words} (+-{_shown(k, sd[k])}, limit {_shown(k)})" for k in weak)
        raise RecordingError(f"the scene does not show {named}: {_geometry(tiles, grouping)}")
    fixed: list[Fixed] = []
    for group in (model.BIAS, model.HARMONIC_1, model.LAG, model.BACKLASH, model.HARMONIC_2):
        why = _motion(beams, group, backlash_rad)
        if not why:
            tried = np.sort(np.append(free, group))
            sd = _sd(reduced(normal, grouping, tried, BUILDERS_BULGE_M), tried)
            worst = max(tried, key=lambda k: sd[k] / PARAMETERS[k].limit)
            if sd[worst] <= PARAMETERS[worst].limit:
                free = tried
                continue
            why = (
                f"estimated together with the others, {PARAMETERS[worst].words} would be known to "
                f"+-{_shown(worst, sd[worst])} only (limit {_shown(worst)})"
            )
            if group == model.BACKLASH and model.LAG[0] in free:
                why += f"; {_inside(backlash_rad)}"
        fixed.append(Fixed(tuple(PARAMETERS[k].name for k in group), _words(group), why))
    share = _facing(tiles, grouping)[0]
    notes = []
    if share[0] < _ONE_LINE:
        notes.append(f"{_geometry(tiles, grouping)}; the result depends on the other surfaces alone")
    joined = tiles.count[grouping.used].sum() / tiles.count.sum()
    if joined < _JOINED:
        notes.append(f"only {joined:.0%} of the flat patches join surfaces: the true error may exceed the stated one")
    return Choice(free, tuple(fixed), tuple(notes))


def spectrum(part: Reduced, free: Int64[ndarray, " free"]) -> Float64[ndarray, " free"]:
    """Return singular values of the information in units of the limits, decreasing: below 1 is not observable."""
    unit = np.array([PARAMETERS[k].limit for k in free])
    return np.sqrt(np.maximum(np.linalg.eigvalsh(part.information * np.outer(unit, unit))[::-1], 0.0))


def _sd(part: Reduced, free: Ints) -> dict[int, float]:
    """Return the standard deviation of each free parameter; infinite if it is not observable."""
    return dict(zip(free.tolist(), np.sqrt(np.diag(covariance(part))).tolist(), strict=True))


def _inside(backlash_rad: float) -> str:
    return (
        "half of it, divided by the speed, is inside the time offset, whose stated error allows for "
        f"{np.degrees(backlash_rad):.2f} deg of it"
    )


def _motion(beams: ReturnedBeams, group: tuple[int, ...], backlash_rad: float) -> str:
    """Return why the motion of the axis does not show a parameter, "" if it does."""
    if group not in (model.LAG, model.BACKLASH):
        return ""
    directions = set(np.unique(beams.direction).tolist()) - {0.0}
    if stood_still(beams):
        return "the axis stood still while the lidar measured"
    if group == model.LAG and not several_speeds(beams):
        return "one direction at one speed: a delay turns the cloud about the axis, which no scene shows"
    if group == model.BACKLASH and len(directions) == 1:
        return "the axis turned in one direction only"
    moving = np.abs(beams.speed_rad_s[beams.direction != 0])
    slow, fast = np.percentile(moving, [5, 95])
    if group == model.BACKLASH and fast < 1.2 * slow:
        return f"both ways at one speed: {_inside(backlash_rad)}"
    return ""


def _facing(tiles: FlatTiles, grouping: Grouping) -> tuple[Floats, Floats]:
    """Return the fractions of the surface along three principal directions, increasing, and these (columns)."""
    used = grouping.used
    normal = grouping.q[grouping.surface[used]]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    weight = tiles.count[used] / tiles.count[used].sum()
    share, directions = np.linalg.eigh((normal * weight[:, None]).T @ normal)
    return share, directions


def _geometry(tiles: FlatTiles, grouping: Grouping) -> str:
    """Describe what all surfaces of the scene have in common."""
    share, directions = _facing(tiles, grouping)
    facing = directions * np.sign(directions[np.abs(directions).argmax(axis=0), np.arange(3)])
    shown = ["({:.2f}, {:.2f}, {:.2f})".format(*(column + 0.0)) for column in facing.T.round(2)]
    if share[1] < _ONE_LINE:
        return f"empty hall: all surfaces face along {shown[2]} of the axis frame; scan where walls are in reach"
    if share[0] < _ONE_LINE:
        return f"corridor: no surface faces along {shown[0]} of the axis frame; scan where one does, too"
    return (
        "its surfaces are too few, too far or too much alike; scan another place, away from the middle of the room, "
        "and give both recordings"
    )


def _words(group: tuple[int, ...]) -> str:
    return PARAMETERS[group[0]].words.split(",")[0]


def _shown(k: int, value: float | None = None) -> str:
    parameter = PARAMETERS[k]
    return f"{(parameter.limit if value is None else value) * parameter.shown:.3g} {parameter.unit}"
