"""`scanwright register`: files of clouds become poses, a map and a picture, or the word why they do not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import check_place
from scanwright.firmware_io.clouds.formats import check_target, read_clouds, write_clouds
from scanwright.firmware_io.registration.merge import merge
from scanwright.firmware_io.registration.overlap_picture import overlap_picture
from scanwright.firmware_io.registration.pairwise import Pair
from scanwright.firmware_io.registration.poses import cloud_names, read_poses, write_covariances, write_poses
from scanwright.firmware_io.registration.register import Registration, register
from scanwright.firmware_io.registration.sensor_view import make_view


@dataclass(frozen=True, slots=True, eq=False)
class RegisteredFiles:
    """What became of `register_files`.

    Attributes:
        names: of the clouds.
        found: their poses and pairs.
        points: of the map; 0 where there is none, as a cloud found no place.
        wrote: all files.
        said: what the files could not hold, or what was not read.
    """

    names: tuple[str, ...]
    found: Registration
    points: int
    wrote: tuple[Path, ...]
    said: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether every cloud found its place; else nothing was written."""
        return self.found.complete

    @property
    def refused(self) -> list[Pair]:
        """The pairs that were not believed."""
        return [pair for pair in self.found.pairs if pair.why_not]

    def lines(self) -> list[str]:
        """The same in words."""
        lines = [f"note: {line}" for line in self.said]
        for pair in self.found.pairs:
            if not pair.why_not:
                lines.append(f"{pair.a} - {pair.b}: {pair.overlap:.0%} overlap, {pair.contradiction:.1%} contradicted")
        lines += [f"{pair.a} - {pair.b}: not used: {'; '.join(pair.why_not)}" for pair in self.refused]
        stands = list(zip(self.names, self.found.T_world, self.found.covariance, strict=True))
        if not self.found.complete:
            lost = [name for name, T, _ in stands if np.isnan(T[0, 0])]
            return [*lines, f"no place was found for {', '.join(lost)}: nothing is written"]
        for name, T, covariance in stands:
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
    say: Callable[[str], None],
) -> RegisteredFiles:
    """Register clouds, write map, poses, covariances and picture; nothing at all unless every cloud found its place.

    Args:
        paths: files of clouds, at least two clouds in all.
        out: the map, in any format.
        poses: TUM file to write; `.cov.csv` goes beside it.
        start: TUM file of start poses, by the names in its comments or in the order of the clouds; without it the poses
            in the files, if there are any, are the start.
        spacing_m: between the points that are registered.
        map_spacing_m: edge of the voxels of the map.
        scanner: angle set that all clouds were assembled with: what its covariance means for the poses is part of
            theirs. None takes the calibration to be right.
        say: progress.

    Raises:
        RecordingError: a file cannot be read or written, there is only one cloud, or the angle set states no
            covariance.
    """
    for name, value in (("spacing", spacing_m), ("map spacing", map_spacing_m)):
        if not (np.isfinite(value) and value > 0):
            raise RecordingError(f"{name} {value} m: must be above 0")
    check_target(out)
    check_place(poses, RecordingError)
    counts, clouds, said = [], [], []
    for k, path in enumerate(paths):
        if path.resolve() in [other.resolve() for other in paths[:k]]:
            raise RecordingError(f"{path}: named twice; a cloud tells nothing of its own place")
        read, lines = read_clouds(path)
        counts.append(len(read))
        clouds += read
        said += lines
    names = cloud_names(list(zip(paths, counts, strict=True)))
    if len(clouds) < 2:
        raise RecordingError(f"{len(clouds)} cloud: registering takes two at least")
    if scanner is None and all("joint_rad" in cloud.columns for cloud in clouds):
        said.append("the sigmas take the scanner's angles as true: --angles adds what its calibration left open")
    for k, cloud in enumerate(clouds):
        for i in range(k):
            if np.array_equal(cloud.points_m, clouds[i].points_m, equal_nan=True):
                raise RecordingError(
                    f"{names[k]}: the very points of {names[i]}; a cloud tells nothing of its own place"
                )
    if start is not None:
        given = read_poses(start, names)
    else:
        given = [cloud.T_world_cloud for cloud in clouds] if any(cloud.placed for cloud in clouds) else []
    views = []
    for name, cloud in zip(names, clouds, strict=True):
        say(f"{name}: {len(cloud.points_m):,} points")
        joint = cloud.columns.get("joint_rad") if scanner else None
        joint_rad = None if joint is None else joint.astype(float)
        views.append(make_view(name, cloud.points_m.astype(float), spacing_m, scanner, joint_rad))
    found = register(views, given, say)
    if not found.complete:
        return RegisteredFiles(tuple(names), found, 0, (), tuple(said))
    say("merging")
    merged = merge(clouds, found.T_world, map_spacing_m)
    wrote = write_clouds(out, [merged])
    covariances, png = poses.with_suffix(".cov.csv"), out.with_suffix(".png")
    write_poses(poses, names, clouds, found.T_world)
    write_covariances(covariances, names, found.covariance)
    overlap_picture(png, views, found)
    files = (*wrote.paths, poses, covariances, png)
    return RegisteredFiles(tuple(names), found, wrote.rows, files, (*said, *wrote.said))
