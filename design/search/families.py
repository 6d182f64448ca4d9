"""Candidates: the local minima of coarse J, their exact scores, and their refinement to a short list of results."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Array, Setting
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import NODES
from scanwright.design.objective.score import Score
from scanwright.design.objective.tolerance import worst_within
from scanwright.design.progress import Progress, no_progress
from scanwright.design.search.coarse import Landscape
from scanwright.design.search.refinement import (
    INDIFFERENT,
    NARROW,
    WIDE,
    Descent,
    allowed_setting,
    buildable_setting,
    descend,
    descended,
)
from scanwright.design.search.space import SearchSpace
from scanwright.design.task.angle_ranges import NAMES

FAMILIES = 10
EQUAL = 1e-8  # rounding error of J of mounts that are equal by symmetry
SINGLE = 2e-6  # rounding error of the lowest values of a landscape, in single precision
MOST_RUNS = 0, 1, 16  # simplex runs from each minimum, by the rounds of refinement
VALLEY_J = 2e-2
NEAR_RAD = np.radians(12.5)  # axes that are closer and have nearly the same J are one result
PIECE = 128  # planes whose J are computed together
MOST_TRIES = 80  # local minima and slopes that are examined
MOST_REJECTED = 200  # mounts that meet a constraint at the nodes of the landscape, but break it between them


@dataclass(frozen=True, slots=True)
class Family:
    """A group of mounts of equal J, represented by the one that is easiest to build.

    Attributes:
        angles_deg: (alpha_rot, beta_rot, alpha_laser, beta_laser).
        score: its exact score.
        members: number of mounts of the grid in the group.
        word: description of the others.
    """

    angles_deg: tuple[float, float, float, float]
    score: Score
    members: int
    word: str

    @property
    def angles_rad(self) -> Setting:
        """The four angles in radians, shape (4,)."""
        return np.radians(self.angles_deg)

    def facts(self) -> dict[str, float]:
        """Return angles, J and its error by name, for JSON."""
        angles = {f"{name}_deg": angle for name, angle in zip(NAMES, self.angles_deg, strict=True)}
        return angles | {"J": self.score.J, "J_error": self.score.J_error}


@dataclass(frozen=True, slots=True)
class Candidate:
    """A group of mounts of equal coarse J, represented by the one that is easiest to build."""

    angles_deg: Setting  # (alpha_rot, beta_rot, alpha_laser, beta_laser)
    J_coarse: float  # coarse J
    score: Score | None  # exact score of a local minimum; None for a mount on the slope of a better one
    members: int  # number of mounts of the grid in the group
    axes: int  # number of their axes
    every_axis: bool  # whether these are all axes of the grid


def find_candidates(land: Landscape, space: SearchSpace) -> list[Candidate]:
    """Return the local minima of J that meet the constraints, lowest first, then mounts on their slopes.

    Mounts of equal J are one. The valley of a minimum is removed with it: mounts about nearly the same axis with nearly
    the same J, whatever their scan plane. Mounts that break a constraint between the nodes of the landscape are
    dropped.
    """
    planes, axes = land.space.planes, land.space.axes
    pieces = [slice(i, i + PIECE) for i in range(0, len(planes.first), PIECE)]
    J = np.concatenate([_feasible_J(land, piece) for piece in pieces])
    every = _distinct(axes.points)
    remaining = J.reshape(len(J), -1).copy()
    low = remaining.min(axis=1)  # of each plane
    q = planes.representatives
    cosines = axes.representatives @ axes.representatives.T
    next_to, opposite = cosines >= np.cos(NEAR_RAD), cosines <= -np.cos(NEAR_RAD)
    minima: list[Candidate] = []
    slopes: list[Candidate] = []
    tries = rejected = 0
    while tries < MOST_TRIES and rejected < MOST_REJECTED and len(minima) < FAMILIES:
        lowest = low.min()
        if not np.isfinite(lowest):
            break
        c = int((low <= lowest + EQUAL).argmax())
        orientation, axis = divmod(int((remaining[c] <= lowest + EQUAL).argmax()), J.shape[2])
        same = J[c] <= lowest + EQUAL
        around = np.stack([side[same[0]].any(axis=0) for side in (next_to, opposite)])
        around |= np.stack([side[same[1]].any(axis=0) for side in (opposite, next_to)])
        near = [
            np.ix_(np.linalg.norm(q - sign * q[c] @ mirror, axis=1) <= NEAR_RAD, there.ravel())
            for mirror in land.space.mirrors
            for sign, there in ((1, around), (-1, around[::-1]))
        ]
        beaten = any((J.reshape(remaining.shape)[block] < lowest - EQUAL).any() for block in near)
        candidate = _candidate(J[c], land, c, orientation, axis, every)
        exact = None if beaten else space.score(candidate.angles_deg)
        if not beaten and exact is None:
            J[c][same] = remaining[c][same.ravel()] = np.inf
            low[c] = remaining[c].min()
            rejected += 1
            continue
        tries += 1
        (slopes if beaten else minima).append(replace(candidate, score=exact))
        changed = low <= lowest + (EQUAL if beaten else VALLEY_J)
        if not beaten:
            block = np.ix_(changed, (around | around[::-1]).ravel())
            remaining[block] = np.where(remaining[block] <= lowest + VALLEY_J, np.inf, remaining[block])
        for block in near:
            remaining[block] = np.inf
            changed[block[0]] = True
        low[changed] = remaining[changed].min(axis=1)
    return minima + slopes


def best_candidate(land: Landscape, space: SearchSpace, feasible: bool = True) -> Candidate | None:
    """Return the lowest mount of a landscape that is exactly feasible; without `feasible`, the lowest of all.

    None if the lowest `MOST_REJECTED` all break a constraint between the nodes of the landscape.
    """
    lowest = (land.feasible if feasible else land.plain).by_plane.min(axis=0)
    rows: dict[int, Array] = {}
    every = _distinct(land.space.axes.points)
    rejected = 0
    while rejected < MOST_REJECTED and np.isfinite(lowest.min()):
        c = int((lowest <= lowest.min() + SINGLE).argmax())
        if c not in rows:
            rows[c] = _feasible_J(land, slice(c, c + 1), feasible)[0]
        J = rows[c]
        if J.min() > lowest[c] + SINGLE:  # the lowest of this plane was rejected
            lowest[c] = J.min()
            continue
        orientation, axis = np.unravel_index(int((J.min() + EQUAL >= J).argmax()), J.shape)
        candidate = _candidate(J, land, c, int(orientation), int(axis), every)
        exact = space.score(candidate.angles_deg)
        if exact is not None:
            return replace(candidate, score=exact)
        J[J.min() + EQUAL >= J] = np.inf
        lowest[c] = J.min()
        rejected += 1
    return None


def _feasible_J(land: Landscape, piece: slice, feasible: bool = True) -> Array:
    """Return coarse J of plane classes, (planes, 2, axes); inf for mounts outside the grid or the constraints."""
    planes, axes = land.space.planes, land.space.axes
    p = planes.has[:, piece, None]
    there = np.stack(
        [(p[0] & axes.has[orientation]) | (p[1] & axes.has[1 - orientation]) for orientation in (0, 1)], axis=1
    )
    return np.where(there & ~land.broken(piece) if feasible else there, land.about_axes(piece), np.inf)


def _distinct(points: Float[ndarray, "n 3"]) -> int:
    """Return the number of different points."""
    return len(np.unique(np.round(points, 9) + 0.0, axis=0))


def _candidate(J: Array, land: Landscape, plane: int, orientation: int, axis: int, every: int) -> Candidate:
    """Return the group of all mounts of the grid that equal J[orientation, axis] of a landscape by symmetry.

    `J` is that of a plane class about all axes; `orientation` is 1 if one of plane and axis is flipped; `every` is the
    number of different axes of the grid.
    """
    planes, axes = land.space.planes, land.space.axes
    same = np.abs(J - J[orientation, axis]) <= EQUAL
    p = np.flatnonzero(planes.classes == plane)
    orientations = planes.flip[p][:, None] ^ axes.flip[None, :]
    member = same[orientations.astype(int), axes.classes[None, :]]
    which_p, which_a = np.nonzero(member)
    angles = np.hstack([axes.settings_deg[which_a], planes.settings_deg[p[which_p]]])
    u = axes.points[which_a]
    distinct = _distinct(u)
    # easiest to build: upright rather than hanging, blind sector of the lidar to the servo, axis upright, small angles
    preference = (
        angles[:, 3],
        angles[:, 2],
        angles[:, 1],
        angles[:, 0],
        np.abs(angles[:, 2:]).sum(axis=1).round(6),
        np.abs(angles[:, :2]).sum(axis=1).round(6),
        -u[:, 2].round(6),
        angles[:, 3] > 0,
        u[:, 2] < -1e-9,
    )
    best = angles[np.lexsort(preference)[0]]
    any_axis = len(axes.settings_deg) > 1 and distinct == every
    return Candidate(best, float(J[orientation, axis]), None, len(angles), distinct, any_axis)


def refine_candidates(
    space: SearchSpace, candidates: list[Candidate], rounds: int = 2, progress: Progress = no_progress
) -> tuple[Family, ...]:
    """Return the refined minima, at most one in each valley, then mounts on slopes, which are not refined.

    One round is a simplex run from each minimum; with two, runs go on while J falls, and the best is refined finely.
    """
    minima = list({tuple(each.angles_deg): each for each in candidates if each.score is not None}.values())
    starts = [(candidate.angles_deg, candidate.every_axis) for candidate in minima]
    apart: list[Descent] = []
    for descent in descended(space, starts, MOST_RUNS[rounds], progress):
        if not any(same_valley(descent.angles_deg, descent.J, better.angles_deg, better.J) for better in apart):
            apart.append(descent)

    def finished(descent: Descent, nodes: int = WIDE.nodes) -> Family:
        return _finished(space, descent, minima[descent.start], nodes)

    parts = in_chunks(lambda some: [finished(descent) for descent in apart[some]], len(apart), smallest=1)
    ready = list(chain.from_iterable(parts))
    if MOST_RUNS[rounds] > 1:  # with a tolerance of the mounting the first run has the lowest J within it
        k = 0 if space.ranges.tolerance_deg else int(np.argmin([family.score.J for family in ready]))
        ready[k] = finished(descend(space, apart[k], NARROW), NARROW.nodes)
    families = list(joined(tuple(ready)))
    for candidate in candidates:
        if candidate.score is None and _is_apart(candidate.angles_deg, candidate.J_coarse, families):
            result = space.score(candidate.angles_deg)
            families += [] if result is None else [_family(candidate.angles_deg, result, candidate)]
    if space.ranges.tolerance_deg:
        return _by_the_worst(space, families)
    return tuple(sorted(families, key=lambda family: family.score.J))


def joined(*results: tuple[Family, ...]) -> tuple[Family, ...]:
    """Return the families of several results, at most one in each valley, the lowest J first."""
    families: list[Family] = []
    for family in sorted(chain.from_iterable(results), key=lambda family: family.score.J):
        if _is_apart(family.angles_deg, family.score.J, families):
            families.append(family)
    return tuple(families)


def same_valley(angles_deg: Setting, J: float, other_deg: Setting, other_J: float) -> bool:
    """Return whether two mounts have nearly the same axis and nearly the same J."""
    if not abs(J - other_J) <= VALLEY_J:
        return False
    u, v = (R_world_rot(*np.radians(each[:2]))[:, 2] for each in (angles_deg, other_deg))
    return bool(abs(u @ v) >= np.cos(NEAR_RAD))


def _is_apart(angles_deg: Array | tuple[float, ...], J: float, families: list[Family]) -> bool:
    """Return whether a mount is in no valley of the families, and there are fewer than `FAMILIES`."""
    known = any(same_valley(np.array(angles_deg), J, np.array(x.angles_deg), x.score.J) for x in families)
    return not known and len(families) < FAMILIES


def _finished(space: SearchSpace, descent: Descent, candidate: Candidate, nodes: int) -> Family:
    """Return a refined candidate, rounded and scored exactly; or the candidate itself if its J is as low."""
    exact = candidate.score
    assert exact is not None
    refined = buildable_setting(space, descent, nodes, candidate.angles_deg)
    refined, again = allowed_setting(space, refined, candidate.angles_deg)
    if again is None or (again.J + again.J_error + INDIFFERENT >= exact.J and not space.ranges.tolerance_deg):
        return _family(candidate.angles_deg, exact, candidate)
    return _family(refined, again, candidate)


def _by_the_worst(space: SearchSpace, families: list[Family]) -> tuple[Family, ...]:
    """Return families in the order of their highest J if one angle is off by the tolerance of the mounting."""
    off_deg = space.ranges.tolerance_deg
    worst = [worst_within(space.problem, family.angles_rad, np.radians(off_deg), NODES) for family in families]
    order = np.argsort(worst, kind="stable")
    text = [f"J <= {J:.4f} within {off_deg:g} deg" for J in worst]
    words = [", ".join(filter(None, [family.word, more])) for family, more in zip(families, text, strict=True)]
    return tuple(replace(families[i], word=words[i]) for i in order)


def _family(angles_deg: Array, exact: Score, candidate: Candidate) -> Family:
    word = "any axis" if candidate.every_axis else f"{candidate.axes} axes" if candidate.axes > 1 else ""
    a, b, c, d = (float(angle) for angle in angles_deg)
    return Family((a, b, c, d), exact, candidate.members, word)
