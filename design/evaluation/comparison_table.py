"""A comparison as text and as CSV."""

from __future__ import annotations

import csv
from dataclasses import asdict, fields
from pathlib import Path

from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Multibeam
from scanwright.design.errors import BuildError
from scanwright.design.evaluation.comparison import AS_BUILT, SCANNERS, ComparisonRow, bought
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.objective.holes import percent
from scanwright.design.objective.stated_error import error_words
from scanwright.design.task.task import LoadedTask, load_task

_NAME = 34  # columns of a name in the short table
IN_THE_TABLE = ("scan_rate_hz", "range_max_mm", "range_practical_mm", "range_sigma_mm", "price_usd")


def short_table(rows: list[ComparisonRow]) -> list[str]:
    """Return the most important columns as lines of at most 100 characters."""
    width = min(max(len(row.name) for row in rows), _NAME)
    return [
        f"{'':{width}} time [s] {'J':>8} {'beams':>7} {'blind':>7} gap [deg] noise [mm] {'USD':>7}",
        *(
            f"{row.name[:width]:{width}} {row.time_s:8.2f} {row.J:8.4f} {_known(row.beams_per_ball, '.4g'):>7}"
            f" {percent(row.blind_weight):>7} {row.gap_deg:9.3f} {_known(row.range_sigma_mm, 'g'):>10}"
            f" {_known(row.cost_usd, ',.0f'):>7}"
            for row in rows
        ),
    ]


def table(rows: list[ComparisonRow]) -> list[str]:
    """Return all columns as lines of text, the heading first."""
    width = max(len(row.name) for row in rows)
    lines = [
        f"{'':{width}}  {'setting [deg]':26} {'time [s]':>8} {'turns':>5} {'J':>8} {'+-':>6} {'blind':>7}"
        f" {'of weight':>13} {'gap [deg]':>9} {'layers':>6} {'points/s':>9} {'range [m]':>9} {'practical':>9}"
        f" {'noise [mm]':>10} {'beams':>7} {'per USD':>8} {'USD':>7}"
    ]
    for row in rows:
        lines.append(
            f"{row.name:{width}}  {row.setting:26} {row.time_s:8.2f} {row.turns:5} {row.J:8.4f}"
            f" {error_words(row.J, row.J_error):>6} {percent(row.blind_fraction):>7} {percent(row.blind_weight):>13}"
            f" {row.gap_deg:9.3f} {row.layers:6} {row.points_per_s:9,.0f} {_known(row.range_stated_m, ',g'):>9}"
            f" {_known(row.range_practical_m, ',g'):>9} {_known(row.range_sigma_mm, 'g'):>10}"
            f" {_known(row.beams_per_ball, '.4g'):>7} {_known(row.beams_per_ball_per_usd, '.3g'):>8}"
            f" {_known(row.cost_usd, ',.0f'):>7}"
        )
    return lines


def notes(loaded: LoadedTask, rows: list[ComparisonRow]) -> list[str]:
    """Return notes on the columns, on candidates without beams in the region, and on unverified numbers."""
    ball = loaded.task.density.ball_radius_deg
    names = {row.name for row in rows}
    blind = dict.fromkeys(row.name for row in rows if row.blind_weight == 1)
    others = [load_task(Path(name)) for name in SCANNERS if name in names]
    products = dict.fromkeys(product for task in (loaded, *others) for product in bought(task))
    unverified = [(product.name, _unverified(product)) for product in products]
    unverified += [(p.name, p.unverified()) for p in loaded.products if isinstance(p, Multibeam)]
    without = f"all rows but {AS_BUILT!r} are" if AS_BUILT in names else "every row is"
    return [
        f"parts: {without} without parts",
        "time: of the measurement; ready-made scanners: of one turn, and of the turns in one period of the task",
        f"J: mean of -ln(1 + beams within {ball:g} deg) over the weight; +- covers turns that interlace or repeat",
        "blind: share of the sphere outside the masks that is never seen; of weight: share of the weight",
        "gap: widest between neighbouring scan lines or layers",
        "beams: within the ball, exp(-J) - 1, the geometric mean; per USD: over the price; ? for another objective",
        "range, noise: of the 2D lidar as its maker states them, one standard deviation; ? for ready-made scanners",
        "practical: the range [m] that users of the 2D lidar get; the stated one if unknown",
        "USD: lidar, servo and slip ring without printed parts, or the scanner; ? if a price is unknown",
        "ready-made scanners are upright; one tilt (pitch or roll) and Bonn (twist) are tuned to this task",
        f"{' and '.join(SCANNERS)}: scanners of the shipped tasks of that name, their products, motion and angles",
        *(f"{name} sees nothing of the weight: its J is that of no beam, and has no error" for name in blind),
        *(f"not verified of {name}: {', '.join(fields)}" for name, fields in unverified if fields),
    ]


def write_csv(path: Path, rows: list[ComparisonRow]) -> None:
    """Write the rows, with the names of their fields as heading; unknown values are empty."""
    with atomic_write(path, BuildError) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(ComparisonRow)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _unverified(product: Product) -> list[str]:
    """Return the unverified values of the table."""
    return [field for field in product.unverified() if field in IN_THE_TABLE]


def _known(value: float | None, layout: str) -> str:
    return "?" if value is None else format(value, layout)
