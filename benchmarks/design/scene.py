"""Error and speed of the ray caster beside trimesh's own (also on embree): `python -m benchmarks.design.scene [MESH]`.

The error is that of a million rays from all over a room of 10 x 8 x 3 m against the analytic ranges. The speed is that
of a million rays from one place in MESH, or in the room, as a ratio within one run (median of five, interleaved).
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from statistics import median

import numpy as np
import trimesh

from scanwright.design.scene.ray_caster import build_scene, cast, load_triangles

RAYS = 1_000_000
HALF_M = np.array([5.0, 4.0, 1.5])


def main() -> None:
    """Print one line for the error and one for the speed."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(RAYS, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    origins = rng.uniform(-0.99, 0.99, (RAYS, 3)) * HALF_M
    box = trimesh.creation.box(extents=2 * HALF_M)
    true_m = np.min((np.sign(directions) * HALF_M - origins) / directions, axis=1)
    found = cast(build_scene(np.array(box.triangles)), origins, directions)
    places, rows, _ = box.ray.intersects_location(origins, directions, multiple_hits=False)
    theirs_m = np.linalg.norm(places - origins[rows], axis=1)
    print(
        f"room: largest error {np.abs(found.range_m - true_m).max():.1e} m, {np.isinf(found.range_m).sum()} missed; "
        f"trimesh {np.abs(theirs_m - true_m[rows]).max():.1e} m, {RAYS - len(rows)} missed"
    )
    triangles = load_triangles(Path(sys.argv[1])) if len(sys.argv) > 1 else np.array(box.triangles)
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)
    scene, place = build_scene(triangles), np.broadcast_to(triangles.mean(axis=(0, 1)), directions.shape)
    ours_s, theirs_s = [], []
    for _ in range(5):
        start_s = time.perf_counter()
        cast(scene, place, directions)
        middle_s = time.perf_counter()
        mesh.ray.intersects_location(place, directions, multiple_hits=False)
        ours_s.append(middle_s - start_s)
        theirs_s.append(time.perf_counter() - middle_s)
    ratio = median(theirs_s) / median(ours_s)
    print(f"{len(triangles)} triangles: {RAYS / median(ours_s) / 1e6:.1f} million rays/s, {ratio:.1f} x trimesh")


if __name__ == "__main__":
    main()
