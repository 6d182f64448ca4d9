"""Cloud files: read back by ourselves and by another reader, whole or not there; and their picture."""

import numpy as np
import pytest
import trimesh
from matplotlib.image import imread

from benchmarks.firmware_io.cloud_picture import cloud_picture
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.cloud_rows import cloud_fields
from scanwright.firmware_io.clouds.ply import ply_writer, read_ply

FIELDS = cloud_fields(has_intensity=True)


def some_rows(count, seed=0):
    rng = np.random.default_rng(seed)
    rows = np.zeros(count, FIELDS)
    for name in FIELDS.names:
        rows[name] = rng.uniform(0, 9, count)
    return rows


def write(path, *chunks, comments=()):
    with ply_writer(path, FIELDS, comments) as cloud:
        for chunk in chunks:
            cloud.write(chunk)
    return path


@pytest.mark.parametrize("counts", [(1,), (9,), (10,), (99, 1), (5, 0, 100_000)])
def test_rows_come_back(tmp_path, counts):
    chunks = [some_rows(count, seed) for seed, count in enumerate(counts)]
    path = write(tmp_path / "c.ply", *chunks, comments=["height 1", "two\nlines"])
    rows = read_ply(path)
    assert rows.dtype == FIELDS
    np.testing.assert_array_equal(rows, np.concatenate(chunks))


def test_another_reader_agrees_nan_rows_included(tmp_path):
    rows = some_rows(1000)
    rows["x"][::7] = rows["y"][::7] = rows["z"][::7] = np.nan
    loaded = trimesh.load(write(tmp_path / "c.ply", rows))
    np.testing.assert_array_equal(loaded.vertices, np.stack([rows[name] for name in "xyz"], axis=1))
    raw = loaded.metadata["_ply_raw"]["vertex"]["data"]
    for name in FIELDS.names:
        np.testing.assert_array_equal(np.asarray(raw[name]).ravel(), rows[name])


def test_a_failure_leaves_no_file(tmp_path):
    with pytest.raises(KeyboardInterrupt), ply_writer(tmp_path / "c.ply", FIELDS, ()) as cloud:
        cloud.write(some_rows(3))
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_rows_of_other_fields_are_a_bug(tmp_path):
    with pytest.raises(ValueError, match="the file holds"), ply_writer(tmp_path / "c.ply", FIELDS, ()) as cloud:
        cloud.write(np.zeros(3, cloud_fields(has_intensity=False)))


def good(tmp_path):
    return write(tmp_path / "good", some_rows(10)).read_bytes()


BROKEN = {
    "not a PLY file": lambda data: b"hello\n" + data,
    r"line 13: '.*': not numbers": lambda data: data.replace(b"binary_little_endian", b"ascii"),
    "line 12: 'property float19 w': unknown type": lambda data: data.replace(
        b"end_header", b"property float19 w\nend_header"
    ),
    "the properties of vertex are .* and no lists": lambda data: data.replace(
        b"end_header", b"property list uchar int vertex_indices\nend_header"
    ),
    "no 'end_header' in the first 4 bytes": lambda data: data[:4],
    "10 rows of 34 bytes announced": lambda data: data[:-1],
    "vertex has 0 rows": lambda data: data.replace(b"vertex 10", b"vertex 0"),
}


@pytest.mark.parametrize("says", BROKEN)
def test_a_broken_cloud_is_one_line(tmp_path, says):
    path = tmp_path / "c.ply"
    path.write_bytes(BROKEN[says](good(tmp_path)))
    with pytest.raises(RecordingError, match=says):
        read_ply(path)


def test_a_missing_cloud_is_one_line(tmp_path):
    with pytest.raises(RecordingError, match=r"c\.ply: cannot read: No such file"):
        read_ply(tmp_path / "c.ply")


@pytest.mark.parametrize("count", [1, 5000])
def test_a_cloud_has_a_picture(tmp_path, count):
    cloud_picture(write(tmp_path / "c.ply", some_rows(count)), tmp_path / "c.png")
    image = imread(tmp_path / "c.png")
    assert image.shape[1] == 1320
    assert np.unique(image[..., :3] @ [1.0, 300.0, 9e4]).size > 10


def test_a_cloud_without_a_point_has_no_picture(tmp_path):
    rows = some_rows(3)
    rows["y"] = np.nan
    with pytest.raises(RecordingError, match="no row of the cloud is a point"):
        cloud_picture(write(tmp_path / "c.ply", rows), tmp_path / "c.png")
    assert not (tmp_path / "c.png").exists()
