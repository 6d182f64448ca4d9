"""Sketches of products: what they show, and that no two texts overlap."""

import re
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest

from scanwright.cad.drawings.pen import CAPITAL, GLYPH_WIDTH
from scanwright.cad.drawings.sketch import sketch_svg
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import Belt, Multibeam, Printer
from scanwright.design.errors import TaskError

pytestmark = pytest.mark.quick
DRAWN = [product.name for product in load_catalogue() if not isinstance(product, Belt | Multibeam | Printer)]
NARROWER = 0.75  # than the pen reckons: Helvetica's figures are that wide


def boxes_of(svg):
    """Boxes of the texts of a sketch: left, low, right, high, and the text."""
    for text in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text"):
        x, y, size = float(text.get("x")), float(text.get("y")), float(text.get("font-size"))
        width, height = NARROWER * GLYPH_WIDTH * CAPITAL * size * len(text.text), CAPITAL * size
        left = x - {"start": 0, "middle": 0.5, "end": 1}[text.get("text-anchor")] * width
        box = [left, y - height, left + width, y]
        if "rotate(-90" in (text.get("transform") or ""):
            along = [box[0] - x, box[2] - x]
            box = [x - height, y - along[1], x, y - along[0]]
        yield box, text.text


@pytest.mark.parametrize("name", DRAWN)
def test_no_two_texts_of_a_sketch_overlap(name):
    svg = sketch_svg(load_catalogue().named(name))
    texts = list(boxes_of(svg))
    assert texts
    for (a, words), (b, others) in combinations(texts, 2):
        apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
        assert apart, (words, others)
    width, height = map(float, re.search(rb'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg).groups())
    corners = np.array([box for box, _ in texts])
    assert corners[:, :2].min() >= 0
    assert corners[:, 2].max() <= width
    assert corners[:, 3].max() <= height


def test_a_sketch_states_places_screws_and_doubts():
    words = [text for _, text in boxes_of(sketch_svg(load_catalogue().named("UST-10LX")))]
    assert "2x M3 TAPPED, 6 DEEP?" in words
    assert "2x M4 TAPPED, 6 DEEP?" in words
    assert {"20", "-20", "47.4", "17.5", "21"} <= set(words)
    assert any(text.startswith("Not verified, measure yours: window_radius_mm, holes") for text in words)


def test_a_sketch_of_a_servo_has_its_horn():
    words = [text for _, text in boxes_of(sketch_svg(load_catalogue().named("XL430-W250")))]
    assert {"4x M2 TAPPED, 3.5 DEEP ON Ø16", "Ø20.5", "2x M2.5 SELF TAPPING, 3.8 DEEP"} <= set(words)


@pytest.mark.parametrize("name", ["GT2-6", "sla"])
def test_what_has_no_dimensions_is_refused(name):
    with pytest.raises(TaskError, match="has no dimensions"):
        sketch_svg(load_catalogue().named(name))
