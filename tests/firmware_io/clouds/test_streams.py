"""Large clouds are converted part by part: the result is that of the whole, in every pair of formats."""

import itertools
from functools import partial

import numpy as np
import pytest

from scanwright.design import frames
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import read_clouds, stream, write_clouds
from scanwright.firmware_io.clouds.parts import survey
from scanwright.firmware_io.recording import convert as converting

FORMATS = ("ply", "pcd", "las", "laz", "e57", "xyz")


def a_cloud(count=2500, placed=True):
    rng = np.random.default_rng(3)
    points = rng.normal(0, 5, (count, 3)).astype(np.float32)
    columns = {
        "intensity": rng.uniform(0, 300, count).astype(np.float32),
        "time_s": np.arange(count) * 1e-4,
        "ring": (np.arange(count) % 800).astype(np.uint16),
        **{name: rng.integers(0, 256, count).astype(np.uint8) for name in ("red", "green", "blue")},
    }
    T = frames.rigid(frames.Rz(0.3), [1.0, 2.0, 3.0]) if placed else np.eye(4)
    return Cloud(points, columns, T_world_cloud=T, start_ns=1_700_000_000_000_000_000 if placed else None)


def same(one, other):
    np.testing.assert_array_equal(one.points_m, other.points_m)
    assert list(one.columns) == list(other.columns)
    for name, values in one.columns.items():
        np.testing.assert_array_equal(values, other.columns[name])
        assert values.dtype == other.columns[name].dtype
    np.testing.assert_array_equal(one.T_world_cloud, other.T_world_cloud)
    assert one.start_ns == other.start_ns


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sources")
    for name in FORMATS:
        write_clouds(folder / f"in.{name}", [a_cloud()])
    return folder


@pytest.mark.parametrize(("source", "target"), list(itertools.product(FORMATS, FORMATS)))
def test_parts_make_the_file_of_the_whole(sources, tmp_path, source, target):
    path = sources / f"in.{source}"
    written = stream(path, tmp_path / f"parts.{target}", least_bytes=0, rows=999)
    (cloud,), _ = read_clouds(path)
    whole = write_clouds(tmp_path / f"whole.{target}", [cloud])
    assert (written.rows, set(written.notes)) == (2500, set(whole.notes))
    parts, expected = tmp_path / f"parts.{target}", tmp_path / f"whole.{target}"
    same(read_clouds(parts)[0][0], read_clouds(expected)[0][0])
    if target not in ("e57", "las", "laz"):  # these state when they were written, or pack by parts
        assert parts.read_bytes() == expected.read_bytes()


@pytest.mark.parametrize("name", ["ply", "pcd", "pts", "csv"])
def test_text_is_read_in_parts(tmp_path, name):
    points = np.round(np.random.default_rng(0).normal(0, 3, (2500, 3)), 4)
    lines = [" ".join(f"{value:.4f}" for value in row) for row in points]
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 2500\nproperty float x\nproperty double y\nproperty double z\nend_header"
    )
    pcd = "VERSION .7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nWIDTH 2500\nHEIGHT 1\nPOINTS 2500\nDATA ascii"
    heads = {"ply": ply, "pcd": pcd, "pts": "2500", "csv": "x,y,z"}
    body = [line.replace(" ", ",") for line in lines] if name == "csv" else lines
    path = tmp_path / f"in.{name}"
    path.write_text("\n".join([heads[name], *body]) + "\n")
    assert stream(path, tmp_path / "out.ply", least_bytes=0, rows=700).rows == 2500
    same(read_clouds(tmp_path / "out.ply")[0][0], read_clouds(path)[0][0])
    path.write_text("\n".join([heads[name], *body[:2400], "1 2", *body[2400:]]) + "\n")
    with pytest.raises(RecordingError, match=rf"in\.{name}: line {len(heads[name].splitlines()) + 2401}: "):
        stream(path, tmp_path / "out.ply", least_bytes=0, rows=700)
    assert not (tmp_path / "again.ply").exists()


def test_rows_without_a_point_are_dropped_part_by_part(tmp_path):
    cloud = a_cloud(placed=False)
    points = cloud.points_m.copy()
    points[::3] = np.nan
    write_clouds(tmp_path / "in.npz", [cloud])
    rows = np.array([tuple(row) for row in points.tolist()], [(axis, "<f4") for axis in "xyz"])
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 2500\n" + "".join(
        f"property float {a}\n" for a in "xyz"
    )
    (tmp_path / "in.ply").write_bytes(f"{header}end_header\n".encode() + rows.tobytes())
    assert stream(tmp_path / "in.ply", tmp_path / "out.pcd", least_bytes=0, rows=500).rows == 1666
    np.testing.assert_array_equal(read_clouds(tmp_path / "out.pcd")[0][0].points_m, points[np.isfinite(points[:, 0])])


def test_several_scans_become_several_files(tmp_path):
    write_clouds(tmp_path / "in.e57", [a_cloud(), a_cloud(300)])
    written = stream(tmp_path / "in.e57", tmp_path / "out.ply", least_bytes=0, rows=999)
    assert [path.name for path in written.paths] == ["out_1.ply", "out_2.ply"]
    assert written.rows == 2800
    same(read_clouds(written.paths[1])[0][0], read_clouds(tmp_path / "in.e57")[0][1])


def test_only_large_flat_clouds_of_these_formats_are_streamed(sources, tmp_path, monkeypatch):
    assert stream(sources / "in.ply", tmp_path / "out.pcd") is None
    assert stream(sources / "in.ply", tmp_path / "out.npz", least_bytes=0) is None
    organised = Cloud(a_cloud(100).points_m, shape=(10, 10))
    write_clouds(tmp_path / "grid.pcd", [organised])
    assert stream(tmp_path / "grid.pcd", tmp_path / "out.ply", least_bytes=0) is None
    monkeypatch.setattr(converting, "stream", partial(stream, least_bytes=0))
    monkeypatch.setattr(converting, "read_clouds", None)
    assert converting.convert(sources / "in.ply", tmp_path / "out.laz").rows == 2500


def test_a_survey_is_that_of_all_parts():
    cloud = a_cloud()
    parts = [cloud.select(np.arange(begin, min(begin + 700, 2500))) for begin in range(0, 2500, 700)]
    one, whole = survey(parts), survey([cloud])
    assert (one.rows, one.limits, one.integers) == (whole.rows, whole.limits, whole.integers)
    assert one.integers == {"red", "green", "blue", "ring"}
    np.testing.assert_array_equal([one.low_m, one.high_m], [whole.low_m, whole.high_m])
    assert survey([]) is None
