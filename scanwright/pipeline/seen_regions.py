"""Regions that a scanner must see: as `scanwright new` reads them, and as lines of a task file."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Sequence

from pydantic import TypeAdapter, ValidationError

from scanwright.design.errors import TaskError, suggest
from scanwright.design.files.faults import faults_in
from scanwright.design.task.shapes import Region
from scanwright.design.task.task import SMALLEST_BALL_DEG, DensityRules, Task

Numbers = tuple[float, ...]
_REGION: TypeAdapter[Region] = TypeAdapter(Region)

SEEN: dict[str, tuple[str, Numbers]] = {
    "ground": ("ground:FROM:TO:WIDTH, in metres ahead", (0.5, 5.0, 4.0)),
    "ceiling": ("ceiling:HEIGHT over the ground", (2.5,)),
    "wall": ("wall:DISTANCE:WIDTH:HEADING:TOP, heading 0 is ahead, 90 to the left", (3.0, 4.0, 0.0, 2.5)),
    "around": ("around:UP:DOWN, in degrees from level", (30.0, 30.0)),
    "all": ("all, every direction", ()),
    "thing": ("thing:SIZE:DISTANCE, what it must not miss anywhere in the rest", (0.1, 3.0)),
}
"""Word of a region -> its form, and the defaults of its numbers."""
FLAT = 6  # balls across the angle from level to the far end of the ground
FLATTEST_BALL_DEG = 0.5  # smaller balls hold few beams of usual lidars
_USUAL_BALL_RAD = math.radians(DensityRules().ball_radius_deg)
_SIGNED = {"FROM", "TO", "HEADING"}  # these numbers can be negative


def parse_region(text: str) -> tuple[str, Numbers]:
    """Return the word of `SEEN` and the numbers of a text such as "ground:0.5:5".

    Raises:
        TaskError: there is no such region, or its numbers are invalid.
    """
    word, *values = text.split(":")
    if word not in SEEN:
        raise TaskError(f"see = '{text}': unknown region{suggest(word, SEEN)}; {known_regions()}")
    how, usual = SEEN[word]
    try:
        numbers = [float(each) for each in values]
    except ValueError as error:
        raise TaskError(f"see = '{text}': needs numbers after the colons: {how}") from error
    if len(numbers) > len(usual) or not all(math.isfinite(each) for each in numbers):
        raise TaskError(f"see = '{text}': needs at most {len(usual)} finite numbers: {how}")
    require_positive("see", text, how, numbers)
    return word, (*numbers, *usual[len(numbers) :])


def require_positive(option: str, text: str, how: str, numbers: Sequence[float]) -> None:
    """Reject negative numbers, except those in `_SIGNED`; `how` begins like "around:UP:DOWN,".

    Raises:
        TaskError: a number is negative; the message contains the text with positive numbers.
    """
    word, *names = re.split(r"[:, ]", how)
    wrong = [name for name, number in zip(names, numbers, strict=False) if number < 0 and name not in _SIGNED]
    if wrong:
        valid = [
            f"{number if name in _SIGNED else abs(number):g}" for name, number in zip(names, numbers, strict=False)
        ]
        raise TaskError(f"{option} = '{text}': {wrong[0]} is positive: {':'.join([word, *valid])} ({how})")


def known_regions() -> str:
    """Return the forms of all regions."""
    return "; ".join(how for how, _ in SEEN.values())


def density_lines(things: Sequence[Numbers], regions: Sequence[tuple[str, Numbers]], height_m: float) -> list[str]:
    """Return lines of a task file that set the ball radius: half the width of the smallest thing to see.

    Without things it becomes a small share of the angle at which flat ground appears, since J counts ground within
    the ball radius of a beam as seen. `height_m` is that of the scanner above the ground.

    Raises:
        TaskError: a size or a distance is not above 0, or the thing is too small for a ball.
    """
    if not things:
        far_m = max((numbers[1] for word, numbers in regions if word == "ground"), default=0.0)
        if not 0 < height_m < far_m * math.tan(FLAT * _USUAL_BALL_RAD):
            return []
        angle_deg = math.degrees(math.atan2(height_m, far_m))
        return [
            f"[density]  # {far_m:g} m away the ground is {angle_deg:.2g} deg below level: a usual ball of "
            f"{math.degrees(_USUAL_BALL_RAD):g} deg would count as seen what no beam reaches",
            f"ball_radius_deg = {max(FLATTEST_BALL_DEG, angle_deg / FLAT):.2g}",
            "",
        ]
    size_m, distance_m = min(things, key=lambda each: each[0] / each[1] if each[1] > 0 else 0.0)
    if not (size_m > 0 and distance_m > 0):
        raise TaskError(f"see = 'thing:{size_m:g}:{distance_m:g}': size and distance must be above 0")
    radius_deg = math.degrees(math.atan2(size_m / 2, distance_m))
    if radius_deg < SMALLEST_BALL_DEG:
        seen = f"appears {2 * radius_deg:.2g} deg wide, minimum {2 * SMALLEST_BALL_DEG:g}"
        raise TaskError(f"see = 'thing:{size_m:g}:{distance_m:g}': {seen}")
    return [
        f"[density]  # what is {size_m:g} m wide, {distance_m:g} m away: beams within half its width count for it",
        f"ball_radius_deg = {radius_deg:.2g}",
        "",
        "# [limits]  # remove the # to reject mounts with fewer than two beams on it",
        "# min_density = 2",
        "",
    ]


def region_lines(word: str, numbers: Numbers, height_m: float) -> list[str]:
    """Return the lines of a task file for a region; `height_m` is that of the scanner above the ground.

    Raises:
        TaskError: there is no such region.
    """
    values = (90 - numbers[0], 90 + numbers[1]) if word == "around" else numbers
    lines = _LINES[word].format(*values, height_m=height_m).splitlines()
    try:
        _REGION.validate_python(tomllib.loads("\n".join(lines)))
    except ValidationError as error:
        region = ":".join([word, *(f"{each:g}" for each in numbers)])
        raise TaskError(f"see = '{region}': {'; '.join(map(str, faults_in(error, Task)))}") from error
    return ["[[weight]]", *lines, ""]


_LINES = {
    "ground": """shape = "ground"      # what matters, all of it alike: value = 2 makes a region count twice
from_m = {0:g}
to_m = {1:g}
width_m = {2:g}
height_m = {height_m:g}        # of the scanner over the ground
heading_deg = 0       # 0 is ahead, 90 to the left""",
    "ceiling": """shape = "ceiling"
ceiling_m = {0:g}       # over the ground
height_m = {height_m:g}        # of the scanner over the ground
from_m = -2           # behind
to_m = 2              # ahead
width_m = 4""",
    "wall": """shape = "wall"
distance_m = {0:g}
width_m = {1:g}
height_m = {height_m:g}        # of the scanner over the ground
bottom_m = 0          # of the wall, over the ground
top_m = {3:g}
heading_deg = {2:g}       # 0 is ahead, 90 to the left""",
    "around": """shape = "band"
theta_deg = [{0:g}, {1:g}]  # 0 is up, 90 level, 180 down""",
    "all": 'shape = "all"',
}
"""Word of a region -> its lines in a task file."""
