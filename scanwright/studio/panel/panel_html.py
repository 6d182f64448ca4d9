"""The facts of a setting and the table of kept settings, as HTML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

from scanwright.design.evaluation.metres import PlaneFigures
from scanwright.design.objective.holes import percent
from scanwright.design.objective.stated_error import error_words
from scanwright.studio.panel.facts import WALL_M, Facts

CELL = "padding:1px 6px 1px 0;white-space:nowrap"
NUMBER = f"{CELL};text-align:right;font-variant-numeric:tabular-nums"


def facts_html(facts: Facts, field: str = "") -> str:
    """Return the facts of the present setting, without parts.

    The address of the page and the dots of the pads follow a hidden element, which names the `field` of the angles.
    """
    state = "exact" if facts.exact else "dragging"
    best = min(facts.mounts, key=facts.mounts.__getitem__, default="")
    ratio = "" if math.isnan(facts.ratio) else f"<b>{facts.ratio:.2f} x</b> the beams of {escape(best)}"
    requirements = "".join(
        _row(words, value, "&#10003; met" if met else '<span class="sw-bad">&#10007; not met</span>')
        for words, met, value in facts.requirements()
    )
    rows = [
        ("J", f"<b>{facts.J:.5f}</b>", f"&plusmn; {error_words(facts.J, facts.J_error)}, {state}, without parts"),
        ("blind cone", f"{facts.blind_cone_deg:.2f} deg", "half angle"),
        ("widest gap", f"{facts.gap_deg:.3f} deg", f"{facts.gap_mm:.0f} mm at {WALL_M:g} m"),
        ("shortest turn", _period(facts), f"for {facts.density} beam{'s' * (facts.density > 1)} within the ball"),
    ]
    angles = ",".join(f"{angle:g}" for angle in facts.setting.angles_deg)
    return (
        f'<div class="sw-setting" hidden data-angles="{angles}" data-field="{field}"></div>'
        f'<div style="font-size:16px;margin:2px 12px">{ratio}</div>'
        f'<table style="font-size:12px;line-height:1.35;border-spacing:0;margin:0 12px 6px">'
        f"{requirements}{''.join(_row(*row) for row in rows)}</table>"
    ) + "".join(_on_plane(region, figures) for region, figures in facts.planes)


def _row(name: str, value: str, note: str) -> str:
    return (
        f'<tr><td style="{CELL};white-space:normal">{name}</td><td style="{NUMBER}">{value}</td>'
        f'<td style="padding:1px 0">{note}</td></tr>'
    )


def kept_html(kept: Mapping[str, Facts]) -> str:
    """Return the kept settings as ratios to the best usual mount, the best first."""
    shown = sorted(kept.items(), key=lambda pair: pair[1].J)
    head = "".join(f'<th style="{NUMBER}">{name}</th>' for name in ("beams", "never seen", "gap [deg]", "turn [s]"))
    body = ""
    for name, facts in shown:
        angles = ", ".join(f"{angle:g}" for angle in facts.setting.angles_deg)
        ratio = f"J {facts.J:.4f}" if math.isnan(facts.ratio) else f"<b>{facts.ratio:.2f} x</b>"
        cells = (ratio, percent(facts.blind_weight), f"{facts.gap_deg:.3f}", _period(facts).removesuffix(" s"))
        body += f'<tr><td style="{CELL}">{escape(name)}</td>'
        body += "".join(f'<td style="{NUMBER}">{cell}</td>' for cell in cells) + "</tr>"
        body += f'<tr><td colspan="5" style="padding:0 0 3px;font-size:11px">({angles}) deg</td></tr>'
    return (
        '<div style="overflow-x:auto;margin:0 12px;font-size:12px">Beams per direction: the best usual mount is 1.'
        f'<table style="border-spacing:0"><tr><th style="{CELL};text-align:left">setting</th>{head}</tr>'
        f"{body}</table></div>"
    )


def _on_plane(region: str, figures: PlaneFigures | None) -> str:
    """Return two lines, known or not, so that nothing below them moves."""
    words = figures.words() if figures else f"{region}: ..."
    return f'<div style="font-size:12px;line-height:1.35;min-height:2.7em;margin:0 12px 6px">{escape(words)}</div>'


def _period(facts: Facts) -> str:
    if facts.period_s is None:
        return "..."
    return "&ndash;" if math.isnan(facts.period_s) else f"{facts.period_s:.3f} s"
