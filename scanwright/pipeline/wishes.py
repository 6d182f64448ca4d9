"""What a scanner must see, as a person says it in metres, and as regions of a task file."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Sequence

from pydantic import TypeAdapter, ValidationError

from scanwright.design.errors import TaskError, suggest
from scanwright.design.files.faults import faults_in
from scanwright.design.task.shapes import Region
from scanwright.design.task.task import SMALLEST_BALL_DEG, Task

Numbers = tuple[float, ...]
_REGION: TypeAdapter[Region] = TypeAdapter(Region)

SEEN: dict[str, tuple[str, Numbers]] = {
    "ground": ("ground:FROM:TO:WIDTH, in metres ahead", (0.5, 5.0, 4.0)),
    "ceiling": ("ceiling:HEIGHT over the ground", (2.5,)),
    "wall": ("wall:DISTANCE:WIDTH ahead", (3.0, 4.0)),
    "around": ("around:UP:DOWN, in degrees from level", (30.0, 30.0)),
    "all": ("all, every direction", ()),
    "thing": ("thing:SIZE:DISTANCE, what it must not miss anywhere in the rest", (0.1, 3.0)),
}
"""What can be asked for: how it is written, and its numbers where they are left out."""


def parse_wish(text: str) -> tuple[str, Numbers]:
    """What a person asks for: the word of `SEEN`, and its numbers.

    Raises:
        TaskError: there is no such thing to see, or its numbers are none.
    """
    word, *given = text.split(":")
    if word not in SEEN:
        raise TaskError(f"--see {text}: not a thing to see{suggest(word, SEEN)}; {known_wishes()}")
    how, usual = SEEN[word]
    try:
        numbers = [float(each) for each in given]
    except ValueError as error:
        raise TaskError(f"--see {text}: numbers after the colons: {how}") from error
    if len(numbers) > len(usual) or not all(math.isfinite(each) for each in numbers):
        raise TaskError(f"--see {text}: {len(usual)} numbers at most, and finite: {how}")
    return word, (*numbers, *usual[len(numbers) :])


def known_wishes() -> str:
    """How each of them is written."""
    return "; ".join(how for how, _ in SEEN.values())


def density_lines(things: Sequence[Numbers]) -> list[str]:
    """The ball in which beams are counted, of half the width of the smallest thing that must not be missed.

    Raises:
        TaskError: a size or a distance is not above 0, or the thing is too small for a ball.
    """
    if not things:
        return []
    size_m, distance_m = min(things, key=lambda each: each[0] / each[1] if each[1] > 0 else 0.0)
    if not (size_m > 0 and distance_m > 0):
        raise TaskError(f"--see thing:{size_m:g}:{distance_m:g}: a size and a distance above 0")
    radius_deg = math.degrees(math.atan2(size_m / 2, distance_m))
    if radius_deg < SMALLEST_BALL_DEG:
        looks = f"looks {2 * radius_deg:.2g} deg wide, at least {2 * SMALLEST_BALL_DEG:g}"
        raise TaskError(f"--see thing:{size_m:g}:{distance_m:g}: {looks}")
    return [
        f"[density]  # what is {size_m:g} m wide, {distance_m:g} m away: beams within half its width count for it",
        f"ball_radius_deg = {radius_deg:.2g}",
        "",
        "# [limits]  # take the # away to be refused an answer by which it may be hit less than twice",
        "# min_density = 2",
        "",
    ]


def region_lines(word: str, numbers: Numbers, height_m: float) -> list[str]:
    """The lines of a task file that ask for it; `height_m` is that of the scanner over the ground.

    Raises:
        TaskError: there is no such region.
    """
    lines = _REGIONS[word](numbers, height_m)
    try:
        _REGION.validate_python(tomllib.loads("\n".join(lines)))
    except ValidationError as error:
        wish = ":".join([word, *(f"{each:g}" for each in numbers)])
        raise TaskError(f"--see {wish}: {'; '.join(map(str, faults_in(error, Task)))}") from error
    return ["[[weight]]", *lines, ""]


def _ground(numbers: Numbers, height_m: float) -> list[str]:
    return [
        'shape = "ground"      # what matters, all of it alike: value = 2 makes a region count twice',
        f"from_m = {numbers[0]:g}",
        f"to_m = {numbers[1]:g}",
        f"width_m = {numbers[2]:g}",
        f"height_m = {height_m:g}        # of the scanner over the ground",
        "heading_deg = 0       # 0 is ahead, 90 to the left",
    ]


def _ceiling(numbers: Numbers, height_m: float) -> list[str]:
    return [
        'shape = "ceiling"',
        f"ceiling_m = {numbers[0]:g}       # over the ground",
        f"height_m = {height_m:g}        # of the scanner over the ground",
        "from_m = -2           # behind",
        "to_m = 2              # ahead",
        "width_m = 4",
    ]


def _wall(numbers: Numbers, height_m: float) -> list[str]:
    return [
        'shape = "wall"',
        f"distance_m = {numbers[0]:g}",
        f"width_m = {numbers[1]:g}",
        f"height_m = {height_m:g}        # of the scanner over the ground",
        "bottom_m = 0          # of the wall, over the ground",
        "top_m = 2.5",
        "heading_deg = 0       # 0 is ahead, 90 to the left",
    ]


def _around(numbers: Numbers, _: float) -> list[str]:
    up, down = numbers
    return ['shape = "band"', f"theta_deg = [{90 - up:g}, {90 + down:g}]  # 0 is up, 90 level, 180 down"]


def _all(_numbers: Numbers, _: float) -> list[str]:
    return ['shape = "all"']


_REGIONS: dict[str, Callable[[Numbers, float], list[str]]] = {
    "ground": _ground,
    "ceiling": _ceiling,
    "wall": _wall,
    "around": _around,
    "all": _all,
}
