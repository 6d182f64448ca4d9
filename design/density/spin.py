"""Density of one full scan: beams within a ball about a direction. Closed form, exact counts, and the ball search.

With unlimited rotation at constant speed the density is zonal about the axis: all that a scan-plane setting decides
is the polar angle t_b and the azimuth p_b of each beam in the rotation frame. At polar angle t beam b meets the ball
of radius rho within the azimuth half-width `delta_b`,

    cos(rho) = cos(t) cos(t_b) + sin(t) sin(t_b) cos(delta_b),

so it adds as many counts at azimuth p as lines lie in [p - p_b - delta_b, p - p_b + delta_b], and
`count * delta_b / pi` in the mean over the start phase of the turn (docs/definitions.md, Density).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from scanwright.design.arrays import Array, Counts, Ints
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.density.beams import ScanLines
from scanwright.design.density.phase_walk import even_zones, halves, mean_counts, meetings, seam_zones
from scanwright.design.density.value_table import walked

EXACT_TURN = 1e-9  # relative gap difference below which the last gap counts as a full one


@dataclass(frozen=True, slots=True)
class Zones:
    """What is seen at polar angles t about the axis; every array has shape (len(t),).

    Attributes:
        mean_g: mean over the start phase of g of the true count.
        mean: mean count.
        least: lowest count at any phase.
        most: highest count at any phase; 0 is blind.
    """

    mean_g: Float[ndarray, " n"]
    mean: Float[ndarray, " n"]
    least: Float[ndarray, " n"]
    most: Float[ndarray, " n"]

    def of(self, some: slice) -> Zones:
        """What is seen at some of the angles."""
        return Zones(self.mean_g[some], self.mean[some], self.least[some], self.most[some])


def mean_count(
    polar_rad: Float[ndarray, " n"], beam_polar_rad: Float[ndarray, " beams"], lines: ScanLines, ball_rad: float
) -> Float[ndarray, " n"]:
    """Mean over the start phase of the beams within a ball at polar angles t, in closed form, shape (len(t),)."""
    beams = np.sort(beam_polar_rad)
    parts = in_chunks(lambda chunk: mean_counts(*meetings(polar_rad[chunk], beams, ball_rad)), len(polar_rad))
    return lines.repeats * lines.count * np.concatenate(parts)


def zones(
    polar_rad: Float[ndarray, " n"],
    beam_polar_rad: Float[ndarray, " beams"],
    beam_azimuth_rad: Float[ndarray, " beams"],
    lines: ScanLines,
    ball_rad: float,
    g: Callable[[Counts], Array],
    until_rad: Float[ndarray, " n"] | None = None,
) -> Zones:
    """Exact statistics over the start phase at polar angles t.

    The count changes by one where a line enters or leaves a beam's window. Between the lines the same steps come
    again, at most once broken by the seam of the turn (`design.density.phase_walk`).

    Args:
        polar_rad: polar angles t about the axis, shape (n,).
        beam_polar_rad: polar angle of each beam in the rotation frame, shape (beams,).
        beam_azimuth_rad: azimuth of each beam in the rotation frame, shape (beams,).
        lines: scan lines of the turn.
        ball_rad: ball radius.
        g: of counts of beams, element by element.
        until_rad: other ends of ranges that begin at `polar_rad`, shape (n,): then `least` is a lower bound of the
            lowest count in each range, and the rest has no meaning.
    """
    order = np.argsort(beam_polar_rad, kind="stable")
    polar_b, azimuth_b = beam_polar_rad[order], beam_azimuth_rad[order] % (2 * np.pi)
    turn = 2 * np.pi / lines.step_rad
    even = abs(turn - lines.count) < EXACT_TURN

    beam_steps = azimuth_b / lines.step_rad

    def walk(which: Ints, table: Array) -> tuple[Array, Array, Array, Array, Ints]:
        ends, polar, beams, ball = meetings(polar_rad[which], polar_b, ball_rad)
        if until_rad is not None:
            polar = np.concatenate([polar, halves(until_rad[which])])
        if even:
            return even_zones(ends, polar, beams, ball, beam_steps, lines.count, table)
        return seam_zones(ends, polar, beams, ball, beam_steps, turn, table)

    mean_g, mean, least, most = walked(walk, len(polar_rad), g, lines.repeats, smallest=512)
    return Zones(mean_g, lines.repeats * mean, lines.repeats * least, lines.repeats * most)


def ball_search(
    beams: Float[ndarray, "beams 3"], directions: Float[ndarray, "n 3"], ball_rad: float
) -> Int[ndarray, " n"]:
    """Beams within `ball_rad` of each direction, the paper's section 4.2: slow, obvious, the oracle of all else.

    Args:
        beams: unit vectors, shape (beams, 3).
        directions: unit vectors, shape (n, 3).
        ball_rad: angle on the sphere.

    Returns:
        Counts, shape (n,).
    """
    from scipy.spatial import cKDTree  # its import takes a third of a second, and no search asks for it

    chord = 2 * np.sin(ball_rad / 2)
    return cKDTree(beams).query_ball_point(directions, chord, return_length=True, workers=-1)
