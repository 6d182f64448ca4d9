"""Types of arrays: element type and shape. Tests check them at every call; other runs do not.

A shape names its axes: in one call every `n` is the same number, `...` is any number of axes, `*k` axes that are equal
throughout the call. A single axis is written with a leading space, `Float[ndarray, " n"]`, since linters read it as
the name of a type without.
"""

from __future__ import annotations

from jaxtyping import Bool, Float, Float32, Float64, Int64, Num, UInt8
from numpy import ndarray

Array = Float[ndarray, "..."]
"""Of either precision."""

Floats = Float64[ndarray, "..."]
Float32s = Float32[ndarray, "..."]
Ints = Int64[ndarray, "..."]
Bytes = UInt8[ndarray, "..."]
Mask = Bool[ndarray, "..."]

Times = Int64[ndarray, "..."]
"""Nanoseconds."""

Counts = Num[ndarray, "..."]
"""Numbers of beams: integers, or means of them."""

Vector = Float[ndarray, " 3"]
Rotation = Float[ndarray, "3 3"]
Pose = Float[ndarray, "4 4"]

Setting = Float[ndarray, " 4"]
"""(alpha_rot, beta_rot, alpha_laser, beta_laser) in radians."""

Plane = Float[ndarray, " 2"]
"""(alpha_laser, beta_laser) in radians: a scan plane."""
