"""Figures that several pages state come from one file."""

import re

import pytest

from benchmarks.scanwright.printed.figures import FIGURES, pages, with_figures


def test_every_page_states_the_figures_of_the_file():
    texts = [page.read_text(encoding="utf-8") for page in pages()]
    assert [page.name for page, text in zip(pages(), texts, strict=True) if with_figures(text) != text] == []
    used = {name for text in texts for name in re.findall(r"<!-- figure: (\w+) -->", text)}
    assert used == set(FIGURES)


def test_a_figure_that_differs_is_replaced_and_an_unknown_one_is_an_error():
    wrong = "in <!-- figure: search_s -->3 s<!-- end -->."
    assert with_figures(wrong) == f"in <!-- figure: search_s -->{FIGURES['search_s']}<!-- end -->."
    with pytest.raises(KeyError):
        with_figures("<!-- figure: none -->3 s<!-- end -->")


def test_figures_of_the_shipped_task_are_those_of_a_search(optimum_ahead):
    gains = {gain.mount.name.partition(",")[0].lower(): f"{gain.factor:.2f}" for gain in optimum_ahead.gains}
    assert gains == {name: FIGURES[f"gain_{name}"] for name in ("bonn", "upright", "rolling", "pitching")}
    assert any(FIGURES["no_hole_cost"].replace(" ", "") in line for line in optimum_ahead.hole_lines())
