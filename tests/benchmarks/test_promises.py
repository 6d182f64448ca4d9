"""The figures of the docs: each has its promise, and who measures them says truly what holds."""

import re
import sys
from pathlib import Path

import pytest

from benchmarks import all as every

ROOT = Path(__file__).parents[2]
CALENDAR = {"figure": "the year", "command": "calendar 2026 1", "minutes": 0.1, "number": r"(\d{4})"}


def modules_in(text):
    return set(re.findall(r"python -m (benchmarks(?:\.\w+)+)", text))


def test_every_command_of_the_docs_has_its_promise():
    """Pictures promise nothing."""
    measured = (ROOT / "docs" / "measured.md").read_text(encoding="utf-8").split("## Pictures")[0]
    told = modules_in(measured) | modules_in((ROOT / "README.md").read_text(encoding="utf-8"))
    assert told - {"benchmarks.all"} == {
        promise.command.split()[0] for promise in every.promises() if "benchmarks" in promise.command
    }


def test_a_promise_has_a_bound_and_one_number():
    for promise in every.promises():
        assert promise.most is not None or promise.least is not None, promise.figure
        assert re.compile(promise.number).groups == 1, promise.figure


@pytest.mark.parametrize(("bound", "kept"), [({"most": 2027.0}, "yes"), ({"least": 2027.0}, "**no**")])
def test_what_holds_and_what_does_not(bound, kept):
    promise = every.Promise(**CALENDAR, **bound)
    outcomes = every.measured(promise.command, [promise], minutes=1.0, rounds=3)
    assert outcomes[0].values == (2026.0,)
    lines = list(every.table(outcomes))
    assert f"| 2026 |  | {kept} |" in lines[2]
    assert lines[-1].startswith(f"{int(kept == 'yes')} of 1 promises hold")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"minutes": 9.0}, "takes 9 min"),
        ({"needs": ("no-such-program",)}, "no-such-program is not installed"),
        ({"number": r"(\d{5})"}, "did not say it"),
        ({"command": "no_such_module"}, "No module named no_such_module"),
    ],
)
def test_what_was_not_measured_says_why_and_is_no_promise_kept(change, why):
    promise = every.Promise(**(CALENDAR | {"least": 2027.0} | change))
    outcomes = every.measured(promise.command, [promise], minutes=1.0, rounds=3)
    assert outcomes[0].kept is None and why in outcomes[0].why
    assert list(every.table(outcomes))[-1] == "0 of 0 promises hold on this machine"


def test_the_worst_of_several_numbers_counts():
    text = "off by 1,000 mm\noff by 20 mm\n"
    number = r"off by ([\d,]+) mm"
    assert every.Promise(**(CALENDAR | {"number": number}), most=3.0).read(text) == 1000.0
    assert every.Promise(**(CALENDAR | {"number": number}), least=3.0).read(text) == 20.0


def test_a_broken_promise_is_told_to_who_called(monkeypatch, capsys):
    promise = every.Promise(**CALENDAR, most=2000.0)
    monkeypatch.setattr(every, "promises", lambda: [promise])
    monkeypatch.setattr(sys, "argv", ["all"])
    with pytest.raises(SystemExit) as caught:
        every.main()
    assert caught.value.code == 1 and "cores" in (said := capsys.readouterr().out) and "the year" in said
