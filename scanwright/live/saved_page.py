"""A cloud as one page that opens without a program and without a network."""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Vector
from scanwright.report.build_files import packed
from scanwright.report.colours import COLOUR_STOPS
from scanwright.report.room import cloud_scene

MOST_POINTS = 600_000  # of a page: some 5 MB
LOOK = {"yaw": np.radians(-140.0), "pitch": np.radians(35.0)}  # behind and above
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline';
script-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@title@</title><link rel="icon" href="data:,">
<style>@style@ canvas { height: 75vh !important; }</style></head>
<body><main><header class="top"><h1>@title@</h1></header>
<div id="stage"><div id="place">@stage@</div><p class="tools">@low@ <span class="ramp"></span> @high@, @words@</p></div>
<script type="application/octet-stream" id="scene">@scene@</script></main><script>@code@</script></body></html>
"""


def saved_page(
    title: str, points_m: Float[ndarray, "n 3"], level: Float[ndarray, " n"], ends: tuple[str, str], centre_m: Vector
) -> str:
    """Return the page of a cloud, thinned to `MOST_POINTS`.

    `level` is the place of each point on the colour scale, 0 to 1; `ends` are the texts at the ends of the scale.
    """
    shown = np.random.default_rng(0).permutation(len(points_m))[:MOST_POINTS]
    points = points_m[shown]
    scene = {
        "stops": COLOUR_STOPS,
        "centre": np.round(centre_m, 4).tolist(),
        "level": round(float(points[:, 2].min()), 4),
        "look": LOOK,
        "cloud": cloud_scene(points, level[shown]),
    }
    parts = {
        "title": escape(title),
        "low": escape(ends[0]),
        "high": escape(ends[1]),
        "words": f"{len(points):,} of {len(points_m):,} points",
        "scene": packed(json.dumps(scene)),
    }
    for key, name in (("style", "style.css"), ("stage", "stage.html"), ("code", "stage.js")):
        parts[key] = files("scanwright.report").joinpath(name).read_text(encoding="utf-8")
    page = PAGE
    for key, text in parts.items():
        page = page.replace(f"@{key}@", text)
    return page
