"""Report of a calibration, as a record and as lines of text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Float64
from numpy import ndarray

from scanwright.firmware_io.calibration.entropy import Witness
from scanwright.firmware_io.calibration.estimate import Estimate
from scanwright.firmware_io.calibration.model import COUNT, LAG, MOUNT, PARAMETERS, Mount, ReturnedBeams
from scanwright.firmware_io.calibration.scene_motion.overlapping_views import OverlappingViews, overlapping_views
from scanwright.firmware_io.calibration.solve import heights, planes_alone, rms, sums

_WALLS = 3  # largest ones, whose straightness is reported
_FEW = 3  # ray conflicts caused by a slim object
_RESIDUAL = 1.5  # times the noise within small patches
_LESS_CRISP = "the cloud has become less crisp (higher entropy)"
_SURE = 2.0  # standard deviations, from which on a delay is a result


def _agreement(result: Estimate, mount: Mount, x: Float64[ndarray, " parameters"]) -> tuple[float, tuple[float, ...]]:
    """Return residuals of the beams of a calibration for any parameters, with refitted planes.

    Returns:
        The rms of the ranges about their surfaces [m], and the rms heights, per side of the scan plane and square
        metre, of the largest surfaces [m].
    """
    tiles, grouping = result.tiles, result.grouping
    on = result.clear & (grouping.surface[tiles.tile] >= 0)
    beams, tile = tiles.beams.select(on).late_by(x[LAG[0]]), tiles.tile[on]
    weight = np.ones(tile.size)
    grouping = planes_alone(mount, x, beams, tile, weight / result.noise_m**2, grouping)
    normal = sums(mount, x, beams, tile, weight, grouping.planes, kink=np.inf)
    used = grouping.used
    height_m, weight = heights(normal[used])
    surface = grouping.surface[used]
    walls = []
    for wall in np.argsort(np.bincount(surface, tiles.count[used]))[::-1][:_WALLS]:
        mine = surface == wall
        _, label = np.unique(2 * grouping.spot[used][mine] + tiles.side[used][mine], return_inverse=True)
        total = np.bincount(label, weight[mine])
        mean = np.bincount(label, weight[mine] * height_m[mine]) / total
        walls.append(float(np.sqrt(mean**2 @ total / total.sum())))
    return rms(normal, float(tile.size)), tuple(walls)


def calibration_report(
    result: Estimate, start: Float64[ndarray, " parameters"], mount: Mount, beams: ReturnedBeams, witness: Witness
) -> dict[str, Any]:
    """Return the record of a calibration; it has `faults` if the result is wrong."""
    sd = np.full(COUNT, np.nan)
    sd[result.choice.free] = np.sqrt(np.diag(result.covariance))
    applied = start.copy()
    applied[[*MOUNT, *LAG]] = result.x[[*MOUNT, *LAG]]
    fits = {"before": start, "after": result.x, "as_assembled": applied}
    residual_m, walls_m = {}, {}
    for name, x in fits.items():
        residual_m[name], walls_m[name] = _agreement(result, mount, x)
    views = overlapping_views(mount, result.x, beams, result.tiles.noise_m)
    return {
        "schema": "scanwright/calibration/1",
        "beams": int(beams.range_m.size),
        "beams_used": int(result.clear.sum()),
        "beams_at_edges": int(result.tiles.count[result.grouping.used].sum() - result.clear.sum()),
        "surfaces": len(result.grouping.q),
        "parameters": [
            {
                "name": PARAMETERS[k].name,
                "words": PARAMETERS[k].words,
                "unit": PARAMETERS[k].unit,
                "value": float(result.x[k] * PARAMETERS[k].shown),
                "sd": float(sd[k] * PARAMETERS[k].shown),
                "start": float(start[k] * PARAMETERS[k].shown),
                "applied_by": "angle set" if k in MOUNT else "assemble --lag-s" if k in LAG else None,
            }
            for k in result.choice.free.tolist()
        ],
        "covariance": {
            "names": [PARAMETERS[k].name for k in result.choice.free.tolist()],
            "matrix": result.covariance.tolist(),
        },
        "singular_values": result.spectrum.tolist(),
        "held": [{"names": list(fixed.names), "words": fixed.words, "why": fixed.why} for fixed in result.choice.fixed],
        "notes": [
            *result.choice.notes,
            *_motion_warnings(result, views, beams, residual_m["after"]),
        ],
        "faults": [*_moved(result), *([_LESS_CRISP] if witness.less_crisp else [])],
        "drift": [
            {
                "recording": drift.recording,
                "velocity_mm_s": (drift.velocity_m_s * 1e3).tolist(),
                "turn_deg_s": np.degrees(drift.turn_rad_s).tolist(),
                "chi2_of_6": drift.chi2,
            }
            for drift in result.drifts
        ],
        "second_looks": {
            "asked": views.tested,
            "compared": views.compared,
            "seen_through": views.seen_through,
        },
        "range_noise_mm": result.noise_m * 1e3,
        "wall_bulge_mm": result.bulge_m * 1e3,
        "residual_mm": {name: 1e3 * each for name, each in residual_m.items()},
        "wall_straightness_mm": {name: [1e3 * wall for wall in each] for name, each in walls_m.items()},
        "entropy": {
            "kernel_mm": witness.width_m * 1e3,
            "before": witness.before,
            "after": witness.after,
            "change_sd": witness.change_sd,
            "minimum_from_result": {
                PARAMETERS[k].name: None
                if (off := witness.minima[PARAMETERS[k].name]) is None
                else {"value": off * PARAMETERS[k].shown, "unit": PARAMETERS[k].unit}
                for k in MOUNT
            },
        },
    }


def _moved(result: Estimate) -> Iterator[str]:
    for drift in result.drifts:
        if drift.sure:
            mm_s, deg_s = 1e3 * np.linalg.norm(drift.velocity_m_s), np.degrees(np.linalg.norm(drift.turn_rad_s))
            yield (
                f"the platform moved during recording {drift.recording + 1}, by about {mm_s:.2g} mm/s and "
                f"{deg_s:.2g} deg/s: scan again with the scanner held still"
            )


def _motion_warnings(result: Estimate, views: OverlappingViews, beams: ReturnedBeams, residual_m: float) -> list[str]:
    warnings, noise_m = [], result.tiles.noise_m
    if views.seen_through > _FEW:
        joined = len(beams.curves) > 1 and not beams.place.any()
        causes = [
            "a person walked through the scene",
            "an object was moved",
            "times of scans or angles were wrong",
            *["the scanner was moved between recordings (one_place excludes that)"] * joined,
        ]
        warnings.append(
            f"{views.seen_through:,} of {views.compared:,} beams ended where another view, at another time, went "
            f"through: {', '.join(causes[:-1])}, or {causes[-1]}"
        )
    if residual_m > _RESIDUAL * noise_m:
        warnings.append(
            f"the ranges are off by {1e3 * residual_m:.1f} mm, their noise is {1e3 * noise_m:.1f} mm: something moved, "
            "or the scanner has an error that none of these parameters describes"
        )
    return warnings


def lines(record: dict[str, Any]) -> Iterator[str]:
    """Format the record."""
    for reason, count in record["left_out"].items():
        yield f"dropped {count:,} beams: {reason.replace('_', ' ')}"
    yield (
        f"{record['beams']:,} beams: {record['beams_used']:,} on {record['surfaces']} flat surfaces, "
        f"{record['beams_at_edges']:,} near edges (not used); "
        f"range noise {record['range_noise_mm']:.1f} mm, surface unevenness {record['wall_bulge_mm']:.1f} mm"
    )
    for entry in record["parameters"]:
        change = f"  from {entry['start']:.4f}" if entry["applied_by"] == "angle set" else ""
        yield f"  {entry['words']:22} {entry['value']:10.4f} +- {entry['sd']:.4f} {entry['unit']}{change}"
    for fixed in record["held"]:
        yield f"  {fixed['words']:22}       not estimated: {fixed['why']}"
    residual, walls, entropy = record["residual_mm"], record["wall_straightness_mm"], record["entropy"]
    yield (
        f"residual          {residual['before']:.1f} -> {residual['after']:.1f} mm "
        f"({residual['as_assembled']:.1f} as `assemble` applies it)"
    )
    pairs = ", ".join(f"{a:.1f} -> {b:.1f}" for a, b in zip(walls["before"], walls["after"], strict=True))
    yield f"bend of walls     {pairs} mm"
    fallen = entropy["after"] - entropy["before"]
    own = [
        f"{name.rsplit('_', 1)[0]} {off['value']:+.3f} {off['unit']}" if off else f"{name.rsplit('_', 1)[0]} ?"
        for name, off in entropy["minimum_from_result"].items()
    ]
    change = (
        f"{entropy['before']:.3f} -> {entropy['after']:.3f}, changed by {fallen:+.3f} +- {entropy['change_sd']:.3f}"
    )
    yield f"entropy           {change}; its minimum is at {', '.join(own)}"
    views = record["second_looks"]
    yield (
        f"double coverage   {100 * views['compared'] // max(views['asked'], 1)} % of the beams "
        "(motion elsewhere, and people who do not move, are not detected)"
    )
    for note in record["notes"]:
        yield f"warning: {note}"
    for fault in record["faults"]:
        yield f"error: {fault}"
    for entry in record["parameters"]:
        if entry["name"] == "lag_s" and abs(entry["value"]) > _SURE * entry["sd"]:
            yield f"the angles of these recordings are late: lag_s = {entry['value'] / 1e3:.6f} corrects them"
