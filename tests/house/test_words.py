"""What people read is written for people: a class that gets another name must not take a sentence along."""

import ast
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from imports import PACKAGE, modules


def trees():
    """The syntax tree of each module, by its name."""
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in modules().items()}


def sentences(tree):
    """Strings with a space that are no docstring."""
    told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    strings = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return [node.value for node in strings if " " in node.value and id(node) not in told]


def test_no_sentence_for_people_names_a_class_of_ours():
    found = trees()
    nodes = (node for tree in found.values() for node in ast.walk(tree))
    classes = {node.name for node in nodes if isinstance(node, ast.ClassDef) and re.search("[a-z][A-Z]", node.name)}
    assert len(classes) > 100
    spoilt = {
        name: said
        for name, tree in found.items()
        if name != PACKAGE  # the lists of public names
        and (said := [words for words in sentences(tree) if classes & set(re.findall(r"\w+", words))])
    }
    assert spoilt == {}
