"""Which mount a build keeps when the parts of the best one fail a check."""

from types import SimpleNamespace

import pytest

from scanwright.design.concurrency.processes import in_turn
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding
from scanwright.design.progress import no_progress
from scanwright.pipeline import build

FAULT = (Finding("angle_held", "error", "linkage", "the linkage slips"),)


def attempt(number):
    chosen = SimpleNamespace(family=SimpleNamespace(angles_deg=(float(number), 0.0, 0.0, 0.0)))
    return chosen, f"scanner {number}", f"assembly {number}"


@pytest.mark.parametrize(
    ("fails", "known", "kept", "written"),
    [
        ((), 5, 0, [0]),
        ((0,), 5, 1, [0, 1]),
        ((0, 1, 2), 5, 3, [0, 1, 2, 3]),
        ((0, 1, 2, 3), 5, 0, [0, 1, 2, 3, 0]),  # none passes: the best one stays, and its checks say so
        ((0,), 1, 0, [0]),  # there is no other one
        ((0, 1), 2, 0, [0, 1, 0]),
    ],
)
def test_the_next_mount_is_tried_and_the_best_one_kept_if_none_passes(monkeypatch, fails, known, kept, written):
    files = []

    def choose(_optimum, _sha256, failed, _progress):
        assert set(failed.values()) == {"the linkage slips"} and len(failed) == len(set(files))
        if len(failed) == known:
            raise BuildError("none can be built")
        return attempt(len(failed))

    def write(_begin, tried, _work, _progress):
        files.append(int(tried[0].family.angles_deg[0]))
        return f"parts {files[-1]}", FAULT if files[-1] in fails else ()

    monkeypatch.setattr(build, "_choose_and_make", choose)
    monkeypatch.setattr(build, "_write_and_check", write)
    result = build._make_passing(in_turn, None, "", attempt(0), None, no_progress)
    assert result == (attempt(kept)[0], f"scanner {kept}", f"parts {kept}")
    assert files == written
