"""The catalogue against a table of facts: what agrees, and what differs."""

from benchmarks.catalogue.facts import compared, number_of


def row(field, value, file="utm-30lx.toml"):
    return {"file": file, "field": field, "found_value": value, "source": "a drawing", "certainty": "high"}


def verdicts(*rows):
    return [each.verdict for each in compared(iter(rows))]


def test_numbers_and_lists_of_numbers_are_compared_and_nothing_else():
    assert number_of("12.5") == 12.5 and number_of("[[1, 2], [3, 4]]") == [[1, 2], [3, 4]]
    assert [number_of(text) for text in ("about 3", "[1, [2, 3]]", "true", "end", "[]")] == [None] * 5
    assert verdicts(row("mass_g", "about 370"), row("mass_g", "370", file="no.toml")) == []


def test_each_row_gets_its_verdict():
    assert verdicts(row("mass_g", "370"), row("mass_g", "371"), row("speed", "1")) == ["agrees", "differs", "no value"]
    (differs,) = compared(iter([row("length_mm", "40", file="uh1256.toml")]))
    assert "catalogue 88.5, device 40" in differs.line and "a drawing" in differs.line
    assert verdicts(row("cable_y_mm", "[15, -15]"), row("cable_y_mm", "[-15, 15]")) == ["differs", "agrees"]
