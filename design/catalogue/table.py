"""The catalogue as tables of the most important figures of each kind of product."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

from scanwright.design.catalogue.catalogue import KINDS
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Bearing, Belt, Multibeam, Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing

MARK = "?"
FOOTNOTE = f"{MARK}: unverified, measure yours; `scanwright catalogue NAME -v` prints all values and their sources"
MOST_ROWS = 20  # of a short table: more products without a known price are one line of names
MOST_COLUMNS = 100


@dataclass(frozen=True, slots=True)
class Figure:
    """One column."""

    title: str  # with its unit
    fields: tuple[str, ...]  # fields of the record that it depends on; it is unverified if one of them is
    value: Callable[[Any], float | str | None]  # returns the figure of a product; None if it has none
    brief: bool = True  # whether a short table has this column


def _of(title: str, field: str, scale: float = 1.0, *, brief: bool = True) -> Figure:
    def value(product: Product) -> float | str | None:
        stated: float | str | None = getattr(product, field)
        return stated * scale if isinstance(stated, float | int) else stated

    return Figure(title, (field,), value, brief)


MASS, PRICE = _of("mass g", "mass_g"), _of("USD", "price_usd")
_STEPS = ("steps_per_turn", "first_step", "last_step")
FIGURES: dict[type[Product], tuple[Figure, ...]] = {
    Lidar: (
        _of("stated m", "range_max_mm", 1 / 1000),
        _of("practical m", "range_practical_mm", 1 / 1000),
        Figure("from m", ("range_min_mm",), lambda p: p.range_min_mm / 1000),
        Figure("field deg", _STEPS, lambda p: (p.last_step - p.first_step) * 360 / p.steps_per_turn),
        Figure("step deg", _STEPS[:1], lambda p: 360 / p.steps_per_turn),
        _of("rate Hz", "scan_rate_hz"),
        _of("noise mm", "range_sigma_mm"),
        MASS,
        PRICE,
    ),
    Servo: (
        _of("torque Nm", "stall_torque_nm"),
        _of("speed rpm", "no_load_rpm"),
        _of("step deg", "position_step_deg"),
        _of("backlash deg", "backlash_deg"),
        _of("reads deg", "position_feedback_deg"),
        MASS,
        PRICE,
    ),
    SlipRing: (
        _of("bore mm", "bore_mm"),
        _of("outer mm", "outer_diameter_mm"),
        _of("length mm", "length_mm", brief=False),
        _of("speed rpm", "max_rpm", brief=False),
        MASS,
        PRICE,
        _of("circuits", "circuits"),
    ),
    Bearing: (
        _of("bore mm", "bore_mm"),
        _of("outer mm", "outer_mm"),
        _of("width mm", "width_mm"),
        _of("load N", "static_load_n"),
        MASS,
        PRICE,
    ),
    Belt: (
        _of("pitch mm", "pitch_mm"),
        _of("width mm", "width_mm"),
        _of("tension N", "working_tension_n"),
        MASS,
        PRICE,
    ),
    Printer: (
        _of("thread", "thread"),
        _of("fit mm", "fit_clearance_mm"),
        _of("wall mm", "min_wall_mm"),
        Figure("bed mm", ("bed_mm",), lambda p: " x ".join(f"{side:g}" for side in p.bed_mm)),
    ),
    Multibeam: (
        Figure("layers", ("elevations_deg",), lambda p: len(p.elevations_deg)),
        Figure("up deg", ("elevations_deg",), lambda p: p.elevations_deg[-1]),
        Figure("down deg", ("elevations_deg",), lambda p: p.elevations_deg[0]),
        Figure("around deg", ("azimuth_deg",), lambda p: p.azimuth_deg[1] - p.azimuth_deg[0]),
        _of("rate Hz", "turn_rate_hz"),
        Figure("k points/s", ("points_per_second",), lambda p: p.points_per_second / 1000),
        PRICE,
    ),
}


def chosen(
    products: Iterable[Product],
    *,
    kind: str | None = None,
    min_range_m: float | None = None,
    max_mass_g: float | None = None,
    max_price_usd: float | None = None,
) -> list[Product]:
    """Return the products within all bounds; an unknown figure is outside. `min_range_m` refers to practical ranges."""

    def at_most(product: Product, field: str, most: float | None) -> bool:
        value = getattr(product, field, None)
        return most is None or (value is not None and value <= most)

    return [
        product
        for product in products
        if (kind is None or product.kind == kind)
        and (min_range_m is None or (isinstance(product, Lidar) and product.practical_range_m >= min_range_m))
        and at_most(product, "mass_g", max_mass_g)
        and at_most(product, "price_usd", max_price_usd)
    ]


def table_lines(products: Iterable[Product], in_full: bool = True) -> list[str]:
    """Return a table for each kind; unless `in_full`, of the main columns, or only names if there are several kinds."""
    listed = list(products)
    if not listed:
        return ["no product of the catalogue matches"]
    groups = {word.replace("_", " "): [p for p in listed if type(p) is kind] for word, kind in KINDS.items()}
    groups = {word: alike for word, alike in groups.items() if alike}
    if not in_full and len(groups) > 1:
        names = [_names(word, alike) for word, alike in groups.items()]
        return [*names, "`scanwright catalogue --kind lidar` prints the figures of one kind, `-v` all tables"]
    lines: list[str] = []
    for word, alike in groups.items():
        priced = [p for p in alike if getattr(p, "price_usd", None) is not None]
        short = not in_full and len(alike) > MOST_ROWS and len(priced) < len(alike)
        figures = [figure for figure in FIGURES[type(alike[0])] if figure.brief or in_full]
        heads = [word, *(figure.title for figure in figures), *(["maker"] if in_full else [])]
        rows = [
            [p.name, *(_cell(p, figure) for figure in figures), *([p.maker] if in_full else [])]
            for p in (priced if short else alike)
        ]
        lines += ["", *_aligned([heads, *rows])]
        if short:
            lines += [_names("price unknown", [p for p in alike if p not in priced])]
    return [*lines[1:], "", FOOTNOTE]


def _names(title: str, products: Iterable[Product]) -> str:
    return fill(f"{title}: {', '.join(p.name for p in products)}", MOST_COLUMNS, subsequent_indent="  ")


def _cell(product: Product, figure: Figure) -> str:
    value = figure.value(product)
    if value is None:
        return "-"
    word = value if isinstance(value, str) else f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
    known = [field for field in figure.fields if getattr(product, field) is not None]
    return word + (MARK if known[0] in product.unverified() else " ")


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Align numbers to the right, names and a last column of words to the left."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    words = any(row[-1][:1].isalpha() for row in rows[1:])
    if words:
        widths[-1] = 0
    return [
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]).rstrip()
        for row in rows
    ]
