"""The paper's Fig. 3 as an experiment: the chance to hit a thin pole with crossing lines and with parallel ones.

    uv run python -m benchmarks.design.poles

One turn in 2 s, UTM-30LX, poles 1 m high 5 m away, to the left and to the right, where all four alignments see. About
each axis the scan plane either holds the axis (lines that meet in the axis alone: rolling) or stands at 45 deg to it
(lines that cross). About the upright axis parallel lines run along the poles, about the axis ahead they run across.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from scanwright.design.angles import STANDARD_DEG
from scanwright.design.evaluation.density_picture import INK
from scanwright.design.evaluation.poles import Pole, PoleChances, pole_chances
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.task.task import Task, load_task

PICTURE = Path(__file__).parents[2] / "docs/pictures/poles.png"
PERIOD_S = 2.0
HEIGHT_M, RANGE_M = 1.0, 5.0
WIDTHS_MM = (5, 10, 20, 40, 60, 80, 100, 150, 200, 300, 400)
SIDES_DEG = ([50.0, 130.0], [-130.0, -50.0])
CROSSING_DEG = (45.0, 0.0)  # alpha_laser, beta_laser: the axis stands at 45 deg to the scan plane
CASES = {
    "rolling, axis ahead: parallel": STANDARD_DEG["rolling"],
    "axis ahead: crossing": (0.0, 90.0, *CROSSING_DEG),
    "rolling, axis upright: parallel": (0.0, 0.0, *STANDARD_DEG["rolling"][2:]),
    "axis upright: crossing": (0.0, 0.0, *CROSSING_DEG),
}
LOOKS: tuple[dict[str, Any], ...] = (
    {"ls": "--", "marker": "s"},
    {"ls": "-", "marker": "s"},
    {"ls": "--", "marker": "o"},
    {"ls": "-", "marker": "o"},
)
GREYS = ("#888888", "#888888", INK, INK)


def main() -> None:
    """Print the table and write the picture."""
    problem = to_the_sides()
    found = {
        name: [pole_chances(problem, np.radians(angles), Pole(w / 1000, HEIGHT_M, RANGE_M)) for w in WIDTHS_MM]
        for name, angles in CASES.items()
    }
    print(f"poles {HEIGHT_M:g} m high, {RANGE_M:g} m away; one turn in {PERIOD_S:g} s; at least 1 beam (3 beams)")
    print("width [mm]  " + "  ".join(f"{name:>31}" for name in CASES))
    for i, width in enumerate(WIDTHS_MM):
        print(f"{width:10}  " + "  ".join(f"{_cell(rows[i]):>31}" for rows in found.values()))
    draw(found)
    print(f"wrote {PICTURE.name}")


def to_the_sides() -> Problem:
    """A fast turn, poles on both sides."""
    loaded = load_task(Path("uniform"))
    changed = {"weight": [{"shape": "band", "phi_deg": phi} for phi in SIDES_DEG], "motion": {"period_s": PERIOD_S}}
    return problem_of(replace(loaded, task=Task.model_validate(loaded.task.model_dump() | changed)))


def draw(found: dict[str, list[PoleChances]]) -> None:
    """Chance over width, one panel for each number of beams."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    for k, axis in enumerate(figure.subplots(1, 2, sharey=True)):
        for (name, rows), look, grey in zip(found.items(), LOOKS, GREYS, strict=True):
            chances = [row.chances[k] for row in rows]
            shares, errors = ([100 * c.chance for c in chances], [100 * c.error for c in chances])
            axis.errorbar(WIDTHS_MM, shares, errors, color=grey, label=name, capsize=2, ms=4.5, mfc="white", **look)
        axis.set_xscale("log")
        axis.set_xticks([5, 10, 20, 50, 100, 200, 400], ["5", "10", "20", "50", "100", "200", "400"])
        axis.minorticks_off()
        axis.set_xlabel("width of the pole [mm]")
        beams = rows[0].chances[k].beams
        axis.set_title(f"at least {beams} beam{'s' if beams > 1 else ''}", fontsize=10, loc="left")
        axis.grid(color="#dddddd")
        axis.set_ylim(-3, 103)
        axis.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("poles hit in one turn [%]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    figure.suptitle(
        f"UTM-30LX, one turn in {PERIOD_S:g} s, poles {HEIGHT_M:g} m high, {RANGE_M:g} m away, to both sides"
    )
    figure.savefig(PICTURE, dpi=110, metadata={"Software": None})


def _cell(found: PoleChances) -> str:
    once, thrice = found.chances
    return f"{once.chance:.2%} +- {once.error:.2%} ({thrice.chance:.2%})"


if __name__ == "__main__":
    main()
