"""The imports of the house, read from its files: wherever they stand, in functions and under TYPE_CHECKING too."""

import ast
import functools
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = "scanwright"
FLOORS = ("design", "cad", "firmware_io", PACKAGE)  # folders; in the package the first three are links, and are skipped


@dataclass(frozen=True)
class Import:
    """One import of a module; `where` is "module", "function" or "typing"."""

    importer: str
    imported: str
    where: str


def modules(root=ROOT, floors=FLOORS):
    """Every module by its dotted name, with its file; packages stand for their `__init__`."""
    found = {}
    for floor in floors:
        for path in sorted((root / floor).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            if floor == PACKAGE and parts[1] in FLOORS:
                continue
            parts = parts if floor == PACKAGE else (PACKAGE, *parts)
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@functools.cache
def trees(*where):
    """The syntax tree of every module, by its name."""
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in modules(*where).items()}


@functools.cache
def imports(*where):
    """All imports of all modules, of the house and of libraries; those of the house name the module, not the name."""
    known = trees(*where)
    return [one for name, tree in known.items() for one in _imports(name, tree, "module", known)]


def _imports(name, node, where, known):
    if isinstance(node, ast.If) and getattr(node.test, "id", None) == "TYPE_CHECKING":
        where = "typing"
    elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and where == "module":
        where = "function"
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        for alias in node.names:
            full = f"{node.module}.{alias.name}"
            yield Import(name, full if full in known else node.module, where)
    elif isinstance(node, ast.Import):
        for alias in node.names:
            yield Import(name, alias.name, where)
    for block in ("body", "orelse", "handlers", "finalbody", "cases"):  # all that can hold an import
        for child in getattr(node, block, ()):
            yield from _imports(name, child, where, known)


def loaded_by(module, every):
    """Libraries and modules that importing a module loads, itself included; `every` is what `imports` gave."""
    graph = defaultdict(set)
    for one in every:
        if one.where == "module":
            graph[one.importer].add(one.imported)
    seen, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += graph[name]
    return seen
