"""Printed output in the pages is marked well, consists of today's words, and a run is compared as the pages mean it."""

import re
from pathlib import Path

import pytest

from benchmarks.scanwright.printed.blocks import blocks_of, with_output

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *(page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts)]
PAGE = """Text.

<!-- printed: mask in [0-9.]+ s$ -->
```console
$ scanwright optimise task
J = -6.1
[...]
computed in 1.0 s
```

<!-- printed -->
```console
$ scanwright catalogue
A 1
B 2
```
"""


def test_every_marked_block_of_the_pages_is_well_formed():
    commands = [block.command for page in PAGES for block in blocks_of(page.read_text(encoding="utf-8"))]
    named = {command.split()[1] for command in commands}
    assert named >= {"optimise", "evaluate", "build", "emulate", "scan", "calibrate", "assemble"}


PAIR = re.compile(r"(?=\b([A-Za-z][a-z']+ [a-z][a-z']+)\b)")
MOST_UNKNOWN = 0.1  # of the pairs of words: a value next to a word is in no text of the program


@pytest.fixture(scope="module")
def program():
    """The source of the program and the catalogue, with the pieces of a text joined."""
    folders = ("scanwright/cli", "scanwright/pipeline", "design", "cad", "firmware_io")
    files = [path for folder in folders for path in sorted((ROOT / folder).rglob("*.*"))]
    texts = (path.read_text(encoding="utf-8") for path in files if path.suffix in (".py", ".toml"))
    return re.sub(r'"\s*\n\s*f?"', "", "\n".join(texts))


def test_printed_output_of_the_pages_has_the_words_of_the_program(program):
    """Without running anything: a line of which the words are gone is stale, and `--write` renews it."""
    for path in PAGES:
        for block in blocks_of(path.read_text(encoding="utf-8")):
            text = re.sub(r"\n {2,}", " ", "\n".join(block.output))
            pairs = PAIR.findall(re.sub(r"\S*/\S*", "-", text))
            unknown = [pair for pair in pairs if pair not in program]
            assert len(unknown) <= max(2, MOST_UNKNOWN * len(pairs)), f"{path.name}: {block.command}: {unknown}"


def test_gaps_and_masked_text_agree_with_any_run():
    first, second = blocks_of(PAGE)
    assert first.agrees(["J = -6.1", "computed in 7.5 s"])
    assert first.agrees(["J = -6.1", "more", "and more", "computed in 7.5 s"])
    assert not first.agrees(["J = -6.2", "computed in 1.0 s"])
    assert not first.agrees(["J = -6.1", "computed in 1.0 s", "more"])
    assert second.agrees(["A 1", "B 2"]) and not second.agrees(["A 1", "more", "B 2"])


def test_new_output_keeps_the_gaps_and_the_masked_text():
    first, second = blocks_of(PAGE)
    assert first.renewed(["J = -6.2", "more", "computed in 7.5 s"]) == ["J = -6.2", "[...]", "computed in 1.0 s"]
    page = with_output(PAGE, second, second.renewed(["A 1", "C 3", "B 4"]))
    assert page == PAGE.replace("B 2\n", "C 3\nB 4\n")
    assert first.renewed(["other", "words"]) == ["other", "words"]


@pytest.mark.parametrize(
    ("right", "wrong", "fault"),
    [
        ("console\n$ scanwright c", "text\n$ scanwright c", "line 11: no console block"),
        ("$ scanwright c", "$ ls", "line 11: a block is one command"),
        ("A 1\nB 2\n", "", "line 11: a block is one command"),
        (": mask", ": hide", "line 3: unknown option"),
        ("in [0-9.]+", "in [0-9.+", "line 3: mask"),
    ],
)
def test_a_wrong_mark_is_named(right, wrong, fault):
    with pytest.raises(ValueError, match=fault):
        blocks_of(PAGE.replace(right, wrong))
