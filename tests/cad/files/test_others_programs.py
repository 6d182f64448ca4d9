"""What other people's programs say of the parts, where they are installed: FreeCAD of files, CalculiX of bends."""

import shutil

import numpy as np
import pytest
from quick_tests import samples
from scanners import CAPSULE, UPRIGHT, scanner_at

from benchmarks.cad import elements, freecad
from scanwright.cad.layout.names import BASE_MOUNT

SETTINGS = {  # five linkages, three of them on a mount
    "ground_ahead": None,
    "rolling": ((0, 90, 0, -90), {}),
    "belt": ((0, 19, 84, 41), {"sensor": "URG-04LX", "slip_ring": CAPSULE}),
    "lying": ((0, 0, 90, 0), {}),
    "upright": (UPRIGHT, {}),
}


def needs(*programs):
    missing = [program for program in programs if shutil.which(program) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed (apt-get install freecad gmsh calculix-ccx): not asked")


def test_freecad_takes_every_step_file_as_one_valid_solid(made):
    needs(freecad.PROGRAM)
    files = {made.folder / "parts" / f"{part.name}.step": part for part in made.result.parts}
    found = freecad.opened(list(files))
    assert found.keys() == files.keys()
    for file, part in files.items():
        shape = found[file]
        assert shape.valid and shape.solids == 1, file.name
        assert shape.volume_mm3 == pytest.approx(part.volume_mm3, rel=freecad.WITHIN)


def test_freecad_is_believed_because_it_sees_a_shell_that_is_open(made, tmp_path):
    needs(freecad.PROGRAM)
    whole = (made.folder / "parts" / f"{BASE_MOUNT}.step").read_text()
    closed = next(line for line in whole.splitlines() if "CLOSED_SHELL" in line)
    faces = closed[closed.index("(#") + 1 : closed.index(")")].split(",")
    (tmp_path / "open.step").write_text(whole.replace(closed, closed.replace(f"{faces[0]},", "", 1)))
    (shape,) = freecad.opened([tmp_path / "open.step"]).values()
    assert not (shape.valid and shape.solids == 1 and abs(shape.volume_mm3) > 0) or shape.strict


@pytest.mark.parametrize(
    "setting", samples(SETTINGS, ("lying",))
)  # it has a mount too; the others: a minute of CalculiX each
def test_the_stated_error_of_a_bend_covers_what_calculix_finds(made, parts_of, tmp_path, setting, monkeypatch):
    needs("gmsh", "ccx")
    monkeypatch.setattr(elements, "EDGE_MM", 8.0)
    scanner, assembly = made.scanner, made.result.assembly
    if SETTINGS[setting] is not None:
        angles, products = SETTINGS[setting]
        scanner = scanner_at(angles, **products)
        assembly = parts_of(scanner)
    found = elements.linkage_compared(scanner, assembly, tmp_path)
    assert found.off < found.stated and found.bend > np.radians(1e-3)
    if BASE_MOUNT in assembly.made:
        found = elements.mount_compared(scanner, assembly, tmp_path)
        assert found.off < found.stated and found.changes < 0.02 * found.bend
