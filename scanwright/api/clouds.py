"""Clouds: read, written, joined, and made a map of."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scanwright.api.arguments import AnglesLike, Say, as_angle_set, quiet
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import check_place
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds

if TYPE_CHECKING:
    from scanwright.firmware_io.mapping.map_files import MapSummary
    from scanwright.firmware_io.registration.register_files import RegisteredFiles


def register(
    clouds: Sequence[str | Path],
    out: str | Path,
    *,
    poses: str | Path | None = None,
    start: str | Path | None = None,
    angles: AnglesLike | None = None,
    spacing_m: float = 0.1,
    map_spacing_m: float = 0.02,
    say: Say = quiet,
) -> RegisteredFiles:
    """Find where clouds stand to each other, from no start if need be, and merge them into one map.

    Args:
        clouds: of one place, two or more.
        out: map to write.
        poses: TUM file to write; None for one beside the map.
        start: TUM file of start poses, a line for each cloud; found if not given.
        angles: calibrated angle set that all clouds were assembled with: what its covariance means for the poses is
            part of their covariance. Without it the calibration is taken to be right.
        spacing_m: distance of the points that are registered.
        map_spacing_m: distance of the points of the map.
        say: is told what is being done.

    Raises:
        RecordingError: a file cannot be read or written, there is only one cloud, or the angle set states no
            covariance.
    """
    from scanwright.firmware_io.registration.register_files import register_files

    target = Path(out)
    check_place(target, RecordingError)
    tum = target.with_suffix(".tum") if poses is None else Path(poses)
    given = None if start is None else Path(start)
    scanner = None if angles is None else as_angle_set(angles)
    paths = [Path(cloud) for cloud in clouds]
    return register_files(paths, target, tum, given, spacing_m, map_spacing_m, scanner, lambda step, _=None: say(step))


def make_map(
    clouds: Sequence[str | Path],
    out: str | Path,
    *,
    angles: AnglesLike | None = None,
    poses: str | Path | None = None,
    resolution_m: float = 0.05,
    floor_m: float | None = None,
    from_m: float = 0.1,
    to_m: float = 1.8,
    seen_through_m: float | None = None,
    say: Say = quiet,
) -> MapSummary:
    """Turn clouds into an occupancy grid, as ROS's map_server reads it: YAML and PGM.

    A cell is occupied where a point lies in it between two heights above the floor; free where it is not and a
    beam passed below the lower one; else unknown.

    Args:
        clouds: of one place, z up, in one frame or with `poses`.
        out: YAML file to write; the PGM goes beside it.
        angles: angle set that all clouds were assembled with: its optical centre is where they were seen from. Without
            it the origins of clouds that have poses are; of others nobody knows it, and they free nothing.
        poses: TUM file, a line for each cloud, as `register` writes it; the poses in the files if not given.
        resolution_m: edge of a cell.
        floor_m: height of the floor in the map; found if not given.
        from_m: what is lower above the floor is driven over.
        to_m: what is higher above the floor is driven under.
        seen_through_m: leave out what came or went: points that another cloud was seen through, by more than this; 0.1
            is usual.
        say: is told what is being done.

    Raises:
        RecordingError: a file cannot be read or written, there is no floor, or the numbers make no map. Nothing is
            written then.
    """
    from scanwright.firmware_io.mapping.map_files import map_files

    scanner = None if angles is None else as_angle_set(angles)
    tum = None if poses is None else Path(poses)
    paths = [Path(cloud) for cloud in clouds]
    return map_files(
        paths,
        Path(out),
        scanner,
        tum,
        floor_m,
        from_m,
        to_m,
        resolution_m,
        seen_through_m,
        lambda step, _=None: say(step),
    )


def read_cloud(path: str | Path) -> Cloud:
    """Read a cloud: PLY, PCD, LAS, LAZ, E57, NPZ or XYZ, by its suffix.

    Raises:
        InstallError: the format needs the extra `clouds`, which is not installed.
        RecordingError: the format is not known, the file is not what its suffix says, or it holds several clouds.
    """
    clouds, _unread = read_clouds(Path(path))
    if len(clouds) != 1:
        raise RecordingError(
            f"{path}: holds {len(clouds)} clouds, not one: firmware_io.clouds.formats.read_clouds reads all"
        )
    return clouds[0]


def write_cloud(path: str | Path, cloud: Cloud | np.ndarray[Any, Any], *, organised: bool = False) -> list[str]:
    """Write a cloud: PLY, PCD, LAS, LAZ, E57, NPZ or XYZ, by its suffix.

    Rows without a point are left out, unless the cloud is organised and the format says what its rows and columns are
    (PCD, E57, NPZ).

    Args:
        path: the file.
        cloud: a cloud, or the points [m] of one, shape (n, 3).
        organised: keep the rows and columns of an organised cloud in PLY and XYZ too, in comments.

    Returns:
        What the format cannot hold, one sentence each.

    Raises:
        InstallError: the format needs the extra `clouds`, which is not installed.
        RecordingError: the format is not known or cannot hold this, or the file cannot be written.
    """
    record = cloud if isinstance(cloud, Cloud) else Cloud(np.asarray(cloud) * 1.0)
    return list(write_clouds(Path(path), [record], organised=organised).notes)
