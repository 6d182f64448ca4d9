"""Worlds of the gallery: what stands around each scanner, in metres, x ahead, z up, the ground at z = 0."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import trimesh

from benchmarks.scanwright.robot_picture import box, surroundings
from scanwright.design.arrays import Array

SEED = 7


def lobby() -> list[trimesh.Trimesh]:
    """A room 2.5 m high with a door, a desk, a lamp and cables on the floor; below the scanner a quadruped."""
    lamp = trimesh.creation.cylinder(0.25, segment=[[1.2, 0.3, 2.3], [1.2, 0.3, 2.42]])
    cable = [box((0.5, 0.02, 0.02), (1.2 + 0.45 * k, 0.25 * (-1) ** k, 0.01), 40 * (-1) ** k) for k in range(5)]
    return [
        *_room((-2.5, 5.0), (-2.2, 2.4), 2.5),
        box((0.05, 0.9, 2.0), (4.97, -1.0, 1.0)),
        box((0.7, 1.4, 0.03), (3.4, 1.5, 0.73)),
        *(box((0.04, 0.04, 0.72), (3.4 + x, 1.5 + y, 0.36)) for x in (-0.3, 0.3) for y in (-0.65, 0.65)),
        box((0.7, 0.35, 0.24), (-0.25, 0, 0.25)),
        *(box((0.06, 0.06, 0.26), (-0.25 + x, y, 0.13)) for x in (-0.3, 0.3) for y in (-0.15, 0.15)),
        lamp,
        *cable,
    ]


def gallery_of_a_mine() -> list[trimesh.Trimesh]:
    """A tunnel of rough rock, 4 m wide, 3 m high and 30 m long, with rails, a pipe, props and fallen stones."""
    rng = np.random.default_rng(SEED)
    along, around = np.linspace(-15, 15, 301), np.linspace(-1.2, np.pi + 1.2, 72)
    bumps = _smooth(rng.normal(0, 1, (len(along), len(around))), 6) * 0.45
    x = np.broadcast_to(along[:, None], bumps.shape)
    y = (2.0 + bumps) * np.cos(around)
    z = np.maximum(1.1 + (1.9 + bumps) * np.sin(around), 0.04 * bumps)
    stones = []
    for _ in range(40):
        stone = trimesh.creation.icosphere(1, rng.uniform(0.04, 0.18))
        stone.apply_scale(rng.uniform(0.6, 1.4, 3))
        stone.apply_translation([rng.uniform(-8, 8), rng.choice([-1, 1]) * rng.uniform(0.9, 1.6), 0.03])
        stones.append(stone)
    rails = [box((30, 0.06, 0.12), (0, side, 0.06)) for side in (-0.38, 0.38)]
    sleepers = [box((0.18, 1.1, 0.05), (float(place), 0, 0.025)) for place in np.arange(-14.5, 15, 0.8)]
    pipe = trimesh.creation.cylinder(0.09, segment=[[-15, 1.55, 2.1], [15, 1.55, 2.1]])
    props = [box((0.15, 0.15, 3.0), (place, -1.6, 1.4)) for place in (-6.0, -2.5, 2.5, 6.0)]
    return [_sheet(x, y, z), box((31, 5, 0.1), (0, 0, -0.06)), *stones, *rails, *sleepers, pipe, *props]


def forest() -> list[trimesh.Trimesh]:
    """A plot of 24 m with rolling ground, sixty leaning stems with their taper, some crowns, and logs."""
    rng = np.random.default_rng(SEED)
    across = np.linspace(-14, 14, 113)
    x, y = np.meshgrid(across, across, indexing="ij")
    z = 0.25 * np.sin(0.4 * x) * np.cos(0.33 * y) + _smooth(rng.normal(0, 1, x.shape), 2) * 0.2
    z -= z[56, 56]
    bodies = [_sheet(x, y, z)]
    while len(bodies) < 61:
        foot = rng.uniform(-12, 12, 2)
        if np.hypot(*foot) < 1.5:
            continue
        tall, thick, lean = rng.uniform(7, 13), rng.uniform(0.08, 0.22), rng.normal(0, 0.05, 2)
        stem = trimesh.creation.cone(thick, tall, sections=20)
        stem.vertices[:, :2] += lean * stem.vertices[:, 2:]
        stem.apply_translation([*foot, -0.4])
        bodies.append(stem)
    for stem in bodies[1::4]:
        crown = trimesh.creation.icosphere(3, rng.uniform(1.0, 1.8))
        crown.vertices *= 1 + 0.25 * rng.normal(0, 1, (len(crown.vertices), 1))
        crown.apply_translation([*stem.bounds.mean(axis=0)[:2], stem.bounds[1, 2] - 2.0])
        bodies.append(crown)
    logs = [
        trimesh.creation.cylinder(0.14, segment=[[a, b, 0.1], [a + 2.5, b + 1, 0.15]]) for a, b in ((2, -3), (-5, 2))
    ]
    return [*bodies, *logs]


def hall() -> list[trimesh.Trimesh]:
    """A hall 12 x 9 m, its ceiling 5.2 m up with the scanner just below it: machines, a conveyor, racks, people."""
    machines = [
        box((2.0, 1.2, 1.6), (2.5, 2.2, 0.8)),
        box((0.8, 1.2, 2.3), (4.2, 2.2, 1.15)),
        box((1.6, 1.0, 1.1), (-3.0, -2.6, 0.55), 12),
        box((6.0, 0.7, 0.8), (0.5, -0.6, 0.4)),
    ]
    racks = [box((0.8, 2.6, 0.05), (-5.2, y, z)) for y in (-1.5, 2.0) for z in (0.3, 1.2, 2.1, 3.0)]
    goods = [box((0.4, 0.5, 0.5), (0.8 * k - 1.6, -0.6, 1.05), 7 * k) for k in range(5)]
    people = [_person(place) for place in ((0.8, 1.2), (-2.2, 0.8), (3.5, -2.4))]
    return [*_room((-6.0, 6.0), (-4.5, 4.5), 5.2), *machines, *racks, *goods, *(part for one in people for part in one)]


def stairwell() -> list[trimesh.Trimesh]:
    """Nine steps of 17 by 28 cm that begin 0.8 m ahead, a landing, side walls, and a railing."""
    steps = [box((0.28, 1.4, 0.17 * (k + 1)), (0.94 + 0.28 * k, 0, 0.085 * (k + 1))) for k in range(9)]
    landing = box((1.4, 1.4, 1.53), (0.8 + 9 * 0.28 + 0.7, 0, 0.765))
    posts = [
        trimesh.creation.cylinder(
            0.015, segment=[[0.94 + 0.56 * k, 0.6, 0.34 * k], [0.94 + 0.56 * k, 0.6, 0.34 * k + 1]]
        )
        for k in range(5)
    ]
    rail = trimesh.creation.cylinder(0.02, segment=[[0.94, 0.6, 1.0], [3.18, 0.6, 2.36]])
    return [*_room((-1.2, 4.8), (-0.72, 0.72), 4.0), *steps, landing, *posts, rail]


def rack() -> list[trimesh.Trimesh]:
    """A shelf 3 m wide and 2.2 m high, 1.2 m ahead, with boxes, tins and gaps where something is missing."""
    rng = np.random.default_rng(SEED)
    boards = [box((0.4, 3.0, 0.025), (1.4, 0, z)) for z in (0.1, 0.65, 1.2, 1.75, 2.2)]
    sides = [box((0.4, 0.03, 2.2), (1.4, y, 1.1)) for y in (-1.5, -0.5, 0.5, 1.5)]
    goods = []
    for z in (0.1125, 0.6625, 1.2125, 1.7625):
        y = -1.4
        while y < 1.3:
            wide, deep, tall = rng.uniform(0.08, 0.3), rng.uniform(0.15, 0.35), rng.uniform(0.12, 0.38)
            if abs(y + wide / 2 - round(y + wide / 2 - 0.5) - 0.5) > wide / 2 + 0.02 and rng.uniform() < 0.85:
                goods.append(box((deep, wide, tall), (1.22 + deep / 2, y + wide / 2, z + tall / 2)))
            y += wide + 0.03
    return [*_room((-1.5, 1.65), (-2.2, 2.2), 2.6), *boards, *sides, *goods]


def landing_place() -> list[trimesh.Trimesh]:
    """A pad 3 m wide on gravel, seen from 4 m up: its rim, a toolbox that was left, a hose, a person beside it."""
    rng = np.random.default_rng(SEED)
    across = np.linspace(-6, 6, 161)
    x, y = np.meshgrid(across, across, indexing="ij")
    pad = trimesh.creation.cylinder(1.5, segment=[[0, 0, 0.0], [0, 0, 0.12]], sections=64)
    stripe = [
        box(size, place)
        for size, place in (((1.2, 0.12, 0.03), (0, 0.35, 0.13)), ((1.2, 0.12, 0.03), (0, -0.35, 0.13)))
    ]
    turns = np.linspace(0, 5, 60)
    hose = [[1.9 + 0.3 * np.cos(t), -1.4 + 0.15 * t + 0.3 * np.sin(t), 0.03] for t in turns]
    links = [trimesh.creation.cylinder(0.03, segment=[a, b], sections=10) for a, b in pairwise(hose)]
    toolbox = box((0.45, 0.22, 0.22), (0.6, 0.9, 0.23), 30)
    legs = [box((0.05, 0.05, 0.7), (place, -2.3, 0.35)) for place in (-1.0, -0.2)]
    table = box((1.0, 0.6, 0.04), (-0.6, -2.3, 0.72))
    gravel = _sheet(x, y, _smooth(rng.normal(0, 1, x.shape), 1) * 0.06 - 0.03)
    return [gravel, pad, *stripe, *links, toolbox, *legs, table, *_person((-1.6, 1.9))]


def yard() -> list[trimesh.Trimesh]:
    """Flat ground with boxes, posts, a beam and stairs, as under the robot of README."""
    return surroundings()


def _room(x: tuple[float, float], y: tuple[float, float], high: float) -> list[trimesh.Trimesh]:
    """Floor, ceiling and four walls, each 10 cm thick."""
    middle, size = ((x[0] + x[1]) / 2, (y[0] + y[1]) / 2), (x[1] - x[0], y[1] - y[0])
    levels = [box((*size, 0.1), (*middle, level)) for level in (-0.05, high + 0.05)]
    ends = [box((0.1, size[1], high), (x[0] - 0.05 if k == 0 else x[1] + 0.05, middle[1], high / 2)) for k in (0, 1)]
    flanks = [box((size[0], 0.1, high), (middle[0], y[0] - 0.05 if k == 0 else y[1] + 0.05, high / 2)) for k in (0, 1)]
    return [*levels, *ends, *flanks]


def _person(place: tuple[float, float]) -> list[trimesh.Trimesh]:
    x, y = place
    legs = [trimesh.creation.cylinder(0.08, segment=[[x, y + side, 0], [x, y + side, 0.85]]) for side in (-0.1, 0.1)]
    body = trimesh.creation.capsule(0.55, 0.18)
    body.apply_translation([x, y, 0.9])
    head = trimesh.creation.icosphere(2, 0.12)
    head.apply_translation([x, y, 1.68])
    return [*legs, body, head]


def _sheet(x: Array, y: Array, z: Array) -> trimesh.Trimesh:
    """A surface over a grid of points, each of shape (rows, columns)."""
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return trimesh.Trimesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, process=False)


def _smooth(values: Array, times: int) -> Array:
    """Neighbours averaged so often, and the spread made 1/2 of what it was or less; edges stay."""
    for _ in range(times):
        values = (values + np.roll(values, 1, 0) + np.roll(values, -1, 0)) / 3
        values = (values + np.roll(values, 1, 1) + np.roll(values, -1, 1)) / 3
    return values
