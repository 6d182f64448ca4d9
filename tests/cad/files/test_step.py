"""Canonical STEP and STL: the same content gives the same bytes, and another one others."""

import hashlib

import numpy as np
import pytest
import trimesh

from scanwright.cad.files.step import canonical_step
from scanwright.cad.geometry.mesh import TriMesh, mesh_of, stl_bytes
from scanwright.cad.solids import box, upright

STEP = """ISO-10303-21;
HEADER;
FILE_NAME('part','2026-11-21T17:40:01',('Author'),('x'),'y','z','w');
ENDSEC;
DATA;
{data}
ENDSEC;
END-ISO-10303-21;
"""


def test_numbering_order_and_time_do_not_matter():
    one = STEP.format(data="#1=A('a;#9',#2,(#3));\n#2=P(1.);\n#3=P(2.);\n#4=B(#2);")
    other = STEP.format(data="#7=B(#9);\n#1=P(2.);\n#9=P(1.);\n#5 = A('a;#9', #9,\n (#1));")
    other = other.replace("2026-11-21T17:40:01", "1999-01-01T00:00:00")
    assert canonical_step(one) == canonical_step(other)
    assert "'a;#9'" in canonical_step(one)  # a reference inside a string is text
    assert canonical_step(canonical_step(one)) == canonical_step(one)


def test_another_content_gives_another_text():
    one = STEP.format(data="#1=A(#2);\n#2=P(1.);")
    assert canonical_step(one) != canonical_step(one.replace("P(1.)", "P(1.5)"))


def test_a_mesh_does_not_depend_on_earlier_tessellations():
    fresh, used = upright(5.0, 0.0, 7.0), upright(5.0, 0.0, 7.0)
    used.tessellate(0.0005, 0.01)
    one, other = mesh_of(fresh), mesh_of(used)
    assert stl_bytes(one, "p", "c") == stl_bytes(other, "p", "c")
    assert one.is_closed()
    assert one.volume() == pytest.approx(fresh.Volume(), rel=2e-3)


def test_stl_says_what_it_is_and_reads_back(tmp_path):
    mesh = mesh_of(box((0, 0, 0), (1, 2, 3)))
    data = stl_bytes(mesh, "a_part", "0123456789ab")
    assert data[:80].rstrip() == b"a_part config=0123456789ab unit=mm"
    assert not data.startswith(b"solid")  # readers would take it for text
    (tmp_path / "a.stl").write_bytes(data)
    back = trimesh.load(tmp_path / "a.stl")
    assert back.is_watertight and back.volume == pytest.approx(6.0)
    assert hashlib.sha256(data).digest() == hashlib.sha256(stl_bytes(mesh, "a_part", "0123456789ab")).digest()


def test_an_open_mesh_is_seen():
    mesh = mesh_of(box((0, 0, 0), (1, 1, 1)))
    assert mesh.is_closed()
    assert not TriMesh(mesh.vertices, mesh.faces[1:]).is_closed()
    flipped = np.concatenate([mesh.faces[1:], mesh.faces[:1, ::-1]])
    assert not TriMesh(mesh.vertices, flipped).is_closed()
