"""Canonical STEP and STL: the same scanner gives the same bytes."""

import hashlib
import json
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
import hashlib, json, sys
from pathlib import Path
from cad.files.part_files import build_parts
from cad.files.workshop_files import export_scanner
from design.angles import Angles, AngleSet
from design.catalogue.catalogue import load_catalogue
from design.scanner import scanner_of
folder = Path(sys.argv[1])
angles = AngleSet(task="twice", angles_deg=Angles(alpha_rot=0, beta_rot=35, alpha_laser=-20, beta_laser=-70),
                  sensor="UTM-30LX", servo="MX-64R", slip_ring="UH1256-02-0610-06S")
scanner = scanner_of(angles, "fdm-0.4", load_catalogue())
if sys.argv[2] == "again":
    build_parts(scanner, folder, lambda _: None)  # a second build in a process must not count on
result = build_parts(scanner, folder, lambda _: None)
exports = export_scanner(scanner, result, folder, lambda _: None)
files = [*result.files, *exports.files]
print(json.dumps({f: hashlib.sha256((folder / f).read_bytes()).hexdigest() for f in files}))
"""


def test_two_processes_write_the_same_bytes(tmp_path):
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", BUILD, str(tmp_path / seed), mode],
            env=os.environ | {"PYTHONHASHSEED": seed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed, mode in (("1", "once"), ("4242", "again"))
    ]
    one, other = (json.loads(run.communicate(timeout=300)[0]) for run in runs)
    parts = {name.removesuffix(".step") for name in one if name.startswith("parts/") and name.endswith(".step")}
    assert len(parts) >= 4 and {"assembly.step", "scanner.urdf", "bom.csv", "assembly.md", "assembly.glb"} <= one.keys()
    metal = {"parts/servo_shaft", "parts/counterweight"}
    assert len(one) == 5 * len(parts) + len(parts - metal) + 7  # STEP, STL, three drawings; print files
    assert one == other


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
