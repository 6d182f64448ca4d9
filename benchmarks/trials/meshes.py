"""Error against run time of the meshes that STL, 3MF and GLB are written from, over the kernel's two tolerances."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Pnt
from OCP.TopLoc import TopLoc_Location

from scanwright.cad.geometry.mesh import CHORD_ANGLE, CHORD_ERROR
from scanwright.design.accuracy.trials import Trial, timed

CHORDS = 0.1, CHORD_ERROR, 0.001  # mm
ANGLES = 0.5, 0.2, CHORD_ANGLE, 0.05  # rad


def mesh_trials(solids: Mapping[str, cq.Solid], progress: Callable[[str], None]) -> Iterator[Trial]:
    """Yield a trial of all parts for each pair of tolerances; the error is the largest distance to the surface."""
    for angle in ANGLES:
        for chord in CHORDS:
            progress(f"meshes within {chord:g} mm and {angle:g} rad")
            meshed, seconds = timed(partial(_all_meshed, list(solids.values()), chord, angle))
            trials = [_off(solid) for solid in meshed]
            triangles = sum(count for _, count in trials)
            yield Trial(
                choice="mesh of the parts",
                method=f"{angle:g} rad between neighbours",
                setting=f"{chord:g} mm",
                error=max(off for off, _ in trials),
                unit="mm",
                seconds=seconds,
                size=f"{triangles:,} triangles",
                chosen=(chord, angle) == (CHORD_ERROR, CHORD_ANGLE),
            )


def _all_meshed(solids: list[cq.Solid], chord: float, angle: float) -> list[cq.Solid]:
    copies = [solid.copy() for solid in solids]
    for copy in copies:
        BRepMesh_IncrementalMesh(copy.wrapped, chord, True, angle, False)
    return copies


def _off(solid: cq.Solid) -> tuple[float, int]:
    """Return the largest distance [mm] of a triangle's middle or sides to its surface, and the number of triangles."""
    worst, count = 0.0, 0
    for face in solid.Faces():
        place = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face.wrapped, place)
        count += mesh.NbTriangles()
        if face.geomType() == "PLANE":
            continue
        surface = BRep_Tool.Surface_s(face.wrapped)  # in space: the location of the face is included
        nodes = np.array([mesh.Node(i + 1).Transformed(place.Transformation()).Coord() for i in range(mesh.NbNodes())])
        at = np.array([mesh.UVNode(i + 1).Coord() for i in range(mesh.NbNodes())])
        corners = np.array([mesh.Triangle(i + 1).Get() for i in range(mesh.NbTriangles())]) - 1
        groups = [corners[:, which] for which in ([0, 1], [1, 2], [2, 0], [0, 1, 2])]
        middles = np.concatenate([nodes[group].mean(axis=1) for group in groups])
        places = np.concatenate([at[group].mean(axis=1) for group in groups])
        there = np.array([surface.Value(u, v).Coord() for u, v in places])
        at_most = np.linalg.norm(middles - there, axis=1)  # the nearest point of the surface may be another one
        for i in np.argsort(-at_most):
            if at_most[i] <= worst:
                break
            nearest = GeomAPI_ProjectPointOnSurf(gp_Pnt(*middles[i]), surface)
            worst = max(worst, min(at_most[i], nearest.LowerDistance() if nearest.NbPoints() else np.inf))
    return float(worst), count
