"""The files of a measured model: a proposal for a product file, and its picture."""

import hashlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from scanwright.cad.measure.model import read_model, turned
from scanwright.cad.measure.picture import picture_svg
from scanwright.cad.measure.proposal import Proposal, propose, toml_text
from scanwright.design.errors import TaskError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.design.progress import Progress, no_progress


@dataclass(frozen=True, slots=True)
class MeasuredFiles:
    """The proposal and its files."""

    proposal: Proposal
    toml: Path
    picture: Path

    def lines(self) -> list[str]:
        """Return holes by face, other values, and remarks."""
        holes = Counter((str(h.axis), h.kind.replace("_", " "), h.size) for h in self.proposal.holes)
        values = [f"{field}: {value}" for field, value in self.proposal.values.items() if field != "holes"]
        counts = [f"holes in {face}: {count} x {size} {kind}" for (face, kind, size), count in holes.items()]
        notes = [f"note: {note}" for note in self.proposal.notes]
        return [*(counts or ["holes: none"]), *values, *notes, f"wrote {self.toml} and {self.picture}"]


def measure_files(
    model: Path,
    out: Path,
    kind: Literal["lidar", "servo"],
    *,
    up: str = "+z",
    front: str = "+x",
    unit: str | None = None,
    progress: Progress = no_progress,
) -> MeasuredFiles:
    """Measure a maker's model, and write the proposal and the picture.

    Args:
        model: STEP or STL file.
        out: TOML file of the proposal; the picture has its name and the suffix .svg.
        kind: lidar or servo.
        up: axis of the model that points up, or out of the servo's horn.
        front: axis of the model that is +x of the device.
        unit: of an STL file; None for mm.
        progress: callback for progress.

    Raises:
        SceneError: the model is missing or unreadable, or shows no device.
        TaskError: `out` is not a TOML file, or exists and is no proposal.
    """
    if out.suffix != ".toml":
        raise TaskError(f"out = {out}: a proposal is a .toml file")
    if out.exists() and "scanwright measure" not in out.read_text(encoding="utf-8"):
        raise TaskError(f"out = {out}: exists and is no proposal: choose another name")
    check_place(out, TaskError)
    progress("reading the model")
    triangles = turned(read_model(model, unit), up, front)
    progress("measuring")
    proposal = propose(triangles, kind)
    digest = hashlib.sha256(model.read_bytes()).hexdigest()
    picture = out.with_suffix(".svg")
    with atomic_write(out, TaskError) as place:
        place.write_text(toml_text(proposal, model.name, digest), encoding="utf-8")
    progress("drawing")
    with atomic_write(picture, TaskError) as place:
        place.write_bytes(picture_svg(proposal, model.name))
    return MeasuredFiles(proposal, out, picture)
