"""Room for screws, and straight lines for their keys."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np

from benchmarks.cad.outside.bodies import Array, StepBody, ring
from benchmarks.cad.outside.screws import HEADS_MM, STEP_MM, TIGHT_MM, WASHERS_MM, FoundScrew

# ISO 2936: width across flats, and length of the long arm, of the key of each ISO 4762 screw; ISO 4026 has smaller ones
KEYS_MM = {1.6: (1.5, 46.5), 2.0: (1.5, 46.5), 2.5: (2.0, 52.0), 3.0: (2.5, 58.5), 4.0: (3.0, 66.0), 5.0: (4.0, 74.0),
           6.0: (5.0, 85.0), 8.0: (6.0, 96.0)}  # fmt: skip
RIM_RAYS = 18
TURNS = 120  # angles of the rotor that are tried
SOFT = ("cable", "lead")  # what can be bent aside


def rigid(bodies: Mapping[str, StepBody], names: Collection[str]) -> list[StepBody]:
    """Return the named bodies that no finger bends aside."""
    return [bodies[name] for name in sorted(names) if name in bodies and not any(word in name for word in SOFT)]


def key_blocked(
    screw: FoundScrew, bodies: Mapping[str, StepBody], there: Collection[str], turning: Collection[str]
) -> str | None:
    """Return the body between the key and its screw at every angle of the rotor, None if the key reaches it."""
    flats, length = KEYS_MM[screw.written.size_mm]
    length = max(length, screw.written.blade_mm)
    head = STEP_MM + (0.0 if screw.written.holds == "grub" else HEADS_MM[screw.written.size_mm][1])
    rim = flats / np.sqrt(3) * ring(screw.along, RIM_RAYS)
    starts = screw.seat - head * screw.along + np.concatenate([np.zeros((1, 3)), rim])
    moves = screw.written.part in turning
    own = [body for body in rigid(bodies, there) if (body.name in turning) == moves]
    others = [body for body in rigid(bodies, there) if (body.name in turning) != moves]
    for body in own:
        if _hit(body, starts, -screw.along, length):
            return body.name
    first = None
    for turn in 2 * np.pi * np.arange(TURNS) / TURNS:
        R = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        blocks = next((body.name for body in others if _hit(body, starts @ R.T, -R @ screw.along, length)), None)
        if blocks is None:
            return None
        first = first or blocks
    return first


def _hit(body: StepBody, starts: Array, along: Array, length: float) -> bool:
    ends = np.concatenate([starts, starts + length * along])
    low, high = body.mesh.bounds
    if (ends.min(axis=0) > high).any() or (ends.max(axis=0) < low).any():
        return False
    distance, _ = body.first_hits(starts, np.broadcast_to(along, starts.shape))
    return bool((distance < length).any())


def collisions(screw: FoundScrew, bodies: Mapping[str, StepBody], there: Collection[str]) -> Iterator[str]:
    """Yield what the head or the shank of a screw cuts into, among the rigid bodies of its step."""
    if screw.written.holds == "grub":
        return
    diameter, height = HEADS_MM[screw.written.size_mm]
    washer = WASHERS_MM[screw.written.size_mm] if screw.written.washer else 0.0
    at_head = np.arange(-height, 0.0, STEP_MM) + STEP_MM / 2
    # the tip's last half millimetre is chamfered; the thread is cut into what holds it
    at_shank = np.arange(washer, screw.written.length_mm - 0.5, STEP_MM) + STEP_MM / 2
    for body in rigid(bodies, there):
        if (free := _least(body, screw, at_head)) < diameter / 2 - TIGHT_MM:
            yield f"its head has {free:.2f} of {diameter / 2:g} mm in {body.name}"
        if body.name == screw.written.onto and screw.written.holds in ("nut", "insert"):
            continue  # a device's ear is not bored in its model
        least = screw.written.size_mm / 2 * (0.76 if body.name == screw.written.onto else 1.0)
        if (free := _least(body, screw, at_shank)) < least - TIGHT_MM:
            yield f"its shank has {free:.2f} of {least:g} mm in {body.name}"


def _least(body: StepBody, screw: FoundScrew, t: Array) -> float:
    """Return the third least radius that a body leaves: rays in one of its faces hit anything."""
    return float(np.partition(body.free_radius(screw.seat, screw.along, t)[0], 2)[2])


def screw_points(screw: FoundScrew) -> Array:
    """Return points on what stands out of a screw's hole: its head, and a tip behind a loose nut; shape (n, 3)."""
    diameter, height = HEADS_MM[screw.written.size_mm]
    if screw.written.holds == "grub":
        diameter, height = screw.written.size_mm, 0.0
    around = ring(screw.along, 72)[None]
    rows = [(diameter / 2, z) for z in np.linspace(-height, 0.0, 20)]
    rows += [(r, -height) for r in np.linspace(0.0, diameter / 2, 8)]
    if screw.written.holds == "nut":
        rows += [(r, screw.written.length_mm) for r in np.linspace(0.0, screw.written.size_mm / 2, 5)]
    radius, along = np.array(rows).T[:, :, None, None]
    return (screw.seat + along * screw.along + radius * around).reshape(-1, 3)
