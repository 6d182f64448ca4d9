"""The pages are in plain words: short sentences, short table cells, and hardly any of the dialect they once had."""

import re
import statistics
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from page_words import DIALECT, blocks, count_words, median_sentence, sentences, strange, words

ROOT = Path(__file__).parent.parent
PAGES = [
    *(ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "SECURITY")),
    *sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts),
]
GENERATED = {"reference/cli", "reference/files", "reference/modules", "reference/checks"}
TEXTS = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in PAGES
    if path.parent.relative_to(ROOT / "docs" if ROOT / "docs" in path.parents else ROOT).as_posix() not in GENERATED
}
MOST_WORDS = 15  # median of a page's sentences, and of a table cell
MOST_STRANGE = 1 / 1000  # of all words
CASES = {
    "things that tell": "The report tells the height.",
    "things that say": "The last line says why.",
    "nobody, whoever": "Nobody has measured it.",
    "a clause for a noun": "It drops what has no place.",
    "where for if": "Where it fails, run it again.",
    "things that stand or lie": "The task stands in a file.",
    "things that take": "The next command takes it from there.",
    "things that ask": "It is as long as the task asks.",
    "things that want": "A tilted axis wants a bearing.",
    "hold, bear": "The angle is held at zero.",
    "looks": "Each wall needs a second look.",
    "whole": "It keeps the whole message.",
    "of its own": "A turn has times of its own.",
    "beside": "Its error is printed beside it.",
    "so many": "It needs so many points.",
    "way": "Both ways have the same speed.",
    "old words": "The beams shall be even.",
    "house": "The folders are rooms of the house.",
    "left out": "The command left out three beams.",
    "history": "The code no longer does this.",
    "private words": "A twin answers on this port.",
}


@pytest.mark.parametrize("page", TEXTS)
def test_half_of_the_sentences_of_a_page_are_short(page):
    assert median_sentence(TEXTS[page]) <= MOST_WORDS


def test_the_sentences_of_all_pages_are_short():
    assert statistics.median(len(words(one)) for text in TEXTS.values() for one in sentences(text)) <= MOST_WORDS


@pytest.mark.parametrize("page", TEXTS)
def test_a_table_cell_is_short(page):
    cells = (text for kind, text in blocks(TEXTS[page]) if kind == "cell")
    prose = (cell for cell in cells if re.search(r"[a-z]", re.sub(r"\{py:func\}|`code`", "", cell)))
    assert [cell for cell in prose if len(words(cell)) > MOST_WORDS] == []


def test_the_pages_are_hardly_in_dialect():
    places = [(page, *place) for page, text in TEXTS.items() for place in strange(text)]
    total = sum(map(count_words, TEXTS.values()))
    assert len(places) <= MOST_STRANGE * total, "\n".join(": ".join(place) for place in places)


@pytest.mark.parametrize("kind", DIALECT)
def test_each_kind_of_dialect_is_recognised(kind):
    assert kind in {name for name, _ in strange(CASES[kind])}


def test_only_prose_is_counted():
    page = """# What is told of it

What is a scan? Run `scan beside`, and see [the map](beside.md).

```console
$ scanwright beside
it tells the whole
```

```{note}
One more sentence.
```

![a whole picture](whole.png)

<!-- table: made -->
| beside | whole |
<!-- end -->

| key | value |
| --- | --- |
| `whole` | a cell |
"""
    assert strange(page) == []
    assert sentences(page) == ["What is a scan?", "Run `code`, and see the map.", "One more sentence."]
    assert [text for kind, text in blocks(page) if kind == "cell"] == ["key", "value", "`code`", "a cell"]
    assert median_sentence("One two. One two three four.\n\n- One.\n- Two.") == 1.5
