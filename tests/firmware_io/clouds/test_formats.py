"""Clouds in every format: back as they went, read by others, and a word on what a format does not hold."""

import struct
import xml.etree.ElementTree as ET

import laspy
import numpy as np
import pye57
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from pypcd4 import Encoding, PointCloud

from scanwright.design import frames
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.clouds.cloud import Cloud, pose_matrix, pose_numbers
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds

FORMATS = ["ply", "pcd", "las", "laz", "e57", "npz", "xyz"]
EXACT = ["ply", "pcd", "e57", "npz", "xyz"]
POSE = frames.rigid(frames.Rz(0.3) @ frames.Rx(-0.2), [1200.5, -3.25, 0.125])


def some_cloud(height=5, width=7, real=np.float32, nan=True, seed=0):
    rng = np.random.default_rng(seed)
    n = height * width
    points = rng.uniform(-30, 30, (n, 3)).astype(real)
    if nan:
        points[::6] = np.nan
    columns = {
        "intensity": rng.uniform(0, 5000, n).astype(np.float32),
        "time_s": np.sort(rng.uniform(0, 600, n)),
        "joint_rad": rng.uniform(0, 4000, n),
        "ring": np.tile(np.arange(width), height).astype(np.uint16),
    }
    return Cloud(points, columns, (height, width), POSE, 1_763_000_000_123_456_789)


def through(tmp_path, cloud, suffix, organised=False):
    path = tmp_path / f"cloud.{suffix}"
    wrote = write_clouds(path, [cloud], organised=organised)
    assert wrote.paths == (path,)
    (back,), unread = read_clouds(path)
    assert unread == []
    assert wrote.rows == len(back.points_m)
    return back, list(wrote.notes)


def same(back, cloud):
    assert back.points_m.dtype == cloud.points_m.dtype
    np.testing.assert_array_equal(back.points_m, cloud.points_m)
    assert list(back.columns) == list(cloud.columns)
    for name, column in cloud.columns.items():
        assert back.columns[name].dtype == column.dtype
        np.testing.assert_array_equal(back.columns[name], column)
    assert back.shape == cloud.shape
    np.testing.assert_allclose(back.T_world_cloud, cloud.T_world_cloud, rtol=0, atol=1e-12)
    assert back.start_ns == cloud.start_ns


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("suffix", EXACT)
def test_everything_comes_back(tmp_path, suffix, real):
    cloud = some_cloud(real=real)
    back, said = through(tmp_path, cloud, suffix, organised=True)
    same(back, cloud)
    assert said == []


@pytest.mark.parametrize("suffix", FORMATS)
def test_clouds_are_flat_unless_their_format_says_what_rows_and_columns_are(tmp_path, suffix):
    cloud = some_cloud()
    back, said = through(tmp_path, cloud, suffix)
    if suffix in ("pcd", "e57", "npz"):
        same(back, cloud)
        assert said == []
        return
    assert (back.shape, back.valid.all(), len(back.points_m)) == ((1, 29), True, 29)
    assert said[:2] == ["dropped 6 rows without a point", "the shape 5 x 7 is lost (pcd, e57, npz keep it)"]
    if suffix in EXACT:
        same(back, cloud.flat())
    # rows without a point in a cloud without a shape say nothing in any format
    loose = Cloud(cloud.points_m, cloud.columns)
    back, said = through(tmp_path, loose, suffix)
    assert (len(back.points_m), said[0]) == (29, "dropped 6 rows without a point")


@pytest.mark.parametrize("suffix", FORMATS)
def test_an_organised_cloud_is_refused_where_it_cannot_be(tmp_path, suffix):
    path = tmp_path / f"c.{suffix}"
    says = "holds points, no rows and columns" if suffix in ("las", "laz") else "the cloud is flat"
    with pytest.raises(RecordingError, match=rf"c\.{suffix}: .*{says}"):
        write_clouds(path, [Cloud(np.ones((3, 3)))], organised=True)
    with pytest.raises(RecordingError, match=rf"c\.{suffix}: none of the 3 rows of cloud 1 is a point"):
        write_clouds(path, [Cloud(np.full((3, 3), np.nan))])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", EXACT)
def test_a_bare_cloud_comes_back_bare(tmp_path, suffix):
    cloud = Cloud(np.array([[1, 2, 3], [4, 5, 6.5]]))
    back, _ = through(tmp_path, cloud, suffix)
    same(back, cloud)
    assert not back.organised
    assert not back.placed


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las_keeps_points_and_columns_and_says_what_it_loses(tmp_path, suffix):
    cloud = some_cloud()
    back, said = through(tmp_path, cloud, suffix)
    valid = np.isfinite(cloud.points_m).all(axis=1)
    np.testing.assert_allclose(back.points_m, cloud.points_m[valid], rtol=0, atol=1.5e-4)
    assert set(back.columns) == set(cloud.columns)
    for name, column in cloud.columns.items():
        np.testing.assert_array_equal(back.columns[name], column[valid])
    np.testing.assert_allclose(back.T_world_cloud, POSE, atol=1e-12)
    assert back.start_ns == cloud.start_ns
    assert len(said) == 6


@pytest.mark.parametrize(
    ("place", "number", "says"),
    [
        (4, b"\x70\x72\x72\x74", "1,953,657,456 chunks announced for 10 points"),
        (None, b"\xff" * 7 + b"\x7f", "would begin"),
    ],
    ids=["its length", "its place"],
)
def test_a_damaged_table_of_chunks_is_refused_before_the_decoder_ends_the_process(tmp_path, place, number, says):
    path = tmp_path / "c.laz"
    write_clouds(path, [Cloud(np.arange(30.0).reshape(10, 3))])
    data = bytearray(path.read_bytes())
    points = int.from_bytes(data[96:100], "little")
    table = int.from_bytes(data[points : points + 8], "little")
    at = points if place is None else table + place
    data[at : at + len(number)] = number
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=says):
        read_clouds(path)


def test_las_takes_longer_steps_for_long_ways_and_says_so(tmp_path):
    far = np.array([[0.0, 0, 0], [214_000, 0, 0], [1_500_000.5, 0, 0]])
    assert through(tmp_path, Cloud(far[:2]), "las")[1] == ["LAS rounds coordinates to 0.1 mm"]
    back, said = through(tmp_path, Cloud(far), "las")
    assert said == ["LAS rounds coordinates to 1 mm"]
    np.testing.assert_allclose(back.points_m, far, rtol=0, atol=1e-3)
    with pytest.raises(RecordingError, match="km apart: LAS holds 21,475 km"):
        write_clouds(tmp_path / "c.las", [Cloud(1e2 * far)])


@pytest.mark.parametrize("suffix", FORMATS)
def test_colours_come_back_as_bytes(tmp_path, suffix):
    rng = np.random.default_rng(3)
    colours = {name: rng.integers(0, 256, 50).astype(np.uint8) for name in ("red", "green", "blue", "alpha")}
    back, _ = through(tmp_path, Cloud(rng.normal(size=(50, 3)), colours), suffix)
    assert set(back.columns) == set(colours)
    for name, column in colours.items():
        assert back.columns[name].dtype == np.uint8
        np.testing.assert_array_equal(back.columns[name], column)


def test_other_readers_find_the_colours(tmp_path):
    rgb = np.array([[255, 0, 7], [1, 128, 254]], np.uint8)
    colours = dict(zip(("red", "green", "blue", "alpha"), [*rgb.T, np.full(2, 255, np.uint8)], strict=True))
    for suffix in ("ply", "pcd", "las", "e57"):
        write_clouds(tmp_path / f"c.{suffix}", [Cloud(np.eye(3)[:2], colours)])
    np.testing.assert_array_equal(trimesh.load(tmp_path / "c.ply").colors[:, :3], rgb)
    _, rows = parse_pcd((tmp_path / "c.pcd").read_bytes())
    np.testing.assert_array_equal(rows["rgba"] & 0xFFFFFF, rgb.astype(np.uint32) @ [1 << 16, 1 << 8, 1])
    las = laspy.read(tmp_path / "c.las")
    np.testing.assert_array_equal(np.stack([las.red, las.green, las.blue], axis=1), rgb.astype(np.uint16) * 257)
    scan = pye57.E57(str(tmp_path / "c.e57")).read_scan(0, colors=True, ignore_missing_fields=True)
    np.testing.assert_array_equal(np.stack([scan[f"color{name}"] for name in ("Red", "Green", "Blue")], axis=1), rgb)


def test_whole_intensities_need_no_second_column_in_las(tmp_path):
    cloud = Cloud(np.ones((3, 3)), {"intensity": np.array([0, 7, 65535], np.float32)})
    back, said = through(tmp_path, cloud, "las")
    np.testing.assert_array_equal(back.columns["intensity"], cloud.columns["intensity"])
    assert said == ["LAS rounds coordinates to 0.1 mm"]


values = arrays.arrays(np.float32, st.tuples(st.integers(1, 6), st.just(3)), elements=st.floats(-1e4, 1e4, width=32))


@pytest.mark.parametrize("suffix", EXACT)
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(points=values, holes=st.sets(st.integers(0, 5)), odd=st.sampled_from([np.nan, np.inf, -1e30, 0.1]))
def test_any_values_come_back(tmp_path, suffix, points, holes, odd):
    points = points.copy()
    points[[hole for hole in holes if hole < len(points) - 1]] = np.nan
    cloud = Cloud(points, {"intensity": np.full(len(points), odd, np.float32)}, (len(points), 1))
    same(through(tmp_path, cloud, suffix, organised=cloud.organised)[0], cloud)


@settings(deadline=None)
@given(st.tuples(*[st.floats(-1e6, 1e6)] * 3), st.tuples(*[st.floats(-3, 3)] * 3))
def test_pose_numbers_and_matrix_are_inverse(t, rotvec):
    T = frames.rigid(frames.rotvec_to_matrix(rotvec), t)
    np.testing.assert_allclose(pose_matrix(pose_numbers(T)), T, rtol=0, atol=1e-12)


def test_trimesh_reads_our_ply(tmp_path):
    cloud = some_cloud().flat()
    write_clouds(tmp_path / "c.ply", [cloud])
    loaded = trimesh.load(tmp_path / "c.ply")
    np.testing.assert_array_equal(loaded.vertices, cloud.points_m)
    np.testing.assert_array_equal(loaded.metadata["_ply_raw"]["vertex"]["data"]["ring"], cloud.columns["ring"])


def parse_pcd(data):
    """Header and records of a PCD, after the page of the format alone (ascii and binary)."""
    header = {}
    while "DATA" not in header:
        line, _, data = data.partition(b"\n")
        key, *words = line.decode().split()
        header[key] = words
    kinds = {"F": {"4": "<f4", "8": "<f8"}, "U": {"4": "<u4", "2": "<u2", "1": "u1"}, "I": {"4": "<i4"}}
    layout = np.dtype(
        [(f, kinds[t][s]) for f, t, s in zip(header["FIELDS"], header["TYPE"], header["SIZE"], strict=True)]
    )
    if header["DATA"] == ["binary"]:
        return header, np.frombuffer(data, layout)
    return header, np.array([tuple(line.split()) for line in data.decode().splitlines()], layout)


def test_a_parser_after_the_page_reads_our_pcd(tmp_path):
    cloud = some_cloud()
    write_clouds(tmp_path / "c.pcd", [cloud])
    header, rows = parse_pcd((tmp_path / "c.pcd").read_bytes())
    assert (header["WIDTH"], header["HEIGHT"], header["POINTS"]) == (["7"], ["5"], ["35"])
    x, y, z, qw, qx, qy, qz = map(float, header["VIEWPOINT"])
    np.testing.assert_allclose(pose_matrix([x, y, z, qx, qy, qz, qw]), POSE, atol=1e-12)
    for k, axis in enumerate("xyz"):
        np.testing.assert_array_equal(rows[axis], cloud.points_m[:, k])
    for name, column in cloud.columns.items():
        np.testing.assert_array_equal(rows[name], column)


@pytest.mark.parametrize("encoding", list(Encoding)[:3])
def test_pcd_of_others_is_read(tmp_path, encoding):
    points = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    PointCloud.from_xyz_points(points).save(tmp_path / "c.pcd", encoding)
    (cloud,), _ = read_clouds(tmp_path / "c.pcd")
    np.testing.assert_allclose(cloud.points_m, points, atol=1e-6)


def test_real_compressed_pcd(data):
    for number, count in ((1, 112_586), (2, 112_624)):
        (cloud,), said = read_clouds(data / "clouds" / f"room_scan{number}.pcd")
        assert len(cloud.points_m) == count
        assert cloud.points_m.dtype == np.float32
        assert np.abs(cloud.points_m).max() < 16
        assert said == []


def test_las_bytes_as_the_standard_lays_them_out(tmp_path):
    cloud = some_cloud(nan=False)
    write_clouds(tmp_path / "c.las", [cloud])
    data = (tmp_path / "c.las").read_bytes()
    assert data[:4] == b"LASF"
    assert data[24:26] == b"\x01\x04"
    start, point_format, length = (
        struct.unpack_from("<I", data, 96)[0],
        data[104],
        struct.unpack_from("<H", data, 105)[0],
    )
    scale, offset = struct.unpack_from("<3d", data, 131), struct.unpack_from("<3d", data, 155)
    (count,) = struct.unpack_from("<Q", data, 247)
    assert (point_format, count) == (6, 35)
    whole = np.array([struct.unpack_from("<3i", data, start + k * length) for k in range(count)])
    world = frames.apply(POSE, cloud.points_m.astype(float))
    np.testing.assert_allclose(whole * scale + offset, world, rtol=0, atol=0.51e-4)
    stamps = [struct.unpack_from("<d", data, start + k * length + 22)[0] for k in range(count)]
    np.testing.assert_array_equal(stamps, cloud.columns["time_s"])


def e57_xml(path):
    """The XML section of an E57, by its header and without the checksum at the end of each page of 1024 bytes."""
    data = path.read_bytes()
    signature, major, _, length, xml_at, xml_size, page = struct.unpack_from("<8sIIQQQQ", data)
    assert (signature, major, length) == (b"ASTM-E57", 1, len(data))
    at, left, text = xml_at, xml_size, b""
    while left:
        chunk = data[at : min(at + left, (at // page + 1) * page - 4)]
        text, left, at = text + chunk, left - len(chunk), (at // page + 1) * page
    return ET.fromstring(text)


def test_e57_says_in_its_xml_what_it_holds(tmp_path):
    write_clouds(tmp_path / "c.e57", [some_cloud(), some_cloud(seed=1)])
    ns = {"e": "http://www.astm.org/COMMIT/E57/2010-e57-v1.0", "sw": "urn:scanwright:cloud:1"}
    scans = e57_xml(tmp_path / "c.e57").findall("e:data3D/e:vectorChild", ns)
    assert len(scans) == 2
    prototype = scans[0].find("e:points/e:prototype", ns)
    assert {field.tag.split("}")[1] for field in prototype} == {
        *("cartesianX", "cartesianY", "cartesianZ", "cartesianInvalidState", "rowIndex", "columnIndex"),
        *("intensity", "timeStamp", "joint_rad", "ring"),
    }
    assert scans[0].find("e:points", ns).get("recordCount") == "35"
    assert float(scans[0].find("e:pose/e:translation/e:x", ns).text) == 1200.5


def test_the_usual_reader_of_e57_sees_the_points_in_the_world(tmp_path):
    cloud = some_cloud()
    write_clouds(tmp_path / "c.e57", [cloud])
    with pye57.E57(str(tmp_path / "c.e57")) as e57:
        seen = e57.read_scan_raw(0, ignore_unsupported_fields=True)
        world = e57.to_global(
            np.stack([seen[f"cartesian{axis}"] for axis in "XYZ"], axis=1),
            e57.get_header(0).rotation,
            e57.get_header(0).translation,
        )
    valid = seen["cartesianInvalidState"] == 0
    np.testing.assert_array_equal(valid, np.isfinite(cloud.points_m).all(axis=1))
    np.testing.assert_allclose(world[valid], frames.apply(POSE, cloud.points_m[valid].astype(float)), atol=1e-9)
    np.testing.assert_array_equal(seen["rowIndex"] * 7 + seen["columnIndex"], np.arange(35))


def test_e57_cells_that_were_left_out_come_back_as_nan(tmp_path):
    xyz = np.arange(9.0).reshape(3, 3)
    with pye57.E57(str(tmp_path / "c.e57"), mode="w") as e57:
        e57.write_scan_raw(
            {f"cartesian{a}": xyz[:, k] for k, a in enumerate("XYZ")}
            | {"rowIndex": np.array([0, 1, 1]), "columnIndex": np.array([0, 0, 2])}
        )
    (cloud,), _ = read_clouds(tmp_path / "c.e57")
    assert cloud.shape == (2, 3)
    np.testing.assert_array_equal(cloud.points_m[[0, 3, 5]], xyz)
    assert np.isnan(cloud.points_m[[1, 2, 4]]).all()


def test_xyz_is_text_that_numpy_reads(tmp_path):
    cloud = some_cloud().flat()
    write_clouds(tmp_path / "c.xyz", [cloud])
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "c.xyz", dtype=np.float32, usecols=(0, 1, 2)), cloud.points_m)


def test_xyz_of_others_is_read(tmp_path):
    (tmp_path / "c.xyz").write_text("// made elsewhere\n1,2,3,40\n4,5,6,nan\n")
    (cloud,), said = read_clouds(tmp_path / "c.xyz")
    np.testing.assert_array_equal(cloud.points_m, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(cloud.columns["column_4"], [40, np.nan])
    assert len(said) == 1


@pytest.mark.parametrize("suffix", FORMATS)
def test_rubbish_is_one_line(tmp_path, suffix):
    path = tmp_path / f"c.{suffix}"
    with pytest.raises(RecordingError, match=r"c\."):
        read_clouds(path)
    path.write_bytes(b"rubbish\n" * 300)
    with pytest.raises(RecordingError, match=r"c\.") as told:
        read_clouds(path)
    assert len(str(told.value).splitlines()) == 1


def test_an_unknown_format_is_one_line(tmp_path):
    with pytest.raises(RecordingError, match=r"'\.plyy' is not a format of clouds; did you mean 'ply'"):
        write_clouds(tmp_path / "c.plyy", [some_cloud()])


@pytest.mark.parametrize("suffix", ["ply", "pcd", "xyz"])
def test_names_that_a_header_cannot_hold_are_spelt_without_spaces_and_colons(tmp_path, suffix):
    columns = {"Amplitude Ratio": np.ones(3, np.float32), "nor:normalX": np.zeros(3, np.float32)}
    write_clouds(tmp_path / f"a.{suffix}", [Cloud(np.eye(3, dtype=np.float32), columns)])
    ((cloud,), _) = read_clouds(tmp_path / f"a.{suffix}")
    assert list(cloud.columns) == ["Amplitude_Ratio", "nor_normalX"]
