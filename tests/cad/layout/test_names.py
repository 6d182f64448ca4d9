"""A part is named once, in `cad/layout/names.py`: nothing else in cad spells the name of a part or of a bought body."""

import ast
import re
from pathlib import Path

import scanwright.cad
from scanwright.cad.layout import names

FOLDER = Path(scanwright.cad.__file__).parent
WORDS = {"BEARING", "BELT", "DECK", "LIDAR", "RING", "SERVO", "TRIPOD"}  # of everyday speech, and of frames
NAMES = [value for key, value in vars(names).items() if key.isupper() and key not in WORDS]


def spelt(source):
    """Names of parts inside the strings of a module, its docstrings left out."""
    tree = ast.parse(source)
    told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    texts = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in told]
    return [name for name in NAMES for text in texts if isinstance(text, str) and re.search(rf"\b{name}\b", text)]


def test_no_module_spells_the_name_of_a_part():
    modules = {path: spelt(path.read_text(encoding="utf-8")) for path in FOLDER.rglob("*.py")}
    assert len(NAMES) > 20 and modules.pop(FOLDER / "layout" / "names.py")
    assert {path.name: found for path, found in modules.items() if found} == {}


def test_the_search_sees_a_name_in_a_sentence_and_not_in_a_docstring():
    assert spelt('"""The base_mount."""\nx = f"put the base_mount on {1}"\n') == ["base_mount"]
    assert spelt('x = "base_mounts"') == []
