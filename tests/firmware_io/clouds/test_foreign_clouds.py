"""Clouds of other programs: read as they are meant, or refused with the line that is wrong."""

import struct
import sys

import lzf
import numpy as np
import pytest
import trimesh

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.clouds import formats
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds
from scanwright.firmware_io.recording.convert import convert

POINTS = np.random.default_rng(5).normal(size=(6, 3)).astype(np.float32)
RGB = np.random.default_rng(6).integers(0, 256, (6, 3)).astype(np.uint8)
HEADER = "ply\nformat {form} 1.0\ncomment other\n{before}element vertex 6\nproperty {real} x\nproperty {real} y\n"
HEADER += "property {real} z\nproperty {byte} red\nproperty {byte} green\nproperty {byte} blue\n{after}end_header\n"
LISTS = "element face 2\nproperty list uchar int vertex_indices\nproperty float q\n"
CAMERA = "element camera 1\nproperty float view\n"


def only(path):
    (cloud,), notes = read_clouds(path)
    return cloud, notes


def ply(form, real="float", byte="uchar", before="", after="", newline="\n"):
    """A file after the page of the format alone."""
    head = HEADER.format(form=form, real=real, byte=byte, before=before, after=after).replace("\n", newline).encode()
    if form == "ascii":
        faces = f"3 0 1 2 0.5{newline}4 0 1 2 3 0.5{newline}"
        rows = [" ".join([*map(repr, map(float, p)), *map(str, c)]) for p, c in zip(POINTS, RGB, strict=True)]
        body = (faces if before else "") + newline.join(rows) + newline + (faces if LISTS in after else "")
        return head + body.encode()
    order = "<" if "little" in form else ">"
    faces = struct.pack(f"{order}B3if", 3, 0, 1, 2, 0.5) + struct.pack(f"{order}B4if", 4, 0, 1, 2, 3, 0.5)
    kind = "d" if real in ("double", "float64") else "f"
    body = b"".join(struct.pack(f"{order}3{kind}3B", *p, *c) for p, c in zip(POINTS, RGB, strict=True))
    camera = struct.pack(f"{order}f", 1.0)
    return head + (faces if before else b"") + body + (faces if LISTS in after else camera if CAMERA in after else b"")


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"real": "float32", "byte": "uint8"},
        {"real": "double"},
        {"after": LISTS},
        {"after": CAMERA},
        {"before": LISTS},
        {"before": LISTS, "after": LISTS.replace("face", "edge")},
        {"newline": "\r\n"},
    ],
    ids=str,
)
def test_any_ply_is_read(tmp_path, form, more):
    (tmp_path / "c.ply").write_bytes(ply(form, **more))
    cloud, notes = only(tmp_path / "c.ply")
    np.testing.assert_array_equal(cloud.points_m, POINTS)
    np.testing.assert_array_equal(np.stack([cloud.columns[c] for c in ("red", "green", "blue")], axis=1), RGB)
    assert all(column.dtype == np.uint8 for column in cloud.columns.values())
    assert bool(notes) == any("element" in str(part) for part in more.values())
    write_clouds(tmp_path / "again.ply", [cloud])
    np.testing.assert_array_equal(only(tmp_path / "again.ply")[0].points_m, POINTS)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_of_a_mesh_program_is_read(tmp_path, encoding):
    box = trimesh.creation.box()
    box.export(tmp_path / "c.ply", encoding=encoding)
    np.testing.assert_allclose(only(tmp_path / "c.ply")[0].points_m, box.vertices)


def pcd(encoding, version="0.7", names="x y z _ w", counts="1 1 1 4 2", viewpoint="VIEWPOINT 1 2 3 1 0 0 0\n"):
    """A file after the page of the format alone: three floats, four bytes of padding, two shorts."""
    head = f"# .PCD\nVERSION {version}\nFIELDS {names}\nSIZE 4 4 4 1 2\nTYPE F F F U I\nCOUNT {counts}\nWIDTH 6\n"
    head += f"HEIGHT 1\n{viewpoint}POINTS 6\nDATA {encoding}\n"
    w = np.arange(12, dtype="<i2").reshape(6, 2)
    if encoding == "ascii":
        lines = [" ".join([*map(str, p), "0 0 0 0", *map(str, two)]) for p, two in zip(POINTS, w, strict=True)]
        return head.encode() + "\n".join(lines).encode()
    if encoding == "binary":
        rows = zip(POINTS, w, strict=True)
        return head.encode() + b"".join(p.astype("<f4").tobytes() + bytes(4) + two.tobytes() for p, two in rows)
    body = b"".join([*(POINTS[:, k].tobytes() for k in range(3)), bytes(24), w.tobytes()])
    packed = lzf.compress(body, 2 * len(body))
    return head.encode() + struct.pack("<2I", len(packed), len(body)) + packed


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("more", [{}, {"version": ".5", "viewpoint": ""}, {"version": ".6"}], ids=str)
def test_any_pcd_is_read(tmp_path, encoding, more):
    (tmp_path / "c.pcd").write_bytes(pcd(encoding, **more))
    cloud, _ = only(tmp_path / "c.pcd")
    np.testing.assert_array_equal(cloud.points_m, POINTS)
    assert list(cloud.columns) == ["w_0", "w_1"]
    np.testing.assert_array_equal(cloud.columns["w_1"], np.arange(1, 12, 2))
    assert cloud.placed == (more.get("viewpoint") != "")


TEXTS = {
    "a.xyz": "1 2 3\n\n4 5 6\n",
    "a.txt": "# made elsewhere\n1\t2\t3\t7\n4\t5\t6\t8\n",
    "a.asc": "1;2;3\n4;5;6\n",
    "b.asc": "1, 2, 3\n4, 5, 6\n",
    "a.csv": "time,Y,X,Z,label\n9,2,1,3,wall\n9,5,4,6,\n",
    "b.csv": '"Points:0","Points:1","Points:2"\n1,2,3\n4,5,6\n',
    "c.csv": "x_m,y_m,z_m\n1,2,3,\n4,5,6,\n".replace("z_m", "z_m,"),
    "e.txt": '"X","Y","Z"\n1 2 3\n4 5 6\n',
    "d.txt": "//X Y Z R G B\n1 2 3 4 5 6\n4 5 6 7 8 255\n",
    "a.pts": "2\n1 2 3 -12 4 5 6\n4 5 6 99 7 8 255\n",
    "a.ptx": "1\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 7 1\n1 2 3 0.5\n4 5 6 0.5\n",
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_is_read(tmp_path, name):
    (tmp_path / name).write_text(TEXTS[name], encoding="utf-8-sig")
    cloud, _ = only(tmp_path / name)
    np.testing.assert_array_equal(cloud.points_m, [[1, 2, 3], [4, 5, 6]])
    if "blue" in cloud.columns:
        np.testing.assert_array_equal(cloud.columns["blue"], [6, 255])
    if name == "a.ptx":
        assert (cloud.shape, cloud.T_world_cloud[2, 3]) == ((1, 2), 7.0)


REFUSED = {
    "1,5 2,5 3,5\n": "line 1: '1,5 2,5 3,5': a decimal comma",
    "1,5;2,5;3,5\n": "a decimal comma",
    "1,5,2,5,3,5\n": "a decimal comma",
    "x,y,z\n1,5,2,5,3,5\n": "line 1 names 3 columns, the next has 6: a decimal comma",
    "1 2 3\n1 2\n": "line 2: '1 2': the number of columns changed from 3 to 2",
    "1 2 3\n1 2 3 4\n": "line 2: .*changed from 3 to 4",
    "1 2 3\n1 nine 3\n": "line 2: '1 nine 3': not numbers",
    "a = b 1\nc d 2\n": "line 1: 'a' is not a number",
    "1 2\n": "line 1: 2 numbers; a cloud has x y z",
    "4\n1 2 3\n": "line 1 announces 4 points, 1 are there",
    "a b c\n1 2 3\n": "a cloud has x y z",
    "x[mm],y[mm],z[mm]\n1,2,3\n": "must be in m",
    "x y x\n1 2 3\n": "named twice",
    "1 2 3\n\x1b[31m\n": r"line 2: '\\x1b\[31m'",
}


@pytest.mark.parametrize("text", REFUSED)
def test_text_that_may_mean_two_things_is_refused(tmp_path, text):
    (tmp_path / "c.txt").write_text(text)
    with pytest.raises(RecordingError, match=REFUSED[text]):
        read_clouds(tmp_path / "c.txt")


PCD = "VERSION .7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n"
COMMAS = {
    "a.txt": "1,5 2 -3,25\n4 5 6,5\n",
    "a.csv": "x;y;z\n1,5;2;-3,25\n4;5;6,5\n",
    "b.csv": "x, y, z\n1,5, 2, -3,25\n4, 5, 6,5\n",
    "utm.pcd": PCD + "1,5 2 -3,25\n4 5 6,5\n",
}


@pytest.mark.parametrize("name", COMMAS)
def test_decimal_commas_are_read_if_a_person_says_so(tmp_path, name):
    source, out = tmp_path / name, tmp_path / "out.npz"
    source.write_text(COMMAS[name])
    if name != "b.csv":
        with pytest.raises(RecordingError, match=f"{source}: .*decimal_comma = true"):
            convert(source, out)
    convert(source, out, decimal_comma=True)
    np.testing.assert_array_equal(only(out)[0].points_m, [[1.5, 2, -3.25], [4, 5, 6.5]])


def test_what_a_decimal_comma_does_not_explain_is_refused(tmp_path):
    source = tmp_path / "a.txt"
    source.write_text("1,5,2,5,3,5\n")
    with pytest.raises(RecordingError, match=f"{source}: "):
        convert(source, tmp_path / "out.npz", decimal_comma=True)
    source.write_bytes(b"ply\0")
    with pytest.raises(RecordingError, match="not a text file"):
        convert(source, tmp_path / "out.npz", decimal_comma=True)


def test_arrays_are_read(tmp_path):
    np.save(tmp_path / "c.npy", POINTS.reshape(2, 3, 3))
    assert only(tmp_path / "c.npy")[0].shape == (2, 3)
    np.save(tmp_path / "c.npy", np.hstack([POINTS, RGB]))
    cloud, notes = only(tmp_path / "c.npy")
    assert (list(cloud.columns), len(notes)) == (["column_4", "column_5", "column_6"], 1)
    np.save(tmp_path / "c.npy", POINTS[:, :2])
    with pytest.raises(RecordingError, match=r"shape \(6, 2\)"):
        read_clouds(tmp_path / "c.npy")
    with pytest.raises(RecordingError, match="npy is only read"):
        write_clouds(tmp_path / "d.npy", [cloud])


ACME = '''"""Clouds of ACME: three integers a line, in mm."""
import numpy as np
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import CloudFormat
from scanwright.firmware_io.recording.convert import convert

FORMAT = CloudFormat("acme", "acme_clouds")

def read(path):
    return [Cloud(np.loadtxt(path, ndmin=2) / 1000)], []

def write(path, cloud):
    np.savetxt(path, np.rint(cloud.points_m * 1000), "%d")
    return ["ACME rounds to 1 mm"]
'''


def test_a_package_adds_a_format(tmp_path, monkeypatch):
    (tmp_path / "acme_clouds.py").write_text(ACME)
    facts = tmp_path / "acme-1.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1\n")
    (facts / "entry_points.txt").write_text(f"[{formats.GROUP}]\nacme = acme_clouds:FORMAT\n")
    monkeypatch.syspath_prepend(tmp_path)
    formats.all_formats.cache_clear()
    (tmp_path / "c.xyz").write_text("1 2 3\n4 5 6.5\n")
    try:
        wrote = write_clouds(tmp_path / "c.acme", read_clouds(tmp_path / "c.xyz")[0])
        np.testing.assert_array_equal(only(tmp_path / "c.acme")[0].points_m, [[1, 2, 3], [4, 5, 6.5]])
    finally:
        formats.all_formats.cache_clear()
        sys.modules.pop("acme_clouds", None)
    assert wrote.notes == ("ACME rounds to 1 mm",)


IMPOSSIBLE = (
    b"ply\nformat binary_little_endian 1.0\nelement face %d\nproperty list %s uchar a\nelement vertex 1\n"
    + b"".join(b"property float %s\n" % axis for axis in (b"x", b"y", b"z"))
)


@pytest.mark.parametrize(
    ("rows", "length", "body"), [(10**20, b"char", b"\xff" * 64), (3, b"double", bytes(64)), (5, b"int", b"\0" * 6)]
)
def test_a_binary_ply_with_impossible_lists_is_one_line(tmp_path, rows, length, body):
    (tmp_path / "a.ply").write_bytes(IMPOSSIBLE % (rows, length) + b"end_header\n" + body)
    with pytest.raises(RecordingError, match=r"a\.ply: "):
        read_clouds(tmp_path / "a.ply")


@pytest.mark.parametrize(("cut", "count"), [(1, 1), (0, 10**12)])
def test_a_pcd_that_is_cut_or_announces_too_much_is_one_line(tmp_path, cut, count):
    head = (
        f"VERSION .7\nFIELDS x y z w\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 {count}\nWIDTH 4\nHEIGHT 1\nDATA binary\n"
    )
    (tmp_path / "a.pcd").write_bytes(head.encode() + bytes(64 - cut))
    with pytest.raises(RecordingError, match=r"a\.pcd: "):
        read_clouds(tmp_path / "a.pcd")
