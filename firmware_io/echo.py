"""Which echoes of a beam are kept; apart from the arrays, so that the command line needs no numpy."""

from __future__ import annotations

from typing import Literal

Echo = Literal["first", "last", "strongest", "all"]
