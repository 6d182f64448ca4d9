"""The table of checks lists the codes that the check functions give, and no others."""

import ast
from pathlib import Path

from scanwright.cad import checks
from scanwright.cad.checks.table import CHANGES, TABLE, table_page, with_change
from scanwright.design.electrics import rules
from scanwright.design.findings import Finding
from scanwright.pipeline import deck_height

FOLDER = Path(checks.__file__).parent
FIRST_IS_CODE = {"Finding", "at_most", "at_least", "note", "rated", "_check"}
REMARKS = {"turn_from_metal", "servo_on_deck", "usual_deck_holes", "no_nut_trap"}  # printed by a build, no checks


def codes_in(path):
    for call in ast.walk(ast.parse(path.read_text())):
        named = isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in FIRST_IS_CODE
        if named and isinstance(call.args[0], ast.Constant):
            yield call.args[0].value


def test_every_check_has_one_row():
    given = {
        code
        for path in (*FOLDER.rglob("*.py"), *map(Path, (rules.__file__, deck_height.__file__)))
        for code in codes_in(path)
    }
    rows = [row.code for row in TABLE]
    assert sorted(given - REMARKS) == sorted(rows)


def test_a_limit_has_a_source():
    assert [row.code for row in TABLE if bool(row.limit) != bool(row.source)] == []


def test_a_check_that_fails_states_what_to_change():
    fail = {row.code for row in TABLE if row.limit}
    only_warn = {"flanks", "belt_angle", "ring_data", "natural_frequency", "deck_height", "islands"}
    assert set(CHANGES) == fail - only_warn
    for code in CHANGES:
        assert with_change(Finding(code, "error", "part", "part: too much")).hint == CHANGES[code]
    kept = Finding("wall", "error", "part", "part: too much", hint="its own")
    passed = Finding("wall", "warning", "part", "part: nearly too much")
    assert [with_change(each) for each in (kept, passed)] == [kept, passed]


def test_the_page_has_a_line_for_each_check():
    assert table_page().count("\n| `") == len(TABLE)
