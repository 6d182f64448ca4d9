"""The style of live pages: notes, banners and the colour scale."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np
from numpy.typing import NDArray

from scanwright.design.arrays import Array

COLOUR_STOPS = (  # dark to light, readable in grey and for the colour-blind: a few stops of cividis
    (0, 34, 78),
    (50, 69, 108),
    (102, 105, 112),
    (150, 144, 119),
    (205, 189, 104),
    (253, 231, 55),
)

Colours = NDArray[np.uint8]


def ramp(level: Array) -> Colours:
    """Return the colours of levels 0 to 1, shape (n, 3); NaN counts as 0."""
    stops = np.array(COLOUR_STOPS, dtype=float)
    at = np.clip(np.nan_to_num(level), 0, 1) * (len(stops) - 1)
    columns = [np.interp(at, np.arange(len(stops)), stops[:, k]) for k in range(3)]
    return np.stack(columns, axis=1).astype(np.uint8)


def banner_html(kind: str, lines: Iterable[str], *, lost: Iterable[str] = ()) -> str:
    """Return the hidden element that `state_banner.js` shows as a banner over the page; no lines, no banner.

    Args:
        kind: of the state, for its colour: `running`, or an outcome of a scan.
        lines: what the banner says; the first one is its heading.
        lost: what it says instead if the connection to the program breaks.
    """
    words, without = (escape("\n".join(some)) for some in (lines, lost))
    return f'<div class="sw-state" hidden data-kind="{kind}" data-lost="{without}">{words}</div>'


def note_html(text: str, *, bad: bool = False) -> str:
    """Return one line as HTML, red if it is an error; empty for an empty text."""
    kind = ' class="sw-bad"' if bad else ""
    line = f'<div{kind} style="font-size:12px;margin:2px 12px;overflow-wrap:anywhere">{escape(text)}</div>'
    return line if text else ""
