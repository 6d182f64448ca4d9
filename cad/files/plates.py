"""3MF of parts in their print pose; printed parts together on the bed: `print/plate_<number>.3mf`, and its picture.

Rows of boxes, the deepest at the back: each part lies in its own pose, moved along the bed only. A file also contains
the settings of PrusaSlicer (Metadata/Slic3r_PE_model.config), which other readers skip. Its entries are stored, not
deflated, with the zip format's first date: the output of a compressor depends on its version.
"""

import io
import math
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TypeVar
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from PIL import ImageDraw, ImageFont

from scanwright.cad.files.manual.pictures import Piece, painted, png_bytes
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.geometry.print_pose import PRINT_DECIMALS
from scanwright.design.scene.parallel_view import view_of
from scanwright.design.scene.ray_caster import build_scene

Plate = dict[str, TriMesh]
Thing = TypeVar("Thing")

GAP_MM = 8.0  # between two parts, for a brim on both
EDGE_MM = 5.0  # of the bed, for clips and skirts
SIZE_PX = 640, 480  # pixels, wide and high
YAW_RAD, PITCH_RAD = math.radians(-75.0), math.radians(60.0)
MARGIN = 1.04
SLAB_MM = 2.0  # drawn below the parts as the bed
BED, PART = np.array([232.0, 232.0, 229.0]), np.array([226.0, 112.0, 30.0])
INK, LIGHT, TEXT_PX = (20, 20, 20), (255, 255, 255), 15
FIRST_DATE = (1980, 1, 1, 0, 0, 0)

CONTENT_TYPES = """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
<Default Extension="config" ContentType="application/xml"/>
</Types>
"""
RELATIONSHIPS = """<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="rel0" Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""


def threemf_bytes(meshes: Mapping[str, TriMesh], title: str, description: str, settings: Mapping[str, str]) -> bytes:
    """Return the file of parts in the frame of the bed; `settings` are PrusaSlicer's, for each part."""
    model = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<model unit="millimeter" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">',
        f'<metadata name="Title">{escape(title)}</metadata>',
        '<metadata name="Application">scanwright</metadata>',
        f'<metadata name="Description">{escape(description)}</metadata>',
        "<resources>",
        *(line for i, (part, mesh) in enumerate(meshes.items(), start=1) for line in _object(i, part, mesh)),
        "</resources>",
        "<build>",
        *(f'<item objectid="{i}"/>' for i in range(1, len(meshes) + 1)),
        "</build>",
        "</model>",
        "",
    ]
    entries = {
        "[Content_Types].xml": CONTENT_TYPES,
        "_rels/.rels": RELATIONSHIPS,
        "3D/3dmodel.model": "\n".join(model),
        "Metadata/Slic3r_PE_model.config": "\n".join(_config(meshes, settings)),
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as package:
        for name, text in entries.items():
            entry = zipfile.ZipInfo(name, date_time=FIRST_DATE)
            entry.create_system = 3  # else it names the platform that wrote it
            entry.external_attr = 0o644 << 16
            package.writestr(entry, text.encode("utf-8"))
    return file.getvalue()


def _object(number: int, part: str, mesh: TriMesh) -> Iterator[str]:
    yield f'<object id="{number}" type="model" name={quoteattr(part)}>'
    yield from ("<mesh>", "<vertices>")
    d = PRINT_DECIMALS
    yield from (f'<vertex x="{x:.{d}f}" y="{y:.{d}f}" z="{z:.{d}f}"/>' for x, y, z in mesh.vertices.tolist())
    yield from ("</vertices>", "<triangles>")
    yield from (f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.faces.tolist())
    yield from ("</triangles>", "</mesh>", "</object>")


def _config(meshes: Mapping[str, TriMesh], settings: Mapping[str, str]) -> Iterator[str]:
    """Yield the settings of every object; PrusaSlicer reads the triangles of an object from its volumes."""
    yield from ('<?xml version="1.0" encoding="UTF-8"?>', "<config>")
    for number, (part, mesh) in enumerate(meshes.items(), start=1):
        yield f'<object id="{number}" instances_count="1">'
        for key, value in {"name": part, **settings}.items():
            yield f'<metadata type="object" key="{key}" value={quoteattr(value)}/>'
        yield f'<volume firstid="0" lastid="{len(mesh.faces) - 1}">'
        yield f'<metadata type="volume" key="name" value={quoteattr(part)}/>'
        yield from ("</volume>", "</object>")
    yield from ("</config>", "")


def plates_of(printed: Mapping[str, TriMesh], bed_mm: tuple[float, float, float]) -> list[Plate]:
    """Distribute parts in their print pose over few beds, in rows; a part larger than a bed gets a separate one."""
    sizes = {name: np.ptp(mesh.vertices, axis=0) for name, mesh in printed.items()}
    order = sorted(printed, key=lambda name: (-round(float(sizes[name][1]), 3), -round(float(sizes[name][0]), 3), name))
    across, deep = (edge - 2 * EDGE_MM + GAP_MM for edge in bed_mm[:2])
    rows = _first_fit(((float(sizes[name][0]) + GAP_MM, name) for name in order), across)
    depths = (float(max(sizes[name][1] for name in row)) + GAP_MM for row in rows)
    plates = _first_fit(zip(depths, rows, strict=True), deep)
    return [_laid(printed, sizes, rows[::-1], bed_mm) for rows in plates]


def _first_fit(things: Iterable[tuple[float, Thing]], space: float) -> list[list[Thing]]:
    """Distribute things by their sizes, each over the first of equal spaces that has place for it."""
    filled: list[tuple[float, list[Thing]]] = []  # what is left of a space, and what is in it
    for size, thing in things:
        i = next((i for i, (left, _) in enumerate(filled) if left >= size), len(filled))
        left, inside = filled[i] if i < len(filled) else (space, [])
        filled[i : i + 1] = [(left - size, [*inside, thing])]
    return [inside for _, inside in filled]


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
            moved = vertices + np.round(corner, PRINT_DECIMALS)  # equal steps: no two vertices become one
            plate[name] = TriMesh(np.round(moved, PRINT_DECIMALS) + 0.0, printed[name].faces)
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
