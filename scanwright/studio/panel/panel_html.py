"""What the panel says, as HTML: the facts of a setting, the table of those that were kept, the scale of the colours."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

from scanwright.design.evaluation.metres import PlaneFigures
from scanwright.design.objective.holes import percent
from scanwright.design.objective.stated_error import error_words
from scanwright.serving.style import COLOUR_STOPS
from scanwright.studio.panel.facts import WALL_M, Facts
from scanwright.studio.view.coloured_sphere import LEAST_OF_HIGHEST

CELL = "padding:1px 6px 1px 0;white-space:nowrap"
NUMBER = f"{CELL};text-align:right;font-variant-numeric:tabular-nums"


def facts_html(facts: Facts, log: bool) -> str:
    """The facts of the present setting, without parts; `log`: J is the mean of -ln(1 + d), differences are ratios."""
    state = "exact" if facts.exact else "dragging"
    rows = [
        ("J", f"<b>{facts.J:.5f}</b>", f"&plusmn; {error_words(facts.J, facts.J_error)}, {state}, without parts"),
        *((name, f"{J:.5f}", _against(facts.J, J, log)) for name, J in facts.standard.items()),
        ("blind cone", f"{facts.blind_cone_deg:.2f} deg", "half angle"),
        ("widest gap", f"{facts.gap_deg:.3f} deg", f"{facts.gap_mm:.0f} mm at {WALL_M:g} m"),
        ("never seen", percent(facts.blind_weight), "of the weight, without parts"),
        ("shortest turn", _period(facts), f"{facts.density} per ball"),
    ]
    cells = "".join(
        f'<tr><td style="{CELL}">{name}</td><td style="{NUMBER}">{value}</td>'
        f'<td style="padding:1px 0;opacity:.65">{note}</td></tr>'
        for name, value, note in rows
    )
    table = f'<table style="font-size:12px;line-height:1.35;border-spacing:0;margin:0 12px 6px">{cells}</table>'
    return table + "".join(_on_plane(region, figures) for region, figures in facts.planes)


def kept_html(kept: Mapping[str, Facts]) -> str:
    """The settings that were kept, the best J first, the best of each column in bold."""
    if not kept:
        return '<p style="font-size:13px;margin:4px 12px">Nothing kept yet: "Keep" puts the present setting here.</p>'
    shown = sorted(kept.items(), key=lambda pair: pair[1].J)
    columns = {
        "J": [facts.J for _, facts in shown],
        "blind [deg]": [facts.blind_cone_deg for _, facts in shown],
        "gap [deg]": [facts.gap_deg for _, facts in shown],
        "turn [s]": [facts.period_s for _, facts in shown],
    }
    digits = {"J": 4, "blind [deg]": 1, "gap [deg]": 3, "turn [s]": 3}
    head = "".join(f'<th style="{NUMBER}">{name}</th>' for name in columns)
    body = ""
    for row, (name, facts) in enumerate(shown):
        angles = ", ".join(f"{angle:g}" for angle in facts.setting.angles_deg)
        cells = "".join(_cell(values, row, digits[column]) for column, values in columns.items())
        body += f'<tr><td style="{CELL}" title="{angles}">{escape(name)}</td>{cells}</tr>'
        body += f'<tr><td colspan="5" style="padding:0 0 3px;opacity:.65;font-size:11px">({angles}) deg</td></tr>'
    return (
        '<div style="overflow-x:auto;margin:0 12px"><table style="font-size:12px;border-spacing:0">'
        f'<tr><th style="{CELL};text-align:left">setting</th>{head}</tr>{body}</table></div>'
    )


def scale_html(highest: float) -> str:
    """The colours of the sphere and what they mean."""
    stops = ", ".join(f"rgb{stop}" for stop in COLOUR_STOPS)
    lowest = max(1.0, highest / LEAST_OF_HIGHEST)
    bar = f"height:9px;border-radius:2px;background:linear-gradient(90deg, {stops})"
    return (
        f'<div style="font-size:11px;margin:4px 12px"><div style="{bar}"></div>'
        f'<div style="display:flex;justify-content:space-between"><span>{lowest:,.0f}</span>'
        f"<span>mean beams per ball, without parts, logarithmic</span><span>{highest:,.0f}</span></div>"
        "<div>pale: none; white edge: what matters; red: hidden by the robot; green: axis and fan</div></div>"
    )


def _on_plane(region: str, figures: PlaneFigures | None) -> str:
    """Two lines, whether it is known yet or not, so that nothing below them moves."""
    words = figures.words() if figures else f"{region}: ..."
    return f'<div style="font-size:12px;line-height:1.35;min-height:2.7em;margin:0 12px 6px">{escape(words)}</div>'


def _against(J: float, other: float, log: bool) -> str:
    if log and math.isfinite(J) and math.isfinite(other):
        return f"{math.exp(min(other - J, 50.0)):.2f} x its beams"
    return ""


def _period(facts: Facts) -> str:
    return "&ndash;" if math.isnan(facts.period_s) else f"{facts.period_s:.3f} s"


def _cell(values: list[float], row: int, digits: int) -> str:
    if math.isnan(values[row]):
        return f'<td style="{NUMBER}">&ndash;</td>'
    text = f"{values[row]:.{digits}f}"
    best = values[row] == min(value for value in values if not math.isnan(value))
    return f'<td style="{NUMBER}">{f"<b>{text}</b>" if best else text}</td>'
