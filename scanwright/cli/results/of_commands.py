"""Records of the `--json` output of the commands; `angles.py` and `scans.py` have those that import more.

The comments at the fields are their documentation: `scanwright schema COMMAND` and the reference page print them.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scanwright.design.findings import Finding


@dataclass(frozen=True, slots=True)
class CheckEntry:
    """A check of the parts, as in `checks.json`."""

    kind: str  # kind of check, listed on the page of all checks
    severity: str  # pass, note, warning or error; an error means: do not make these parts
    value: float | None  # measured value; null if there is none
    limit: float | None  # bound of the value; null if it only informs
    unit: str  # unit of value and limit
    where: str  # part or product
    message: str  # sentence for a person


@dataclass(frozen=True, slots=True)
class Built:
    """A build folder."""

    folder: Path  # the folder
    files: tuple[str, ...]  # files in it, relative to it
    warnings: tuple[str, ...]  # limits of the task that can surprise
    checks: list[CheckEntry]  # all checks of the parts


@dataclass(frozen=True, slots=True)
class Rebuilt:
    """A folder compared with a second build (`build --check`)."""

    folder: str  # the folder
    difference: str | None  # first difference; null if all files are the same


@dataclass(frozen=True, slots=True)
class Checked:
    """The checks of a build."""

    task: str  # name of the task
    checks: list[CheckEntry]  # all checks


@dataclass(frozen=True, slots=True)
class Created:
    """A new task file."""

    file: Path  # the task file
    task: str  # its name
    warnings: list[str]  # limits of the task that can surprise, and products that the printed parts do not fit


@dataclass(frozen=True, slots=True)
class Products:
    """Products."""

    products: list[dict[str, Any]]  # keys of their product files, and `provenance`: source and `verified` of each value


@dataclass(frozen=True, slots=True)
class MeasuredModel:
    """Values for a product file, measured in a model of the device; none of them is verified."""

    values: dict[str, Any]  # keys of a product file
    notes: tuple[str, ...]  # other screws that a hole may be for, and what was left out
    toml: Path  # written proposal
    picture: Path  # written picture


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """Files that a command wrote."""

    folder: Path  # folder of the files
    files: list[str]  # their names
    lines: list[str]  # what the command prints without `--json`


@dataclass(frozen=True, slots=True)
class Studied:
    """A study, or its plan."""

    folder: Path  # folder of tables and winners
    plan: bool  # whether only the cost was estimated (`--plan`)
    lines: list[str]  # what the command prints without `--json`
    # candidates as in `study.csv`, column -> text; empty for a plan
    rows: list[dict[str, str]] = field(default_factory=list)


def read_rows(table: Path) -> list[dict[str, str]]:
    """Return the rows of a table, column -> text."""
    with table.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@dataclass(frozen=True, slots=True)
class Devices:
    """Devices of a scanner that runs until Ctrl-C; printed when they are ready."""

    lidar: str  # name of the lidar
    servo: str  # name of the servo
    lidar_addresses: list[str]  # serial port, HOST:PORT, or both
    servo_port: str  # serial port


@dataclass(frozen=True, slots=True)
class Published:
    """Data that `ros2` publishes until Ctrl-C; printed before it starts."""

    devices: Devices | None  # lidar and servo; null if a recording is published
    recording: Path | None  # the recording; null if devices are used


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """State of the devices and of this computer."""

    findings: list[Finding]  # in the order of the checks


@dataclass(frozen=True, slots=True)
class Settings:
    """Permanent settings of a servo."""

    changes: list[str]  # settings that were written, or that would be with `--dry-run`, one line each
    undo: Path | None = None  # file that restores the old ones; null if nothing was written
    position_deg: float | None = None  # where `--centre` left the horn; null without it


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Calibration of a scanner, as in the report next to the angle set."""

    recordings: list[str]  # names of the recordings
    left_out: dict[str, int]  # dropped beams, reason -> count
    schema: str  # version of these keys
    beams: int  # beams with a return
    beams_used: int  # beams on surfaces that were used
    beams_at_edges: int  # beams near edges, not used
    surfaces: int  # number of flat surfaces
    parameters: list[dict[str, Any]]  # estimated errors: name, words, unit, value, sd (1 sigma), start, and applied_by
    covariance: dict[str, Any]  # names and matrix of the estimated errors, in SI units
    singular_values: list[float]  # of the normalised problem; a small one marks errors that are hard to tell apart
    held: list[dict[str, Any]]  # parameters that were not estimated: names, words and why
    notes: list[str]  # warnings
    faults: list[str]  # reasons why the result is wrong; the angle set is then not written
    drift: list[dict[str, Any]]  # for each recording: motion of the platform, with chi2 of 6 degrees of freedom
    second_looks: dict[str, int]  # double coverage: beams asked for, compared, and in conflict (`seen_through`)
    range_noise_mm: float  # noise of a range
    wall_bulge_mm: float  # unevenness of the surfaces
    residual_mm: dict[str, float]  # rms distance from the surfaces: before, after, as_assembled
    wall_straightness_mm: dict[str, list[float]]  # rms bend of the largest walls: before, after, as_assembled
    entropy: dict[str, Any]  # map sharpness before and after, an independent check


@dataclass(frozen=True, slots=True)
class Registered:
    """Aligned clouds."""

    complete: bool  # whether every cloud was aligned; otherwise nothing was written
    points: int  # points of the merged cloud
    files: tuple[Path, ...]  # files that were written
    notes: tuple[str, ...]  # remarks, such as data that a file cannot store


@dataclass(frozen=True, slots=True)
class Mapped:
    """An occupancy grid."""

    points: int  # points of all clouds in the map
    moved: int  # points that were dropped because beams of another cloud passed them
    files: tuple[Path, ...]  # YAML file and image
    notes: tuple[str, ...]  # remarks, such as an unknown position of the scanner


@dataclass(frozen=True, slots=True)
class OpenedPage:
    """A page or a server, or a file for a viewer."""

    address: str | None = None  # address to open; null if a file was written
    file: Path | None = None  # the file; null if an address is served until Ctrl-C
    scans: int | None = None  # scans in the file; null if an address is served
