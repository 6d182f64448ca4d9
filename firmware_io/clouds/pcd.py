"""PCD of the Point Cloud Library: holds everything, the start of the times as a comment."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.lib import recfunctions
from numpy.typing import NDArray
from pypcd4.pypcd4 import Encoding, PointCloud

from design.atomic_file import whole_file
from design.errors import RecordingError
from firmware_io.clouds.cloud import Cloud, cloud_from_rows, cloud_rows, headlines, pose_matrix, pose_numbers
from firmware_io.foreign import foreign


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """The cloud of a file, whether ascii, binary or binary_compressed."""
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        data = stream.read()
    pcd = foreign(f"{path}: not a PCD file", PointCloud.from_fileobj, io.BufferedReader(io.BytesIO(data)))
    rows = pcd.pc_data
    if not {"x", "y", "z"} <= set(rows.dtype.names or ()):
        raise RecordingError(f"{path}: the fields are {' '.join(rows.dtype.names or ())}; a cloud has x y z")
    x, y, z, w, i, j, k = pcd.metadata.viewpoint
    comments = [line[1:].decode("ascii", "replace").strip() for line in data[:4096].splitlines() if line[:1] == b"#"]
    cloud = cloud_from_rows(_unpacked(rows), comments)
    shape = (pcd.metadata.height, pcd.metadata.width)
    return [Cloud(cloud.points_m, cloud.columns, shape, pose_matrix([x, y, z, i, j, k, w]), cloud.start_ns)], []


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud, binary."""
    rows = _packed(cloud_rows(cloud))
    names = list(rows.dtype.names or ())
    pcd = PointCloud.from_points([rows[name] for name in names], names, [rows.dtype[name].type for name in names])
    x, y, z, i, j, k, w = (float(value) for value in pose_numbers(cloud.T_world_cloud))
    height, width = cloud.shape
    pcd.metadata = pcd.metadata.derive(viewpoint=(x, y, z, w, i, j, k), height=height, width=width)
    data = io.BytesIO()
    pcd.save(data, Encoding.BINARY)
    comments = [f"# {line}\n" for line in headlines(cloud) if line.startswith("time_s")]
    with whole_file(path, RecordingError) as part:
        part.write_bytes("".join(comments).encode() + data.getvalue())
    return []


_PACKED = ("blue", "green", "red", "alpha")  # the bytes of PCL's rgba, lowest first


def _packed(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Rows with their colours in one column, as PCL has them."""
    if not set(_PACKED) <= set(rows.dtype.names or ()):
        return rows
    rgba = np.zeros(rows.size, np.uint32)
    for place, name in enumerate(_PACKED):
        rgba |= rows[name].astype(np.uint32) << np.uint32(8 * place)
    bare = recfunctions.drop_fields(rows, _PACKED, usemask=False)
    return recfunctions.append_fields(bare, "rgba", rgba, usemask=False)


def _unpacked(rows: NDArray[np.void]) -> NDArray[np.void]:
    """Rows with a column for each colour; PCL's older rgb is a float of the same bits, without alpha."""
    held = next((name for name in ("rgba", "rgb") if name in (rows.dtype.names or ())), None)
    if held is None or rows.dtype[held].itemsize != 4:
        return rows
    bits = np.ascontiguousarray(rows[held]).view(np.uint32)
    names = _PACKED if held == "rgba" else _PACKED[:3]
    colours = [((bits >> np.uint32(8 * place)) & np.uint32(255)).astype(np.uint8) for place in range(len(names))]
    bare = recfunctions.drop_fields(rows, held, usemask=False)
    return recfunctions.append_fields(bare, list(names), colours, usemask=False)
