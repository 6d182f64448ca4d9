"""The assembly steps as HTML: the Markdown that `assembly.md` uses, other text unchanged."""

from __future__ import annotations

import html
import re
from collections.abc import Callable


def steps_html(text: str, address: Callable[[str], str | None] = lambda _: None) -> str:
    """Return HTML of the steps without the title, headings from the third level; `address` is that of a picture."""
    blocks = []
    for block in re.split(r"\n\s*\n", text.strip()):
        heading = re.fullmatch(r"(#+) (.*)", block)
        picture = re.fullmatch(r"!\[(.*)\]\((.*)\)", block)
        source = None if picture is None else address(picture[2])
        if picture is not None and source is not None:
            alt = html.escape(picture[1])
            blocks.append(f'<div class="picture"><img src="{html.escape(source)}" alt="{alt}"></div>')
        elif heading is None:
            lines = block.splitlines()
            listed = all(line.startswith("- ") for line in lines)
            items = "".join(f"<li>{_inline(line[2:])}</li>" for line in lines)
            blocks.append(f"<ul>{items}</ul>" if listed else f"<p>{_inline(' '.join(lines))}</p>")
        elif len(heading[1]) > 1:
            level = min(len(heading[1]) + 1, 6)
            blocks.append(f"<h{level}>{_inline(heading[2])}</h{level}>")
    return "\n".join(blocks)


def _inline(text: str) -> str:
    escaped = html.escape(text)
    return re.sub(r"`(.+?)`", r"<code>\1</code>", re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", escaped))
