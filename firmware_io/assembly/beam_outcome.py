"""Classification of beams: a point, or the reason why not."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from jaxtyping import Bool, Float64, UInt8
from numpy import ndarray

from scanwright.design.arrays import Floats
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.echo import Echo
from scanwright.firmware_io.samples import Block, Scan, chosen_echo, echo_count


class Verdict(IntEnum):
    """POINT, or the reason why a beam has none: the first that applies, from top to bottom."""

    POINT = 0
    NO_RETURN = 1  # NaN, +inf (REP 117), or 0 of some drivers
    TOO_NEAR = 2  # below range_min, or -inf (REP 117)
    TOO_FAR = 3  # above range_max
    OUTSIDE_JOINT_LOG = 4
    OWN_BODY = 5
    OUTSIDE_POSES = 6
    BETWEEN_SURFACES = 7  # half on a near surface, half on a far one; only on request
    OTHER_ECHO = 8  # not the chosen echo of its ray; only on request


def beam_verdicts(
    scan: Scan, joint_rad: Float64[ndarray, " n"], own_body: OwnBody | None = None, gamma_rot_rad: float = 0.0
) -> UInt8[ndarray, " n"]:
    """Return a `Verdict` for each beam from its range and axis angle, shape (n,).

    `joint_rad` is NaN if unknown; `gamma_rot_rad` is the axis angle at joint position 0, for the self-occlusion mask.
    """
    range_m = scan.range_m
    verdict = np.select(
        [
            np.isnan(range_m) | np.isposinf(range_m) | (range_m == 0),
            range_m < np.float32(scan.range_min_m),
            range_m > np.float32(scan.range_max_m),
            np.isnan(joint_rad),
        ],
        [Verdict.NO_RETURN, Verdict.TOO_NEAR, Verdict.TOO_FAR, Verdict.OUTSIDE_JOINT_LOG],
        Verdict.POINT,
    ).astype(np.uint8)
    if own_body is not None:
        hides = own_body.hides(scan.bearing_rad, joint_rad + gamma_rot_rad)
        verdict[(verdict == Verdict.POINT) & hides] = Verdict.OWN_BODY
    return verdict


def other_echoes(block: Block, echo: Echo) -> Bool[ndarray, "scans beams"]:
    """Return which beams are not the chosen echo of their ray; none for `all` or rays with one echo."""
    echoes = echo_count(block.first)
    other = np.zeros(block.range_m.shape, bool)
    if echo != "all" and echoes > 1:
        rays = (len(other), -1, echoes)
        lit = block.intensity.reshape(rays) if block.intensity.size else np.empty((*rays[:2], 0))
        chosen = chosen_echo(block.range_m.reshape(rays), lit, echo)
        other.reshape(rays)[:] = np.arange(echoes) != chosen[..., np.newaxis]
    return other


def between_surfaces(block: Block, grazing_deg: float) -> Bool[ndarray, "scans beams"]:
    """Return mixed pixels: beams whose spot was partly on a near surface and partly on a far one.

    Such a beam has a nearer neighbour on one side and a farther one on the other, and the lines to both are within
    `grazing_deg` of the beam itself. This also drops surfaces at such a grazing angle.
    """
    echoes, bearing_rad = echo_count(block.first), block.first.bearing_rad  # neighbours are the same echoes
    step_rad = abs(bearing_rad[echoes] - bearing_rad[0]) if echoes > 1 else abs(block.first.angle_increment_rad)
    r = np.where(np.isfinite(block.range_m) & (block.range_m > 0), block.range_m, np.nan).astype(np.float64)
    here, left, right = r[:, echoes:-echoes], r[:, : -2 * echoes], r[:, 2 * echoes :]
    grazing_rad = np.radians(grazing_deg)

    def slant_rad(neighbour_m: Floats) -> Floats:  # between the beam back to the sensor and the line to a neighbour
        return np.arctan2(neighbour_m * np.sin(step_rad), here - neighbour_m * np.cos(step_rad))

    nearer = [slant_rad(side) < grazing_rad for side in (left, right)]
    farther = [slant_rad(side) > np.pi - grazing_rad for side in (left, right)]
    between = np.zeros(r.shape, bool)
    between[:, echoes:-echoes] = (nearer[0] & farther[1]) | (nearer[1] & farther[0])
    return between
