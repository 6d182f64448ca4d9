"""Records of the `--json` output of the commands; `angles.py` and `scans.py` have those that import more.

The attributes of a record are its documentation: `scanwright schema COMMAND` and the reference page print them.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scanwright.design.findings import Finding


@dataclass(frozen=True, slots=True)
class CheckEntry:
    """A check of the parts, as in `checks.json`.

    Attributes:
        kind: kind of check, listed on the page of all checks.
        severity: pass, note, warning or error; an error means: do not make these parts.
        value: measured value; null if there is none.
        limit: bound of the value; null if it only informs.
        unit: unit of value and limit.
        where: part or product.
        message: sentence for a person.
    """

    kind: str
    severity: str
    value: float | None
    limit: float | None
    unit: str
    where: str
    message: str


@dataclass(frozen=True, slots=True)
class Built:
    """A build folder.

    Attributes:
        folder: the folder.
        files: files in it, relative to it.
        warnings: limits of the task that can surprise.
        checks: all checks of the parts.
    """

    folder: Path
    files: tuple[str, ...]
    warnings: tuple[str, ...]
    checks: list[CheckEntry]


@dataclass(frozen=True, slots=True)
class Rebuilt:
    """A folder compared with a second build (`build --check`).

    Attributes:
        folder: the folder.
        difference: first difference; null if all files are the same.
    """

    folder: str
    difference: str | None


@dataclass(frozen=True, slots=True)
class Checked:
    """The checks of a build.

    Attributes:
        task: name of the task.
        checks: all checks.
    """

    task: str
    checks: list[CheckEntry]


@dataclass(frozen=True, slots=True)
class Created:
    """A new task file.

    Attributes:
        file: the task file.
        task: its name.
        warnings: limits of the task that can surprise, and products that the printed parts do not fit.
    """

    file: Path
    task: str
    warnings: list[str]


@dataclass(frozen=True, slots=True)
class Products:
    """Products.

    Attributes:
        products: keys of their product files, and `provenance`: source and `verified` of each value.
    """

    products: list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class MeasuredModel:
    """Values for a product file, measured in a model of the device; none of them is verified.

    Attributes:
        values: keys of a product file.
        notes: other screws that a hole may be for, and what was left out.
        toml: written proposal.
        picture: written picture.
    """

    values: dict[str, Any]
    notes: tuple[str, ...]
    toml: Path
    picture: Path


@dataclass(frozen=True, slots=True)
class WrittenFiles:
    """Files that a command wrote.

    Attributes:
        folder: folder of the files.
        files: their names.
        lines: what the command prints without `--json`.
        passed: whether all cases passed; null if the command has no cases.
    """

    folder: Path
    files: list[str]
    lines: list[str]
    passed: bool | None = None


@dataclass(frozen=True, slots=True)
class Studied:
    """A study, or its plan.

    Attributes:
        folder: folder of tables and winners.
        plan: whether only the cost was estimated (`--plan`).
        lines: what the command prints without `--json`.
        rows: candidates as in `study.csv`, column -> text; empty for a plan.
    """

    folder: Path
    plan: bool
    lines: list[str]
    rows: list[dict[str, str]] = field(default_factory=list)


def read_rows(table: Path) -> list[dict[str, str]]:
    """Return the rows of a table, column -> text."""
    with table.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@dataclass(frozen=True, slots=True)
class Devices:
    """Devices of a scanner that runs until Ctrl-C; printed when they are ready.

    Attributes:
        lidar: name of the lidar.
        servo: name of the servo.
        lidar_addresses: serial port, HOST:PORT, or both.
        servo_port: serial port.
    """

    lidar: str
    servo: str
    lidar_addresses: list[str]
    servo_port: str


@dataclass(frozen=True, slots=True)
class Published:
    """Data that `ros2` publishes until Ctrl-C; printed before it starts.

    Attributes:
        devices: lidar and servo; null if a recording is published.
        recording: the recording; null if devices are used.
    """

    devices: Devices | None
    recording: Path | None


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """State of the devices and of this computer.

    Attributes:
        findings: in the order of the checks.
    """

    findings: list[Finding]


@dataclass(frozen=True, slots=True)
class Settings:
    """Permanent settings of a servo.

    Attributes:
        changes: settings that were written, or that would be with `--dry-run`, one line each.
        undo: file that restores the old ones; null if nothing was written.
        position_deg: where `--centre` left the horn; null without it.
    """

    changes: list[str]
    undo: Path | None = None
    position_deg: float | None = None


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Calibration of a scanner, as in the report next to the angle set.

    Attributes:
        recordings: names of the recordings.
        left_out: dropped beams, reason -> count.
        schema: version of these keys.
        beams: beams with a return.
        beams_used: beams on surfaces that were used.
        beams_at_edges: beams near edges, not used.
        surfaces: number of flat surfaces.
        parameters: estimated errors: name, words, unit, value, sd (1 sigma), start, and applied_by.
        covariance: names and matrix of the estimated errors, in SI units.
        singular_values: of the normalised problem; a small one marks errors that are hard to tell apart.
        held: parameters that were not estimated: names, words and why.
        notes: warnings.
        faults: reasons why the result is wrong; the angle set is then not written.
        drift: for each recording: motion of the platform, with chi2 of 6 degrees of freedom.
        second_looks: double coverage: beams asked for, compared, and in conflict (`seen_through`).
        range_noise_mm: noise of a range.
        wall_bulge_mm: unevenness of the surfaces.
        residual_mm: rms distance from the surfaces: before, after, as_assembled.
        wall_straightness_mm: rms bend of the largest walls: before, after, as_assembled.
        entropy: map sharpness before and after, an independent check.
    """

    recordings: list[str]
    left_out: dict[str, int]
    schema: str
    beams: int
    beams_used: int
    beams_at_edges: int
    surfaces: int
    parameters: list[dict[str, Any]]
    covariance: dict[str, Any]
    singular_values: list[float]
    held: list[dict[str, Any]]
    notes: list[str]
    faults: list[str]
    drift: list[dict[str, Any]]
    second_looks: dict[str, int]
    range_noise_mm: float
    wall_bulge_mm: float
    residual_mm: dict[str, float]
    wall_straightness_mm: dict[str, list[float]]
    entropy: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Registered:
    """Aligned clouds.

    Attributes:
        complete: whether every cloud was aligned; otherwise nothing was written.
        points: points of the merged cloud.
        files: files that were written.
        notes: remarks, such as data that a file cannot store.
    """

    complete: bool
    points: int
    files: tuple[Path, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Mapped:
    """An occupancy grid.

    Attributes:
        points: points of all clouds in the map.
        moved: points that were dropped because beams of another cloud passed them.
        files: YAML file and image.
        notes: remarks, such as an unknown position of the scanner.
    """

    points: int
    moved: int
    files: tuple[Path, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class OpenedPage:
    """A page or a server, or a file for a viewer.

    Attributes:
        address: address to open; null if a file was written.
        file: the file; null if an address is served until Ctrl-C.
        scans: scans in the file; null if an address is served.
    """

    address: str | None = None
    file: Path | None = None
    scans: int | None = None
