"""A newcomer finds the room for any line: small folders, no circles, late imports only where they spare something."""

import ast
import re
import sys
from collections import Counter, defaultdict
from itertools import combinations
from pathlib import Path

import networkx as nx
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from imports import FLOORS, PACKAGE, ROOT, imports, loaded_by, modules, trees

MOST = 12
HEAVY = {
    "OCP",
    "PIL",
    "cadquery",
    "dask",
    "distributed",
    "embreex",
    "ezdxf",
    "jinja2",
    "laspy",
    "manifold3d",
    "matplotlib",
    "mcap",
    "numba",
    "numpy",
    "pydantic",
    "pyarrow",
    "pye57",
    "pypcd4",
    "reportlab",
    "rosbags",
    "rtree",
    "scipy",
    "serial",
    "shapely",
    "small_gicp",
    "trimesh",
    "viser",
    "websockets",
}


def folders():
    """How many modules stand in each folder, `__init__` not counted."""
    tops = (*FLOORS, "benchmarks", "tests", "examples")
    files = {path.resolve() for top in tops for path in (ROOT / top).rglob("*.py") if path.name != "__init__.py"}
    return Counter(path.parent.relative_to(ROOT).as_posix() for path in files)


def test_no_folder_holds_more_than_a_dozen_modules():
    assert {f: n for f, n in folders().items() if n > MOST} == {}


def test_every_room_says_in_one_line_what_one_finds_there():
    for name, path in modules().items():
        if path.name == "__init__.py":
            told = ast.get_docstring(trees()[name])
            assert told and len(told.splitlines()[0]) <= 117, name


def test_no_files_import_each_other_in_a_circle():
    graph = nx.DiGraph((one.importer, one.imported) for one in imports() if one.imported.split(".")[0] == PACKAGE)
    assert [sorted(circle) for circle in nx.strongly_connected_components(graph) if len(circle) > 1] == []


def test_the_search_for_circles_sees_imports_in_functions_and_for_types(tmp_path):
    (tmp_path / "design").mkdir()
    (tmp_path / "design" / "a.py").write_text("def f():\n    import scanwright.design.b\n")
    (tmp_path / "design" / "b.py").write_text("if TYPE_CHECKING:\n    from scanwright.design.a import f\n")
    graph = nx.DiGraph((one.importer, one.imported) for one in imports(tmp_path, ("design",)))
    assert {"scanwright.design.a", "scanwright.design.b"} in list(nx.strongly_connected_components(graph))


def test_an_import_inside_a_function_keeps_a_heavy_library_out_of_the_start():
    every = imports()
    idle = []
    for one in every:
        if one.where == "function" and one.imported.split(".")[0] == PACKAGE:
            spared = loaded_by(one.imported, every) - loaded_by(one.importer, every)
            if not {name.split(".")[0] for name in spared} & HEAVY:
                idle.append(f"{one.importer} -> {one.imported}")
    assert idle == []


def test_no_class_stands_for_two_things():
    places = defaultdict(list)
    for name, tree in trees().items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(name)
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_no_two_modules_of_a_room_differ_by_a_letter():
    rooms = defaultdict(set)
    for name, path in modules().items():
        rooms[name.rpartition(".")[0]].add(path.parent.name if path.name == "__init__.py" else path.stem)
    near = [(room, a, b) for room, names in rooms.items() for a, b in combinations(sorted(names), 2) if _near(a, b)]
    assert near == []


def _near(a, b):
    """Whether one letter more, less or changed makes one name of the other."""
    if abs(len(a) - len(b)) > 1 or min(len(a), len(b)) < 3:
        return False
    patterns = [re.escape(a[:i]) + ".?" + re.escape(a[i + 1 :]) for i in range(len(a))]
    patterns += [re.escape(a[:i]) + "." + re.escape(a[i:]) for i in range(len(a) + 1)]
    return any(re.fullmatch(pattern, b) for pattern in patterns)


@pytest.mark.parametrize(
    ("a", "b", "near"), [("export", "exports", True), ("cat", "car", True), ("mesh", "beams", False)]
)
def test_what_a_letter_apart_means(a, b, near):
    assert _near(a, b) is _near(b, a) is near
