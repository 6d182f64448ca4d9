"""A camera next to the lidar: lens model and pose, in the conventions of OpenCV and its calibrations.

Camera frame: x right, y down, z forward. (0, 0) is the centre of the top left pixel.

With x = X/Z, y = Y/Z, r2 = x2 + y2 the image of the pinhole camera is (Brown, "Decentering distortion of lenses", 1966)

    x' = x (1 + k1 r2 + k2 r4 + k3 r6) + 2 p1 x y + p2 (r2 + 2 x2),  y' accordingly with p1 and p2 exchanged

and of the fisheye, with t the angle from the optical axis (Kannala and Brandt, 2006),

    (x', y') = t (1 + k1 t2 + k2 t4 + k3 t6 + k4 t8) (x, y) / r
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import Field, model_validator

from scanwright.design import frames
from scanwright.design.arrays import Pose
from scanwright.design.files.record import Record

Pixels = Annotated[int, Field(strict=True, ge=1, le=100_000)]
Focal = Annotated[float, Field(gt=0)]

_DISTORTIONS = {"pinhole": (0, 4, 5), "fisheye": (0, 4)}
_STEPS = 2000  # of the radius, to find where the distortion stops increasing


class Camera(Record):
    """One camera and its images.

    The camera is fixed to `frame`: `world` is the robot, `rot` turns with the servo, `laser` is the lidar.
    `rotvec_deg` rotates that frame's axes to those of the camera (axis times angle): 0 looks along z, x right.
    """

    model: Literal["pinhole", "fisheye"] = Field(default="pinhole", description="model of its lens")
    size_px: tuple[Pixels, Pixels] = Field(description="width, height")
    focal_px: tuple[Focal, Focal] = Field(description="fx, fy")
    centre_px: tuple[float, float] = Field(description="cx, cy")
    distortion: tuple[float, ...] = Field(default=(), description="pinhole: k1 k2 p1 p2 [k3]; fisheye: k1 k2 k3 k4")
    frame: Literal["world", "rot", "laser"] = Field(description="frame that it is fixed to: robot, linkage or lidar")
    position_mm: tuple[float, float, float] = Field(description="its optical centre in that frame")
    rotvec_deg: tuple[float, float, float] = Field(description="rotates that frame's axes to those of the camera")
    images: str = Field(description="an image, or a CSV of them: file, and time_ns or joint_deg; next to the task file")

    @model_validator(mode="after")
    def _has_its_coefficients(self) -> Camera:
        counts = _DISTORTIONS[self.model]
        if len(self.distortion) not in counts:
            allowed = " or ".join(str(count) for count in counts)
            raise ValueError(f"distortion has {len(self.distortion)} numbers, a {self.model} camera {allowed}")
        return self

    def T_frame_camera(self) -> Pose:
        """Return the pose of the camera in its frame [m], shape (4, 4)."""
        return frames.rigid(frames.rotvec_to_matrix(np.radians(self.rotvec_deg)), np.array(self.position_mm) / 1000)

    def pixels(self, points_m: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
        """Return the pixels of points of the camera frame, shapes (n, 2) and (n, 3); NaN outside of the image."""
        x, y = self._pinhole(points_m) if self.model == "pinhole" else self._fisheye(points_m)
        uv = np.stack([x, y], axis=1) * self.focal_px + self.centre_px
        inside = np.all((uv >= -0.5) & (uv < np.array(self.size_px) - 0.5), axis=1)
        return np.where(inside[:, None], uv, np.nan)

    def _pinhole(self, points_m: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        k1, k2, p1, p2, k3 = (*self.distortion, *(0.0,) * (5 - len(self.distortion)))
        ahead = points_m[:, 2] > 0
        x, y = np.divide(points_m[:, :2].T, points_m[:, 2], where=ahead, out=np.full((2, len(points_m)), np.nan))
        r2 = x * x + y * y
        r2[r2 > _fold((k1, k2, k3)) ** 2] = np.nan  # beyond it two directions would have the same pixel
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def _fisheye(self, points_m: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        aside = np.hypot(points_m[:, 0], points_m[:, 1])
        t = np.arctan2(aside, points_m[:, 2])
        t[t > _fold(self.distortion)] = np.nan
        t2 = t * t
        bent = np.ones_like(t)
        for power, k in enumerate(self.distortion, 1):
            bent += k * t2**power
        share = np.divide(t * bent, aside, where=aside > 0, out=np.zeros_like(t))
        return points_m[:, 0] * share, points_m[:, 1] * share


def _fold(radial: tuple[float, ...]) -> float:
    """Return the radius (or angle) up to pi at which r (1 + k1 r^2 + k2 r^4 + ...) stops increasing."""
    r = np.linspace(0, np.pi, _STEPS)
    slope = 1 + sum((2 * power + 1) * k * r ** (2 * power) for power, k in enumerate(radial, 1)) * np.ones_like(r)
    falls = np.flatnonzero(slope <= 0)
    return float(r[falls[0]]) if falls.size else np.inf
