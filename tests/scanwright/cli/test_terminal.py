"""The terminal: what a person sees there, what a file gets instead, and how little either can be."""

import io
import json
import logging
import pickle
import re
from dataclasses import asdict
from pathlib import Path

import pytest

from scanwright.cli import console
from scanwright.cli.console import ConsoleProgress, Verbosity, command_console, hint, set_verbosity, show
from scanwright.cli.help import GroupedHelp, first_sentence
from scanwright.design.errors import DeviceFaultError, NumericalError, RecordingError, TaskError
from scanwright.design.findings import Finding
from scanwright.firmware_io.recording.importer import ImportSummary


class Terminal(io.StringIO):
    """A screen of one line: what is written after a carriage return and a clear takes the place of the line."""

    def isatty(self):
        return True

    def lines(self):
        return [line.rpartition("\r\033[K")[2] for line in self.getvalue().split("\n")]


@pytest.fixture
def screen(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")

    def opened():  # in the test: what captures its output takes the streams after the fixtures
        screen = Terminal()
        monkeypatch.setattr("sys.stderr", screen)
        monkeypatch.setattr("sys.stdout", screen)
        return screen

    return opened


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


def test_fractions_become_one_bar_with_the_time_that_is_left(screen):
    screen, clock = screen(), Clock()
    progress = ConsoleProgress(clock)
    progress("reading the task")
    progress("searching", 0.0)
    clock.now_s += 30
    progress("making the parts", 0.25)
    assert re.fullmatch("\u2501{6}.* 25% 0:01:30 making the parts", screen.lines()[-1])
    clock.now_s += 30
    progress("drawing", 0.5)
    assert " 50% 0:01:00 drawing" in screen.lines()[-1]
    show(["done"])
    assert screen.lines() == ["  .. reading the task", "done", ""]


def test_a_bar_that_begins_late_estimates_from_there_on(screen):
    screen, clock = screen(), Clock()
    progress = ConsoleProgress(clock)
    for fraction in (0.5, 0.5, 0.75):
        progress("writing", fraction)
        assert fraction == 0.75 or " 50% -:--:-- writing" in screen.lines()[-1]
        clock.now_s += 10
    assert " 75% 0:00:20 writing" in screen.lines()[-1]


def test_a_bar_begins_anew_with_other_work_and_counts_no_time_before_any_work_is_done(screen):
    screen, clock = screen(), Clock()
    progress = ConsoleProgress(clock)
    for fraction in (0.0, 1.0, 0.0, 0.0, 0.5):
        progress("scanning", fraction)
        clock.now_s += 10
    assert " 50% 0:00:10 scanning" in screen.lines()[-1]


def test_a_bar_fits_on_its_line(screen, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    screen = screen()
    ConsoleProgress(Clock())("counting what cannot be counted in any reasonable time at all", 0.5)
    assert len(screen.lines()) == 1 and len(screen.lines()[-1]) == 59


def test_warnings_among_results_go_to_standard_error(capsys):
    show(["result", "warning: measure these:", "  MX-64R: mass_g", "more"])
    assert capsys.readouterr() == ("result\nmore\n", "warning: measure these:\n  MX-64R: mass_g\n")


LATE = Finding("late", "warning", "/scan", "scans are late")


def test_a_result_as_json_is_its_record(command, monkeypatch):
    summary = ImportSummary(Path("r.mcap"), 2, 40, 9, 0.1, (0.0, 1.5), {"no_angle": 1}, (LATE,))
    monkeypatch.setattr("scanwright.api.import_bag", lambda *_, **__: summary)
    words = ("import", "a.bag", "--scan", "/scan", "--angle", "/joint_states:pan", "-o", "r.mcap")
    code, out, _ = command(*words, "--json")
    assert code == 0 and json.loads(out) == json.loads(json.dumps(asdict(summary) | {"out": "r.mcap"}))


def test_logged_warnings_are_printed_in_every_verbosity(capsys):
    with command_console():
        set_verbosity(Verbosity.QUIET)
        logging.getLogger("scanwright.study").warning("%d of %d", 1, 2)
    assert capsys.readouterr() == ("", "warning: 1 of 2\n")


def test_the_environment_variable_of_version_0_1_still_works(monkeypatch, capsys):
    monkeypatch.setenv("SCANWRIGHT_VOICE", "quiet")
    ConsoleProgress()("working")
    assert capsys.readouterr().err == ""


def test_in_a_file_a_fraction_is_printed_every_ten_seconds_and_nothing_moves(capsys):
    clock = Clock()
    progress = ConsoleProgress(clock)
    for second in range(25):
        clock.now_s = float(second)
        progress(f"scanning, {second} scans", second / 25)
    progress("drawing", 0.97)
    progress("assembling")
    lines = [f"  .. scanning, {second} scans ({4 * second}%)" for second in (0, 10, 20)]
    printed = capsys.readouterr().err
    assert printed.splitlines() == [*lines, "  .. drawing (97%)", "  .. assembling"]
    assert not re.search(r"[\r\033]", printed)


def test_quiet_prints_results_only_and_verbose_all(capsys):
    with command_console():
        set_verbosity(Verbosity.QUIET)
        ConsoleProgress()("working")
        hint("next: look")
        show(["result"])
    assert capsys.readouterr() == ("result\n", "")
    with command_console():
        set_verbosity(Verbosity.VERBOSE)
        progress = ConsoleProgress(Clock())
        for fraction in (0.0, 0.01, 0.02):
            progress("scanning", fraction)
    assert len(capsys.readouterr().err.splitlines()) == 3
    assert console.verbosity() is Verbosity.USUAL


def test_a_second_process_can_be_given_the_progress():
    assert isinstance(pickle.loads(pickle.dumps(ConsoleProgress())), ConsoleProgress)


@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("min_range_m = 5, max_range_m = 2: too small", "--min-range-m = 5, --max-range-m = 2: too small"),
        ("poses: no such file", "--poses: no such file"),
        ("`imu` requires `poses`", "`--imu` requires `--poses`"),
        ("r.mcap: poses of another robot", "r.mcap: poses of another robot"),
        ("r.mcap: motion.lag_s = 2, /tmp/lag_s/a, voxel_m.ply", "r.mcap: motion.lag_s = 2, /tmp/lag_s/a, voxel_m.ply"),
        ("spin_s = 2: unknown", "spin_s = 2: unknown"),
    ],
)
def test_an_error_names_options_as_they_are_typed(line, printed, command, monkeypatch):
    def refuse(*_, **__):
        raise RecordingError(line)

    monkeypatch.setattr("scanwright.api.assemble", refuse)
    assert command("assemble", "r.mcap", "--angles", "a.json", "-o", "c.ply") == (2, "", [f"error: {printed}"])


@pytest.mark.parametrize(
    ("error", "code"), [(DeviceFaultError("hot"), 3), (NumericalError("J"), 1), (TaskError("x"), 2)]
)
def test_the_exit_code_tells_a_device_from_wrong_input(error, code, command, monkeypatch):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr("scanwright.api.optimise", fail)
    assert command("optimise", "ceiling")[0] == code


def test_colours_are_for_terminals_that_want_them(screen, monkeypatch):
    screen = screen()
    assert console.styled("x", "error", screen) == "x"
    monkeypatch.delenv("NO_COLOR")
    assert console.styled("x", "error", screen) == "\033[31m\033[1mx\033[0m"
    assert console.styled("x", "error", io.StringIO()) == "x"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["assemble", "r.mcap"], "Missing option '--angles' (see `scanwright assemble --help`)"),
        (["build"], "Missing argument 'TASK' (see `scanwright build --help`)"),
        (["biuld", "x"], "'biuld'. Did you mean 'build'? (see `scanwright --help`)"),
        (["study", "x", "--processes", "0"], "--processes"),
        (["check", "x", "--loud"], "--loud"),
    ],
)
def test_a_command_that_is_called_wrongly_is_one_line(command, words, told):
    code, out, complaints = command(*words)
    assert (code, out, len(complaints)) == (2, "", 1)
    assert told in complaints[0]


def test_every_command_stands_in_a_group_of_the_help_and_takes_q_and_v(command):
    code, out, _ = command("-h")
    assert code == 0
    sections = re.split(r"^(\w+):$", out, flags=re.MULTILINE)
    named = dict(zip(sections[1::2], sections[2::2], strict=True))
    assert set(GroupedHelp.titles) <= set(named)
    assert "  build " in named["Parts"] and "  catalogue " in named["Design"] and "  scan " in named["Devices"]
    assert "..." not in out.replace("[ARGS]...", ""), "no description is cut off"
    assert command()[1] == out, "no command at all is a question too"
    for name in re.findall(r"^  ([\w-]+)  ", "".join(named[title] for title in GroupedHelp.titles), re.MULTILINE):
        _, said, _ = command(name, "--help")
        assert "-q, --quiet" in said and "-v, --verbose" in said
        assert f"Example: scanwright {name} " in said and "Exit codes: 0 done; " in said
        assert not re.search(r"[{}]|\[\[", said.splitlines()[0]), "a usage line without doubled brackets"


def test_the_first_sentence_of_a_docstring():
    class Command:
        help = "Do this, e.g. that\nand more. Not this.\n\nNor this."

    assert first_sentence(Command) == "Do this, e.g. that and more"


def test_version(command):
    assert re.fullmatch(r"scanwright \d+\.\d+\.\d+\S*\n", command("--version")[1])


@pytest.mark.parametrize(
    ("options", "field", "typed"),
    [
        ({"drop_outliers": "--drop-outliers"}, "drop_outliers = true drops them", "--drop-outliers drops them"),
        ({}, "drop_outliers = true drops them", "import --drop-outliers drops them"),
        ({}, 'time_increment = "auto" uses 0.0002 s', "import --time-increment auto uses 0.0002 s"),
        ({}, "lag_s = 0.012 corrects them", "assemble --lag-s 0.012 corrects them"),
        ({}, "stall_a = 2 is no option", "stall_a = 2 is no option"),
    ],
)
def test_a_warning_names_options_and_the_command_that_has_them(monkeypatch, capsys, options, field, typed):
    monkeypatch.setattr(console, "_options", options)
    console.warn([f"3 angles lie off, min_range_m = 2: {field}"])
    assert capsys.readouterr().err == f"warning: 3 angles lie off, min_range_m = 2: {typed}\n"
    assert console.as_typed(field) == typed
