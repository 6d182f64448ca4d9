"""The shipped scanner for little money: what it costs, and that nothing of it fails a check."""

import csv
import json

import pytest

from scanwright import api


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return api.build("low_cost", tmp_path_factory.mktemp("out")).folder


def test_what_it_needs_costs_less_than_300_dollars(built):
    """With 90 for what has no price in the sources: adapter, cables, supplies, screws."""
    rows = list(csv.DictReader((built / "bom.csv").read_text(encoding="utf-8").splitlines()))
    assert float(rows[-1]["total_usd"]) + 90 < 300
    assert {row["number"] for row in rows if row["kind"] == "bought"} == {"STL27L", "XL430-W250"}


def test_no_check_fails_and_no_part_is_in_the_fan(built):
    checks = json.loads((built / "checks.json").read_text(encoding="utf-8"))["checks"]
    assert [check["message"] for check in checks if check["severity"] == "error"] == []
    hidden = [check["value"] for check in checks if "of the fan hidden" in check["message"]]
    assert hidden and max(hidden) == 0
