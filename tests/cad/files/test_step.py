"""Canonical STEP and STL: the same scanner gives the same bytes."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from cad.files.step import canonical_step
from cad.geometry.mesh import TriMesh, mesh_of, stl_bytes
from cad.solids import box, upright

BUILD = """
import sys
from pathlib import Path
from cad.assembly.assembly import alone
from cad.files.part_files import build_parts
from cad.files.step import step_text
from cad.files.workshop_files import export_scanner
from cad.solids import box
from design.angles import load_angles
from design.catalogue.catalogue import load_catalogue
from design.scanner import scanner_of
folder = Path(sys.argv[1])
step_text(alone("box", box((0, 0, 0), (1, 1, 1)), (1.0, 0.0, 0.0)), "box")  # what is written later must not count on
scanner = scanner_of(load_angles(folder / "angles.json"), "fdm-0.4", load_catalogue())
export_scanner(scanner, build_parts(scanner, folder, lambda _: None), folder, lambda _: None)
"""


def test_another_process_writes_the_same_bytes(made, tmp_path):
    (tmp_path / "angles.json").write_text(made.scanner.angles.to_json())
    other = os.environ | {"PYTHONHASHSEED": "4242"}
    subprocess.run([sys.executable, "-c", BUILD, str(tmp_path)], env=other, check=True, timeout=600)
    (tmp_path / "angles.json").unlink()
    files = {path.relative_to(tmp_path).as_posix(): path for path in tmp_path.rglob("*") if path.is_file()}
    assert files.keys() == {*made.result.files, *made.exports.files}
    parts = {name.removesuffix(".step") for name in files if name.startswith("parts/") and name.endswith(".step")}
    assert (
        len(parts) >= 4 and {"assembly.step", "scanner.urdf", "bom.csv", "assembly.md", "assembly.glb"} <= files.keys()
    )
    metal = {"parts/servo_shaft", "parts/journal_sleeve", "parts/counterweight"}
    manual = {name for name in files if name.startswith(("assembly/step_", "print/plate_"))}
    assert len(manual) > 5 and {"assembly/step_01.png", "print/plate_1.3mf", "print/plate_1.png"} <= manual
    # STEP, STL, three drawings; print files
    assert len(files) == 5 * len(parts) + len(parts - metal) + len(manual) + 9
    assert [name for name, path in files.items() if path.read_bytes() != (made.folder / name).read_bytes()] == []


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
