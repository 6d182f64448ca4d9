"""Choice of echoes of a beam, in a module without numpy for the command line."""

from __future__ import annotations

from typing import Literal

Echo = Literal["first", "last", "strongest", "all"]
