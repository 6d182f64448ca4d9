"""The scene of each assembly step: present bodies, new bodies, their direction, and their screws.

A step is on the scanner, or on the bench, for an assembly that is later inserted as one piece.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.steps import steps_of
from scanwright.cad.layout.joints import ALL_SCREWS, Joint, screws
from scanwright.cad.layout.names import DECK, FIXED_CABLES, LIDAR, LIDAR_BODY, ROTOR_LEADS
from scanwright.cad.layout.rotor.counterweight import Counterweight
from scanwright.cad.parts.part_spec import Step
from scanwright.design.arrays import Rotation, Vector


@dataclass(frozen=True, slots=True)
class StepScene:
    """One step."""

    thing: str  # part or product that it adds
    step: Step  # its text
    # that it closes, each with its mark in the text; an empty mark if the text has none
    joints: tuple[tuple[Joint, str], ...]
    there: tuple[str, ...]  # present bodies, in alphabetical order
    comes: tuple[str, ...]  # new bodies
    against: tuple[str, ...]  # those of them that come from the opposite side
    along: Vector  # unit vector, rotation frame, from which they come; 0 for cables, which are shown in place
    R_rot_picture: Rotation  # the frame that is upright in the picture: the lidar's, or the rotation frame


def scenes_of(assembly: Assembly, joints: Sequence[Joint]) -> list[StepScene]:
    """Return all steps in order; every joint is in one of them, and the last one has those that no text names."""
    steps = steps_of(assembly)
    present: set[str] = set()
    benches: list[set[str]] = []
    scenes = []
    for (thing, step), own in zip(steps, _closed(steps, joints), strict=True):
        ready = _bench_of({thing}, benches)
        comes = {thing, *step.brings} | ready
        joined = {assembly.thing(body) for joint, _ in own for body in (joint.part, joint.onto)} - {DECK}
        neighbours = joined - comes
        if neighbours & present:
            comes |= _bench_of(neighbours, benches)
            neighbours -= comes
        alone = bool(own and present and not neighbours and not ready)
        on_bench = alone or bool(neighbours - present)
        there = (neighbours | _bench_of(neighbours, benches)) if on_bench else present
        scenes.append(_scene(assembly, thing, step, own, there, comes))
        benches = [bench for bench in benches if not bench & (there | comes)]
        if on_bench:
            benches.append(there | comes)
        else:
            present = present | comes
    return scenes


def _bench_of(things: set[str], benches: Sequence[set[str]]) -> set[str]:
    """Return everything on the bench that is joined to some things."""
    return {other for bench in benches if bench & things for other in bench}


def _closed(steps: Sequence[tuple[str, Step]], joints: Sequence[Joint]) -> list[tuple[tuple[Joint, str], ...]]:
    """Return for each step the joints whose screws its text names, and the marks."""
    seat = next((joint.part for joint in joints if joint.onto == LIDAR_BODY), "")
    left = list(joints)
    closed = []
    for thing, step in steps:
        carrier = seat if thing == LIDAR else thing
        own = []
        for joint in list(left):
            marks = [screws(joint.onto, joint.part)]
            marks += [screws(joint.onto), ALL_SCREWS] if joint.part == carrier else []
            place = next((mark for mark in marks if mark in step.words), None)
            if place is not None:
                own.append((joint, place))
                left.remove(joint)
        closed.append(tuple(own))
    if left:
        closed[-1] += tuple((joint, "") for joint in left)
    return closed


def _scene(
    assembly: Assembly, thing: str, step: Step, own: tuple[tuple[Joint, str], ...], there: set[str], comes: set[str]
) -> StepScene:
    if not there and comes - {thing}:  # the first of all
        there, comes = {thing}, comes - {thing}
    along, R = _from(assembly, thing, there, comes)
    names = sorted((*assembly.made, *assembly.bought))
    present, come = (tuple(name for name in names if assembly.thing(name) in things) for things in (there, comes))
    against = tuple(name for name in come if name in assembly.bodies and assembly.bodies[name].from_below)
    return StepScene(thing, step, own, present, come, against if thing not in comes else (), along, R)


def _from(assembly: Assembly, thing: str, there: set[str], comes: set[str]) -> tuple[Vector, Rotation]:
    """Return the direction it comes from: as in the exploded view, from below if all present bodies are above it."""
    lifted = "lidar" if thing == LIDAR else assembly.parts[thing].lifted if thing in assembly.parts else "axis"
    R = assembly.layout.stack.R()
    if thing in (ROTOR_LEADS, FIXED_CABLES):
        return np.zeros(3), np.eye(3)
    if lifted == "lidar":
        return R[:, 2], R
    bar = assembly.layout.counterweight
    if lifted == "deck":
        return -np.array(assembly.layout.deck.normal), np.eye(3)
    if lifted == "radius" and isinstance(bar, Counterweight):
        return np.array([math.cos(bar.ear.azimuth), math.sin(bar.ear.azimuth), 0.0]), np.eye(3)
    order = {name: i for i, name in enumerate(assembly.layout.drive.stacked)}
    below = [order[name] for name in comes if name in order]
    above = [order[name] for name in there if name in order]
    up = -1.0 if below and above and max(below) < min(above) else 1.0
    return np.array([0.0, 0.0, up]), np.eye(3)
