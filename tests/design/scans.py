"""A full scan direction by direction, and the count of its beams by floor and ceil: what densities are held against."""

import numpy as np

from scanwright.design.density.beams import scan_at
from scanwright.design.density.phase_walk import half_angles, half_width


def simulated_scan(bearings_rad, lines, angles_rad, start_phase_rad=0.0):
    """Directions of one full scan in the world, shape (lines * beams, 3), line after line."""
    return scan_at(bearings_rad, lines.angles_rad + start_phase_rad, angles_rad)


def count_at(polar_rad, azimuth_rad, beam_polar_rad, beam_azimuth_rad, lines, ball_rad):
    """Beams within the ball about one direction of the rotation frame, first line at azimuth 0."""
    half = np.array(
        [half_width(*half_angles(polar_rad), *half_angles(b), *half_angles(ball_rad)) for b in beam_polar_rad]
    )
    seen = half >= 0
    first = (azimuth_rad - beam_azimuth_rad[seen] - half[seen]) % (2 * np.pi)
    last = first + 2 * half[seen]
    top = lines.count - 1
    before_seam = np.minimum(np.floor(last / lines.step_rad), top) - np.ceil(first / lines.step_rad) + 1
    behind_seam = np.minimum(np.floor((last - 2 * np.pi) / lines.step_rad), top) + 1
    counts = np.maximum(before_seam, 0) + np.maximum(behind_seam, 0)
    return int(np.where(half[seen] >= np.pi, lines.count, counts).sum())
