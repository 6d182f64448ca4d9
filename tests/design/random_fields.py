"""Random weights and masks for tests: all shapes of the task file, brush strokes, narrow and overlapping rectangles."""

from pathlib import Path

import numpy as np

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.sphere.regions import field_of
from scanwright.design.task.task import LoadedTask, Task


def field(weight, mask=(), maps=(), background=0.0):
    """A field from tables as a task file holds them; `maps` are the tables of the map regions, weights first."""
    task = Task.model_validate(
        {
            "name": "t",
            "sensor": "UTM-30LX",
            "servo": "MX-64R",
            "motion": {"period_s": 1.0},
            "weight": weight,
            "mask": mask,
            "density": {"background": background},
        }
    )
    return field_of(LoadedTask(task, Path(), load_catalogue(), tuple(maps)))


def random_region(rng, kind):
    value = round(float(rng.uniform(0, 3)), 3)
    if kind == "band":
        theta = np.sort(rng.uniform(0, 180, 2))
        if rng.random() < 0.3:
            theta[rng.integers(2)] = 0 if rng.random() < 0.5 else 180
        start = rng.uniform(-360, 360)
        phi = [start, start + rng.uniform(0, 360)] if rng.random() < 0.8 else [-180, 180]
        return {"shape": kind, "theta_deg": sorted(theta), "phi_deg": phi, "value": value}
    if kind == "cone":
        half = float(rng.uniform(1, 170))
        return {"shape": kind, "axis": rng.normal(size=3).tolist(), "half_angle_deg": half, "value": value}
    if kind == "map":
        return {"shape": kind, "file": "unused.npy", "value": value}
    return {"shape": kind, "value": value}


def random_case(seed):
    rng = np.random.default_rng(seed)
    weight = [random_region(rng, k) for k in rng.choice(["all", "band", "band", "cone", "map"], rng.integers(1, 5))]
    mask = [random_region(rng, k) for k in rng.choice(["band", "cone", "map"], rng.integers(0, 3))]
    maps = [
        rng.integers(0, 4, (rng.integers(1, 7), rng.integers(1, 10))).astype(float)
        for region in [*weight, *mask]
        if region["shape"] == "map"
    ]
    return weight, mask, maps, float(rng.choice([0.0, 0.25]))


def unit_vectors(rng, count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def strokes(rng, rows, columns):
    """A map as a brush paints it: discs of 5 to 25 deg, equal or unequal values, across poles and the seam."""
    theta, phi = np.meshgrid((np.arange(rows) + 0.5) * np.pi / rows, (np.arange(columns) + 0.5) * 2 * np.pi / columns)
    cells = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    table = np.zeros((columns, rows))
    for centre in unit_vectors(rng, rng.integers(1, 6)):
        table[cells @ centre >= np.cos(np.radians(rng.uniform(5, 25)))] = rng.choice([0.2, 0.5, 1.0])
    return table.T


def walls(rng, count):
    """Rectangles around the scanner, some so narrow that their corners are sharp."""
    return [
        {
            "shape": "ground",
            "height_m": rng.uniform(0.1, 2),
            "heading_deg": rng.uniform(-180, 180),
            "from_m": (near := rng.uniform(-3, 3)),
            "to_m": near + rng.uniform(0.05, 4),
            "width_m": rng.uniform(0.05, 20),
            "value": rng.uniform(0.1, 1),
        }
        for _ in range(count)
    ]


def random_field(seed):
    """Bands, cones and maps; brush strokes; rectangles; many rectangles."""
    rng = np.random.default_rng(seed)
    kind = seed % 4
    if kind == 0:
        return field(*random_case(seed))
    if kind == 1:
        rows = int(rng.choice([12, 24, 36]))
        hidden = [{"shape": "map", "file": "m.npy"}] if rng.random() < 0.5 else []
        maps = [strokes(rng, rows, 2 * rows) for _ in range(1 + len(hidden))]
        return field([{"shape": "map", "file": "w.npy"}], hidden, maps)
    return field(walls(rng, 2 if kind == 2 else 9))
