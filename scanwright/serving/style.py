"""Notes and banners of live pages, as HTML."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from scanwright.report.colours import Bands


def banner_html(kind: str, lines: Iterable[str], *, lost: Iterable[str] = ()) -> str:
    """Return the hidden element that `state_banner.js` shows as a banner over the page; no lines, no banner.

    `kind` is the state, for its colour: `running`, or an outcome of a scan. `lost` replaces the lines if the connection
    to the program breaks.
    """
    words, without = (escape("\n".join(some)) for some in (lines, lost))
    return f'<div class="sw-state" hidden data-kind="{kind}" data-lost="{without}">{words}</div>'


def note_html(text: str, *, bad: bool = False) -> str:
    """Return one line as HTML, red if it is an error; empty for an empty text."""
    kind = ' class="sw-bad"' if bad else ""
    line = f'<div{kind} style="font-size:12px;margin:2px 12px;overflow-wrap:anywhere">{escape(text)}</div>'
    return line if text else ""


def key_html(bands: Bands, words: str) -> str:
    """Return the colour key of beam densities with the lower bounds of its bands; `words` explains the numbers."""
    cells = "".join(
        f'<span style="flex:1;text-align:center;border-top:9px solid {colour}">{word}</span>'
        for colour, word in bands.key()
    )
    return (
        f'<div style="font-size:12px;margin:4px 12px"><div style="display:flex">{cells}</div><div>{words}</div></div>'
    )
