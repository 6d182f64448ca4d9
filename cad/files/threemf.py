"""3MF of parts in their print pose: core specification, millimetres, the same bytes for the same meshes.

The file also contains the settings of PrusaSlicer (Metadata/Slic3r_PE_model.config), which other readers skip. The
entries are stored, not deflated, with the zip format's first date: the output of a compressor depends on its version.
"""

import io
import zipfile
from collections.abc import Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from scanwright.cad.geometry.mesh import TriMesh

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
    yield from (f'<vertex x="{x:.5f}" y="{y:.5f}" z="{z:.5f}"/>' for x, y, z in mesh.vertices.tolist())
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
