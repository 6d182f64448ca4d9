"""`scanwright register`: poses, a map and a picture from files of clouds, or the reasons why there are none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.clouds.formats import check_target, read_clouds, write_clouds
from scanwright.firmware_io.registration.pairwise import Pair
from scanwright.firmware_io.registration.poses import cloud_names, read_poses, write_covariances, write_poses
from scanwright.firmware_io.registration.register import Registration, register
from scanwright.firmware_io.registration.sensor_view import SensorView, make_view
from scanwright.firmware_io.registration.thin import merge


@dataclass(frozen=True, slots=True, eq=False)
class RegisteredFiles:
    """Result of `register_files`.

    Attributes:
        names: of the clouds.
        registration: their poses and pairs.
        points: of the map; 0 if there is none, since the registration is not complete.
        wrote: all files.
        notes: data that the files cannot hold, or that were not read.
    """

    names: tuple[str, ...]
    registration: Registration
    points: int
    wrote: tuple[Path, ...]
    notes: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether every cloud has a consistent pose; else nothing was written."""
        return self.registration.complete

    @property
    def refused(self) -> list[Pair]:
        """The pairs that are not used."""
        return [pair for pair in self.registration.pairs if pair.why_not]

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        lines = [f"note: {line}" for line in self.notes]
        for pair in self.registration.pairs:
            if not pair.why_not:
                lines.append(f"{pair.a} - {pair.b}: {pair.overlap:.0%} overlap, {pair.contradiction:.1%} contradicted")
        lines += [f"{pair.a} - {pair.b}: not used: {'; '.join(pair.why_not)}" for pair in self.refused]
        positions = list(zip(self.names, self.registration.T_world, self.registration.covariance, strict=True))
        if not self.registration.complete:
            lost = [name for name, T, _ in positions if np.isnan(T[0, 0])]
            if lost:
                return [*lines, f"no place was found for {', '.join(lost)}: nothing is written"]
            for pair in self.registration.conflicts:
                lines.append(
                    f"{pair.a} - {pair.b}: overlap by {pair.overlap:.0%}, but {pair.contradiction:.0%} of the points "
                    "are in space that the other scanner measured to be free"
                )
            remedy = "places look alike here: give initial poses, or clouds from places in between"
            return [*lines, f"the poses contradict each other: nothing is written; {remedy}"]
        for name, T, covariance in positions:
            x, y, z = T[:3, 3]
            sigma_mm = 1e3 * np.sqrt(covariance[3:, 3:].trace())
            sigma_deg = np.degrees(np.sqrt(covariance[:3, :3].trace()))
            sure = f"sigma {sigma_mm:.2f} mm and {sigma_deg:.4f} deg" if covariance.any() else "the frame of the map"
            lines.append(f"{name}: at ({x:z.4f}, {y:z.4f}, {z:z.4f}) m, {sure}")
        return [*lines, f"wrote {self.points:,} points to {', '.join(str(path) for path in self.wrote)}"]


def register_files(
    paths: Sequence[Path],
    out: Path,
    poses: Path,
    start: Path | None,
    spacing_m: float,
    map_spacing_m: float,
    scanner: AngleSet | None,
    progress: Progress = no_progress,
) -> RegisteredFiles:
    """Register clouds; write map, poses, covariances and picture if the registration is complete.

    The arguments are those of `scanwright.register`; the covariances get the suffix `.cov.csv`, the picture `.png`.
    Without `start`, the poses in the files, if there are any, are the start.

    Raises:
        RecordingError: a file cannot be read or written, there is only one cloud, or the angle set states no
            covariance.
    """
    for name, value in (("spacing_m", spacing_m), ("map_spacing_m", map_spacing_m)):
        if not (np.isfinite(value) and value > 0):
            raise RecordingError(f"{name} = {value}: must be above 0")
    check_target(out)
    check_place(poses, RecordingError)
    counts, clouds, notes = [], [], []
    for k, path in enumerate(paths):
        if path.resolve() in [other.resolve() for other in paths[:k]]:
            raise RecordingError(f"{path}: given twice; register needs different clouds")
        read, lines = read_clouds(path)
        counts.append(len(read))
        clouds += read
        notes += lines
    names = cloud_names(list(zip(paths, counts, strict=True)))
    if len(clouds) < 2:
        raise RecordingError(f"{len(clouds)} cloud: register needs at least two")
    if scanner is None and all("joint_rad" in cloud.columns for cloud in clouds):
        notes.append("sigmas assume exact scanner angles: pass the angle set (`angles`) to add its uncertainty")
    for k, cloud in enumerate(clouds):
        for i in range(k):
            if np.array_equal(cloud.points_m, clouds[i].points_m, equal_nan=True):
                raise RecordingError(f"{names[k]}: same points as {names[i]}; register needs different clouds")
    if start is not None:
        starts = read_poses(start, names)
    else:
        starts = [cloud.T_world_cloud for cloud in clouds] if any(cloud.placed for cloud in clouds) else []
    views = []
    for k, (name, cloud) in enumerate(zip(names, clouds, strict=True)):
        progress(f"preparing {name}", k / len(clouds))
        joint = cloud.columns.get("joint_rad") if scanner else None
        joint_rad = None if joint is None else joint.astype(float)
        views.append(make_view(name, cloud.points_m.astype(float), spacing_m, scanner, joint_rad))
    registration = register(views, starts, progress)
    if not registration.complete:
        return RegisteredFiles(tuple(names), registration, 0, (), tuple(notes))
    progress("merging the clouds")
    merged = merge(clouds, registration.T_world, map_spacing_m)
    wrote = write_clouds(out, [merged])
    covariances, png = poses.with_suffix(".cov.csv"), out.with_suffix(".png")
    write_poses(poses, names, clouds, registration.T_world)
    write_covariances(covariances, names, registration.covariance)
    overlap_picture(png, views, registration)
    files = (*wrote.paths, poses, covariances, png)
    return RegisteredFiles(tuple(names), registration, wrote.rows, files, (*notes, *wrote.notes))


_SHOWN = 20_000  # points of one cloud: more only blacken the page
_SHOWN_PERCENT = (0.5, 99.5)


def overlap_picture(png: Path, views: Sequence[SensorView], registration: Registration) -> None:
    """Draw a complete registration."""
    colours = colormaps["turbo"](np.linspace(0.05, 0.95, len(views)))
    figure = Figure(figsize=(12, 6.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    above, table = figure.subplots(1, 2, width_ratios=[1.5, 1])
    placed = [frames.apply(T, view.fine.points_m) for view, T in zip(views, registration.T_world, strict=True)]
    for points, T, colour, view in zip(placed, registration.T_world, colours, views, strict=True):
        some = points[:: len(points) // _SHOWN + 1]
        above.scatter(some[:, 0], some[:, 1], s=1, color=colour, alpha=0.5, linewidths=0, rasterized=True)
        above.plot(T[0, 3], T[1, 3], "o", color=colour, markeredgecolor="black", label=view.name)
    low, high = np.percentile(np.concatenate(placed)[:, :2], _SHOWN_PERCENT, axis=0)
    margin = 0.05 * (high - low).max()
    above.set(
        title="from above, circles are the scan positions",
        xlabel="x [m]",
        ylabel="y [m]",
        aspect="equal",
        xlim=(low[0] - margin, high[0] + margin),
        ylim=(low[1] - margin, high[1] + margin),
    )
    names = [view.name for view in views]
    share = np.full((len(names), len(names)), np.nan)
    for pair in registration.pairs:
        if not pair.why_not:
            i, j = names.index(pair.a), names.index(pair.b)
            share[i, j] = share[j, i] = pair.overlap
    image = table.imshow(share, vmin=0, vmax=1, cmap="viridis")
    table.set(title="overlap of the pairs that are used", xticks=range(len(names)), yticks=range(len(names)))
    table.set_xticklabels(names, rotation=90, fontsize=7)
    table.set_yticklabels(names, fontsize=7)
    figure.colorbar(image, ax=table, shrink=0.7)
    with atomic_write(png, RecordingError) as part:
        figure.savefig(part, format="png", metadata={"Software": None})
