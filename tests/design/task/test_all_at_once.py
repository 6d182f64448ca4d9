"""All that is wrong in a task file is told at once, each thing with its line."""

import tomllib

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import SHIPPED as PRODUCTS
from scanwright.design.errors import TaskError
from scanwright.design.files.faults import _key_lines
from scanwright.design.task.task import Task, load_task

BASE = """name = "mine"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "UH1256-02-0610-06S"
[motion]
period_s = 18.0
"""
BARE = (PRODUCTS / "uh1256.toml").read_text(encoding="utf-8").replace("value = 12.7", "value = 0.0")
ALL_AT_ONCE = """\
# a task with a fault on every line that says so
name = "mine"
sensr = "UTM-30LX"              # 3
servo = "MX64"                  # 4
printer = "fdm-0.4"
[motion]
period_s = 0                    # 7

[angles]
beta_rot_deg = [
    -90,
    "up",                       # 10: where the statement begins
]
[[weight]]
shape = "all"
[[weight]]
shape = "cne"                   # 17
[[mask]]
shape = "cone"
axis = [0, 0, 0]                # 20
half_angle_dg = 25              # 21
"""


def test_all_that_is_wrong_is_told_at_once_each_with_its_line(tmp_path):
    (tmp_path / "task.toml").write_text(ALL_AT_ONCE, encoding="utf-8")
    with pytest.raises(TaskError) as caught:
        load_task(tmp_path / "task.toml")
    told = str(caught.value).splitlines()
    assert [line.removeprefix(str(tmp_path)).split(": ")[:2] for line in told] == [
        ["/task.toml:3", "sensr"],
        ["/task.toml:4", "servo"],
        ["/task.toml:7", "motion.period_s = 0"],
        ["/task.toml:10", "angles.beta_rot_deg.1 = 'up'"],
        ["/task.toml:17", "weight.1.shape = 'cne'"],
        ["/task.toml:20", "mask.0.axis = [0, 0, 0]"],
        ["/task.toml:21", "mask.0.half_angle_dg"],
    ]
    for words in (
        "did you mean 'sensor'?",
        "did you mean 'cone'?",
        "did you mean 'half_angle_deg'?",
        "greater than or equal to 0.001",
    ):
        assert sum(words in line for line in told) == 1, words


def test_a_catalogue_file_tells_its_own_faults_and_nobody_looks_for_its_products(tmp_path):
    for name in ("one.toml", "other.toml"):
        (tmp_path / name).write_text(BARE, encoding="utf-8")
    text = BASE.replace("MX-64R", "MINE").replace("[motion]", 'catalogue = ["one.toml", "other.toml"]\n[motion]')
    (tmp_path / "task.toml").write_text(text + "[density]\nball_radius_deg = 0\n", encoding="utf-8")
    with pytest.raises(TaskError) as caught:
        load_task(tmp_path / "task.toml")
    told = str(caught.value).splitlines()
    assert [line.removeprefix(str(tmp_path)).split(":")[0] for line in told] == [
        "/one.toml",
        "/other.toml",
        "/task.toml",
    ]
    assert "bore_mm = 0" in told[0] and "density.ball_radius_deg = 0" in told[2]


def test_files_and_motions_are_looked_at_beside_what_else_is_wrong(tmp_path):
    np.save(tmp_path / "nan.npy", np.array([[1.0, np.nan]]))
    text = BASE.replace("18.0", "0.1") + "[density]\nball_radius_deg = 0\n"
    text += "".join(f'[[weight]]\nshape = "map"\nfile = "{name}"\n' for name in ("none.npy", "nan.npy"))
    (tmp_path / "task.toml").write_text(text, encoding="utf-8")
    with pytest.raises(TaskError) as caught:
        load_task(tmp_path / "task.toml")
    told = str(caught.value).splitlines()
    lines = [text.splitlines().index(words) + 1 for words in ("period_s = 0.1", "ball_radius_deg = 0")]
    lines += [text.splitlines().index(f'file = "{name}"') + 1 for name in ("none.npy", "nan.npy")]
    assert [int(line.split(":")[1]) for line in told] == lines


def test_a_key_that_is_missing_is_told_once_and_of_many_faults_the_first_twenty(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text("", encoding="utf-8")
    with pytest.raises(TaskError) as caught:
        load_task(path)
    assert str(caught.value).splitlines() == [
        f"{path}: {key}: this key is required" for key in ("name", "sensor", "servo", "motion")
    ]
    path.write_text(BASE + '\n[[weight]]\nshape = "al"\n' * 50, encoding="utf-8")
    with pytest.raises(TaskError) as caught:
        load_task(path)
    assert len(told := str(caught.value).splitlines()) == 21
    assert told[-1] == f"{path}: and 30 more like these"


@pytest.mark.parametrize(
    "text",
    [
        'a = 1\n[b]\nc = """\nd = 2\n"""\ne.f = [\n1,\n{ g = 3 } ]\n[[h]]\n[[h]]\ni = 1\n[h.j]\n"k.l"=2\n[[h.m]]\nn=1',
        '# c\r\na = 1\r\n\r\n["b c"]\r\nd = [[1, 2],\r\n [3]]\r\n',
    ],
)
def test_the_lines_of_keys_are_those_of_a_slow_look_at_the_text(tmp_path, text):
    """A key exists from the line on at whose end the text, read up to there, first holds it."""
    path = tmp_path / "any.toml"
    path.write_text(text, encoding="utf-8", newline="")
    lines = text.split("\n")
    ends = [n for n in range(1, len(lines) + 1) if _reads("\n".join(lines[:n]) + "\n")]
    seen, expected = set(), {}
    for before, end in zip([0, *ends], ends, strict=False):
        for key in _all_keys(tomllib.loads("\n".join(lines[:end]) + "\n")):
            if key not in seen:
                expected[key] = before + 1
                seen.add(key)
    assert {key: _key_lines(path)[key] for key in expected} == expected


def _reads(text):
    try:
        tomllib.loads(text)
    except ValueError:
        return False
    return True


def _all_keys(value, above=()):
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, held in inner:
        yield (*above, str(key))
        yield from _all_keys(held, (*above, str(key)))


def test_the_schema_describes_every_key():
    schema = Task.model_json_schema()
    for record in (schema, *schema["$defs"].values()):
        assert record["description"]
        for key, held in record["properties"].items():
            assert len(held.get("description", "")) > 5, f"{record['title']}.{key}"
