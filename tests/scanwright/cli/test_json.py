"""What commands print with `--json`: every command has a record, and its schema describes every key.

The fixture `command` compares each JSON output of the tests with its schema. Here are commands that no other test runs.
"""

import json
from dataclasses import dataclass

import jsonschema
import numpy as np
import pytest
from typer.main import get_command

from scanwright.cli.app import app
from scanwright.cli.console import show_json
from scanwright.cli.results import of_commands
from scanwright.cli.results.schemas import RESULTS, result_schema
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import write_clouds

COMMANDS = get_command(app).commands


def test_every_command_has_a_record():
    with_json = {name for name, one in COMMANDS.items() if "--json" in {opt for p in one.params for opt in p.opts}}
    assert set(RESULTS) == with_json == set(COMMANDS) - {"schema"}


@pytest.mark.parametrize("name", RESULTS)
def test_every_key_is_described(name):
    schema = result_schema(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    records = [schema, *schema.get("$defs", {}).values()]
    bare = [
        (one.get("title"), key)
        for one in records
        for key, v in one.get("properties", {}).items()
        if not v.get("description")
    ]
    assert bare == []
    assert all(record.get("description") for record in records if "properties" in record)


def test_a_base_describes_keys_of_its_record(monkeypatch):
    @dataclass
    class Base:
        """A base.

        Attributes:
            zero: a key of the docstring,
                in two lines.
        """

        zero: int
        # first key, described
        # in two lines
        one: int

    @dataclass
    class Record(Base):
        """A record."""

        two: list[int]  # second key

    monkeypatch.setitem(RESULTS, "build", Record)
    schema = result_schema("build")
    described = {key: value["description"] for key, value in schema["properties"].items()}
    zero = "a key of the docstring, in two lines."
    assert described == {"zero": zero, "one": "first key, described in two lines.", "two": "second key."}
    assert schema["description"] == "A record."


def test_the_schema_of_a_command_is_printed(command):
    code, out, _ = command("schema", "assemble")
    assert code == 0 and json.loads(out) == result_schema("assemble")
    code, out, (complaint,) = command("schema", "asemble")
    assert (code, out) == (2, "") and "did you mean 'assemble'" in complaint


def test_numbers_that_json_does_not_have_are_null(capsys):
    show_json({"J": float("inf"), "n": np.float64(1.5)})
    assert json.loads(capsys.readouterr().out) == {"J": None, "n": 1.5}


def test_a_new_task(command, tmp_path):
    words = ("--lidar", "LD19", "--servo", "XL430-W250", "--height-m", "0.4", "--see", "ground:0.5:5")
    code, out, _ = command("new", "mine", *words, "-o", tmp_path / "mine.toml", "--json")
    assert code == 0 and json.loads(out)["file"] == str(tmp_path / "mine.toml")


def test_a_converted_cloud(command, tmp_path):
    write_clouds(tmp_path / "a.ply", [Cloud(np.zeros((3, 3)))])
    code, out, _ = command("convert", tmp_path / "a.ply", tmp_path / "b.xyz", "--json")
    assert code == 0 and json.loads(out)["rows"] == 3


def test_rows_of_a_table(tmp_path):
    (tmp_path / "t.csv").write_text("a,b\n1,\n")
    assert of_commands.read_rows(tmp_path / "t.csv") == [{"a": "1", "b": ""}]
