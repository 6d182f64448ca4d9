"""Beam density of one full turn: number of beams within a ball about a direction.

If the axis turns at constant speed, the mean density depends on the polar angle t about the axis only. The scan plane
determines polar angle t_b and azimuth p_b of each beam in the rotation frame. Beam b lies within the ball of radius
rho at polar angle t over the azimuth half-width `delta_b`,

    cos(rho) = cos(t) cos(t_b) + sin(t) sin(t_b) cos(delta_b),

so its count at azimuth p is the number of lines in [p - p_b - delta_b, p - p_b + delta_b], and `count * delta_b / pi`
in the mean over the start phase of the turn (docs/definitions.md, Density).
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
from scanwright.design.density.phase_walk import (
    even_statistics,
    half_angles,
    kernel_inputs,
    mean_counts,
    seam_statistics,
)
from scanwright.design.density.value_table import with_value_table

EXACT_TURN = 1e-9  # of a step: closer to an integer number of steps, a turn has no seam


@dataclass(frozen=True, slots=True)
class PhaseStatistics:
    """Statistics of the count over the start phase, at n polar angles or directions."""

    mean_g: Float[ndarray, " n"]  # mean over the start phase of g of the true count
    mean: Float[ndarray, " n"]  # mean count
    least: Float[ndarray, " n"]  # lowest count at any phase
    most: Float[ndarray, " n"]  # highest count at any phase; 0 is blind

    def of(self, some: slice) -> PhaseStatistics:
        """Return the statistics of a part of the angles."""
        return PhaseStatistics(self.mean_g[some], self.mean[some], self.least[some], self.most[some])


def mean_count(
    polar_rad: Float[ndarray, " n"], beam_polar_rad: Float[ndarray, " beams"], lines: ScanLines, ball_rad: float
) -> Float[ndarray, " n"]:
    """Return the mean count of beams within a ball over the start phase at polar angles t, shape (n,); closed form."""
    beams = np.sort(beam_polar_rad)
    parts = in_chunks(lambda chunk: mean_counts(*kernel_inputs(polar_rad[chunk], beams, ball_rad)), len(polar_rad))
    return lines.repeats * lines.count * np.concatenate(parts)


def phase_statistics(
    polar_rad: Float[ndarray, " n"],
    beam_polar_rad: Float[ndarray, " beams"],
    beam_azimuth_rad: Float[ndarray, " beams"],
    lines: ScanLines,
    ball_rad: float,
    g: Callable[[Counts], Array],
    until_rad: Float[ndarray, " n"] | None = None,
) -> PhaseStatistics:
    """Return exact statistics of the count over the start phase at polar angles about the axis.

    `g` is a function of the count, element by element. With `until_rad`, the other ends of ranges that begin at
    `polar_rad`, `least` is a lower bound of the lowest count in each range, and the others have no meaning.
    """
    order = np.argsort(beam_polar_rad, kind="stable")
    polar_b, azimuth_b = beam_polar_rad[order], beam_azimuth_rad[order] % (2 * np.pi)
    turn = 2 * np.pi / lines.step_rad
    even = abs(turn - lines.count) < EXACT_TURN
    beam_steps = azimuth_b / lines.step_rad

    def statistics(which: Ints, table: Array) -> tuple[Array, Array, Array, Array, Ints]:
        ends, polar, beams, ball = kernel_inputs(polar_rad[which], polar_b, ball_rad)
        if until_rad is not None:
            polar = np.concatenate([polar, half_angles(until_rad[which])])
        if even:
            return even_statistics(ends, polar, beams, ball, beam_steps, lines.count, table)
        return seam_statistics(ends, polar, beams, ball, beam_steps, turn, table)

    mean_g, mean, least, most = with_value_table(statistics, len(polar_rad), g, lines.repeats, smallest=512)
    return PhaseStatistics(mean_g, lines.repeats * mean, lines.repeats * least, lines.repeats * most)


def ball_search(
    beams: Float[ndarray, "beams 3"], directions: Float[ndarray, "n 3"], ball_rad: float
) -> Int[ndarray, " n"]:
    """Return the number of `beams` within `ball_rad` of each direction, by a KD-tree (paper, section 4.2)."""
    from scipy.spatial import cKDTree  # a slow import that no search needs

    chord = 2 * np.sin(ball_rad / 2)
    return cKDTree(beams).query_ball_point(directions, chord, return_length=True, workers=-1)
