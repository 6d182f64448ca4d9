"""Printed parts together on the bed: `print/plate_<number>.3mf` and a picture of each plate.

Rows of boxes, the deepest at the back: each part lies in its own pose, moved along the bed only.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from PIL import ImageDraw, ImageFont

from scanwright.cad.files.manual.painter import Piece, painted, png_bytes
from scanwright.cad.files.threemf import threemf_bytes
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.design.scene.parallel_view import view_of
from scanwright.design.scene.ray_caster import build_scene

Plate = dict[str, TriMesh]

GAP_MM = 8.0  # between two parts, for a brim on both
EDGE_MM = 5.0  # of the bed, for clips and skirts
SIZE_PX = 640, 480  # pixels, wide and high
YAW_RAD, PITCH_RAD = math.radians(-75.0), math.radians(60.0)
MARGIN = 1.04
SLAB_MM = 2.0  # drawn below the parts as the bed
BED, PART = np.array([232.0, 232.0, 229.0]), np.array([226.0, 112.0, 30.0])
INK, LIGHT, TEXT_PX = (20, 20, 20), (255, 255, 255), 15


def plates_of(printed: Mapping[str, TriMesh], bed_mm: tuple[float, float, float]) -> list[Plate]:
    """Distribute parts in their print pose over few beds, in rows; a part larger than a bed gets a separate one."""
    sizes = {name: np.ptp(mesh.vertices, axis=0) for name, mesh in printed.items()}
    order = sorted(printed, key=lambda name: (-round(float(sizes[name][1]), 3), -round(float(sizes[name][0]), 3), name))
    rows: list[tuple[float, list[str]]] = []  # width left, and its parts
    for name in order:
        wide = float(sizes[name][0]) + GAP_MM
        fitting = next((i for i, (left, _) in enumerate(rows) if left >= wide), None)
        if fitting is None:
            rows.append((bed_mm[0] - 2 * EDGE_MM + GAP_MM - wide, [name]))
        else:
            rows[fitting] = rows[fitting][0] - wide, [*rows[fitting][1], name]
    plates: list[tuple[float, list[list[str]]]] = []
    for _, names in rows:
        deep = float(max(sizes[name][1] for name in names)) + GAP_MM
        fitting = next((i for i, (left, _) in enumerate(plates) if left >= deep), None)
        if fitting is None:
            plates.append((bed_mm[1] - 2 * EDGE_MM + GAP_MM - deep, [names]))
        else:
            plates[fitting] = plates[fitting][0] - deep, [*plates[fitting][1], names]
    return [_laid(printed, sizes, names[::-1], bed_mm) for _, names in plates]


def plate_files(
    plates: Sequence[Plate], bed_mm: tuple[float, float, float], about: str, settings: Mapping[str, str]
) -> dict[str, bytes]:
    """Return the print file and picture of each plate; `about` describes the parts, `settings` are a slicer's."""
    files = {}
    for number, plate in enumerate(plates, start=1):
        name = f"plate_{number}"
        files[f"print/{name}.3mf"] = threemf_bytes(plate, name, f"{about}, as they lie on the bed", settings)
        files[f"print/{name}.png"] = _picture(plate, bed_mm)
    return files


def _laid(
    printed: Mapping[str, TriMesh],
    sizes: Mapping[str, np.ndarray],
    rows: Sequence[Sequence[str]],
    bed_mm: tuple[float, float, float],
) -> Plate:
    """Return the parts of one plate, row after row, in the middle of the bed."""
    deep = [float(max(sizes[name][1] for name in names)) for names in rows]
    y = (bed_mm[1] - sum(deep) - GAP_MM * (len(rows) - 1)) / 2
    plate = {}
    for names, depth in zip(rows, deep, strict=True):
        x = (bed_mm[0] - sum(float(sizes[name][0]) for name in names) - GAP_MM * (len(names) - 1)) / 2
        for name in names:
            vertices = printed[name].vertices
            corner = np.array([x, y, 0.0]) - [*vertices.min(axis=0)[:2], 0.0]
            plate[name] = TriMesh(np.round(vertices + corner, 5) + 0.0, printed[name].faces)
            x += float(sizes[name][0]) + GAP_MM
        y += depth + GAP_MM
    return plate


def _picture(plate: Plate, bed_mm: tuple[float, float, float]) -> bytes:
    """Return the PNG of a plate from the front and above, with the names of its parts."""
    scenes = [build_scene(mesh.vertices[mesh.faces] / 1000, name) for name, mesh in plate.items()]
    corners = np.array([[x, y, -SLAB_MM] for x, y in ((0, 0), (bed_mm[0], 0), bed_mm[:2], (0, bed_mm[1]))])
    bed, unmoved = build_scene(corners[[[0, 1, 2], [0, 2, 3]]] / 1000), np.zeros(3)
    pieces = [Piece(bed, unmoved, BED), *(Piece(scene, unmoved, PART) for scene in scenes)]
    corners = np.concatenate([piece.scene.triangles_m.reshape(-1, 3) for piece in pieces])
    view = view_of(corners, SIZE_PX, YAW_RAD, PITCH_RAD, MARGIN)
    image = painted(view, pieces)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(TEXT_PX)
    for name, scene in zip(plate, scenes, strict=True):
        seen = view.at(scene.triangles_m.reshape(-1, 3))
        at = ((seen[:, 0].min() + seen[:, 0].max()) / 2, seen[:, 1].max() + TEXT_PX)
        pen.text(at, name, fill=INK, font=font, anchor="mm", stroke_width=3, stroke_fill=LIGHT)
    return png_bytes(image)
