"""What people read is written for people: a class that gets another name must not take a sentence along."""

import ast
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from imports import PACKAGE, trees


def sentences(nodes):
    """Strings with a space that are no docstring."""
    told = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    strings = (node for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return [node.value for node in strings if " " in node.value and id(node) not in told]


def test_no_sentence_for_people_names_a_class_of_ours():
    found = {name: list(ast.walk(tree)) for name, tree in trees().items()}
    every = (node for nodes in found.values() for node in nodes)
    classes = {node.name for node in every if isinstance(node, ast.ClassDef) and re.search("[a-z][A-Z]", node.name)}
    assert len(classes) > 100
    spoilt = {
        name: said
        for name, nodes in found.items()
        if name != PACKAGE  # the lists of public names
        and (said := [words for words in sentences(nodes) if classes & set(re.findall(r"\w+", words))])
    }
    assert spoilt == {}
