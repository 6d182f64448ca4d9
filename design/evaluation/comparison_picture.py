"""The picture of a comparison: one row of bars for each candidate."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from scanwright.design.evaluation.comparison import ComparisonRow
from scanwright.design.evaluation.density_picture import INK
from scanwright.design.files.picture_files import save_picture
from scanwright.design.objective.holes import percent

LONG = {"color": "#555555"}
SHORT = {"facecolor": "#dddddd", "hatch": "////", "edgecolor": "#777777", "linewidth": 0.0}
OPTIMUM = {"color": INK}


def compare_picture(path: Path, rows: list[ComparisonRow], title: str) -> None:
    """Write bars of -J, blind share of the weight, widest gap, cost, and beams per ball and dollar to a PNG and an SVG.

    The first row is the optimum; a candidate with two rows gets two bars, the shorter time below.
    """
    names = list(dict.fromkeys(row.name for row in rows))
    longest = {name: max(row.time_s for row in rows if row.name == name) for name in names}
    full = [row for row in rows if row.time_s == longest[row.name]]
    single = [row for row in rows if row.time_s < longest[row.name]]
    twice = {row.name for row in single}

    figure = Figure(figsize=(13, 1.6 + 0.5 * len(names)), layout="constrained")
    J, blind, gap, cost, value = figure.subplots(1, 5, sharey=True, width_ratios=[2.2, 1.2, 1.2, 1.2, 1.2])
    for row in full:
        y = names.index(row.name)
        style = OPTIMUM if row is rows[0] else LONG
        place, height = (y - 0.2, 0.38) if row.name in twice else (y, 0.6)
        J.barh(place, -row.J, height=height, xerr=row.J_error, ecolor="#999999", **style)
        J.text(-row.J, place, f" {-row.J + 0.0:.2f}", va="center", fontsize=8)
        blind.barh(y, 100 * row.blind_weight, height=0.6, **style)
        blind.text(100 * row.blind_weight, y, f" {percent(row.blind_weight)}", va="center", fontsize=8)
        gap.barh(y, row.gap_deg, height=0.6, **style)
        gap.text(row.gap_deg, y, f" {row.gap_deg:.3g}", va="center", fontsize=8)
        if row.cost_usd is not None:
            cost.barh(y, row.cost_usd / 1000, height=0.6, **style)
        cost.text((row.cost_usd or 0) / 1000, y, _thousands(row.cost_usd), va="center", fontsize=8)
        if row.beams_per_ball_per_usd is not None:
            value.barh(y, row.beams_per_ball_per_usd, height=0.6, **style)
            value.text(row.beams_per_ball_per_usd, y, f" {row.beams_per_ball_per_usd:.2g}", va="center", fontsize=8)
    for row in single:
        place = names.index(row.name) + 0.2
        J.barh(place, -row.J, height=0.38, **SHORT)
        J.text(-row.J, place, f" {-row.J + 0.0:.2f}", va="center", fontsize=8)
    J.set_yticks(range(len(names)), [f"{name}\n{_times(rows, name)}" for name in names], fontsize=8)
    J.invert_yaxis()
    J.set_xlabel("-J: mean of ln(1 + beams per ball)\nlonger is better; hatched: in the shorter time")
    blind.set_xlabel("never seen, share of\nthe task's weight [%]")
    gap.set_xlabel("widest gap between\nlines or layers [deg]")
    cost.set_xlabel("lidar, servo, slip ring, or\nscanner [thousand USD]")
    value.set_xlabel("beams per ball (geometric\nmean) per dollar")
    for axis in (J, blind, gap, cost, value):
        axis.spines[["top", "right"]].set_visible(False)
        axis.set_xlim(0, 1.25 * max(1e-6, *(bar.get_width() for bar in axis.patches)))
    figure.suptitle(title, fontsize=11)
    save_picture(figure, path)


def _times(rows: list[ComparisonRow], name: str) -> str:
    return " and ".join(f"{row.time_s:g} s" for row in reversed(rows) if row.name == name)


def _thousands(cost_usd: float | None) -> str:
    return " price not known" if cost_usd is None else f" {cost_usd / 1000:g}"
