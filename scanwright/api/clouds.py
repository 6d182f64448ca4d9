"""Read, write, register and map clouds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scanwright.api.arguments import AnglesLike, as_angle_set, with_say
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import check_place
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds

if TYPE_CHECKING:
    from scanwright.firmware_io.mapping.map_files import MapSummary
    from scanwright.firmware_io.registration.register_files import RegisteredFiles


@with_say
def register(
    clouds: Sequence[str | Path],
    out: str | Path,
    *,
    poses: str | Path | None = None,
    start: str | Path | None = None,
    angles: AnglesLike | None = None,
    spacing_m: float = 0.1,
    map_spacing_m: float = 0.02,
    progress: Progress = no_progress,
) -> RegisteredFiles:
    """Align point clouds and merge them; works without initial poses.

    Args:
        clouds: of one place, two or more.
        out: map to write.
        poses: TUM file to write; None for one next to the map.
        start: TUM file of initial poses, one line per cloud.
        angles: calibrated angle set that all clouds were assembled with; its covariance is propagated to that of the
            poses. Without it the calibration is assumed to be exact.
        spacing_m: distance of the points that are registered.
        map_spacing_m: distance of the points of the map.
        progress: progress callback.

    Raises:
        RecordingError: a file cannot be read or written, there is only one cloud, or the angle set states no
            covariance.

    Example:
        >>> import scanwright as sw
        >>> sw.register(["a.ply", "b.ply"], "merged.ply").complete
        True
    """
    from scanwright.firmware_io.registration.register_files import register_files

    target = Path(out)
    check_place(target, RecordingError)
    tum = target.with_suffix(".tum") if poses is None else Path(poses)
    start_poses = None if start is None else Path(start)
    scanner = None if angles is None else as_angle_set(angles)
    paths = [Path(cloud) for cloud in clouds]
    return register_files(paths, target, tum, start_poses, spacing_m, map_spacing_m, scanner, progress)


@with_say
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
    progress: Progress = no_progress,
) -> MapSummary:
    """Create an occupancy grid for ROS's map_server from point clouds: YAML and PGM.

    A cell is occupied if a point in it lies between two heights above the floor; free if it is not occupied and a
    beam passed below the lower height; otherwise unknown.

    Args:
        clouds: of one place, z up, in one frame or with `poses`.
        out: YAML file to write, next to the PGM.
        angles: angle set that all clouds were assembled with; its optical centre is the position of the scanner. None
            uses the origins of clouds that have poses; clouds without poses make no cell free.
        poses: TUM file, a line for each cloud, as `register` writes it; None reads the poses in the files.
        resolution_m: edge of a cell.
        floor_m: height of the floor in the map; None detects it.
        from_m: lowest height of obstacles above the floor.
        to_m: highest height of obstacles above the floor.
        seen_through_m: drop moving objects: points that beams of another cloud passed by more than this; 0.1 is usual.
        progress: progress callback.

    Raises:
        RecordingError: a file cannot be read or written, there is no floor, or the numbers make no map. Nothing is
            written then.

    Example:
        >>> import scanwright as sw
        >>> sw.make_map(["a.ply"], "room.yaml", angles="angles.json").wrote
        (PosixPath('room.yaml'), PosixPath('room.pgm'))
    """
    from scanwright.firmware_io.mapping.map_files import map_files

    scanner = None if angles is None else as_angle_set(angles)
    tum = None if poses is None else Path(poses)
    paths = [Path(cloud) for cloud in clouds]
    return map_files(paths, Path(out), scanner, tum, floor_m, from_m, to_m, resolution_m, seen_through_m, progress)


def read_cloud(path: str | Path) -> Cloud:
    """Read a cloud: PLY, PCD, LAS, LAZ, E57, NPZ or XYZ, by its suffix.

    Raises:
        InstallError: the format needs the extra `clouds`, which is not installed.
        RecordingError: the format is unknown, the file does not match its suffix, or it contains several clouds.

    Example:
        >>> import scanwright as sw
        >>> cloud = sw.read_cloud("a.ply")
        >>> cloud.points_m.shape[1], cloud.points_m.dtype.name
        (3, 'float32')
    """
    clouds, _unread = read_clouds(Path(path))
    if len(clouds) != 1:
        raise RecordingError(
            f"{path}: contains {len(clouds)} clouds, not one; firmware_io.clouds.formats.read_clouds reads all"
        )
    return clouds[0]


def write_cloud(path: str | Path, cloud: Cloud | np.ndarray[Any, Any], *, organised: bool = False) -> list[str]:
    """Write a cloud: PLY, PCD, LAS, LAZ, E57, NPZ or XYZ, by its suffix.

    Rows without a point are dropped, unless the cloud is organised and the format stores rows and columns (PCD, E57,
    NPZ).

    Args:
        path: the file.
        cloud: a cloud, or the points [m] of one, shape (n, 3).
        organised: keep the rows and columns of an organised cloud in PLY and XYZ too, in comments.

    Returns:
        Data that the format cannot store, one sentence each.

    Raises:
        InstallError: the format needs the extra `clouds`, which is not installed.
        RecordingError: the format is unknown or cannot store this, or the file cannot be written.

    Example:
        >>> import scanwright as sw
        >>> import numpy as np
        >>> sw.write_cloud("two.xyz", np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]))
        []
    """
    record = cloud if isinstance(cloud, Cloud) else Cloud(np.asarray(cloud) * 1.0)
    return list(write_clouds(Path(path), [record], organised=organised).notes)
