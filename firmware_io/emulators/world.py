"""Simulated ranges of a turning lidar: each beam is cast at the axis angle of its time.

Rays use `AngleSet.T_world_laser`, the definition of the frame chain, not the kernel of `assemble`, so that each checks
the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Floats, Times
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import TaskError
from scanwright.design.scene.ray_caster import Hits, Scene, build_scene, cast, load_scene

_MOST_NOISE_MM = 1e5  # more is a wrong unit
_SPEED_VARIATION = 0.01  # relative [assumed]
SPIN_UP_S = 0.5  # time constant of a motor [assumed]: after 1.5 s it has 95 % of its speed
_VARIATION_S = 1.7  # period of the variation [assumed]


@dataclass(frozen=True, slots=True)
class RangeModel:
    """Noise, resolution and limits of a sensor."""

    sigma_m: float | Callable[[Floats], Floats]  # standard deviation of the noise, or a function of the range [m]
    quantum_m: float  # resolution of ranges
    range_min_m: float
    range_max_m: float
    incidence_max_rad: float  # largest angle to the normal of a surface with a return


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One simulated scan; row i is beam i."""

    range_m: Float64[ndarray, " n"]  # shape (n,); +inf without a return, -inf if too near (REP 117)
    intensity: Float64[ndarray, " n"]  # shape (n,), 0 without a range


def range_model(lidar: Lidar, sigma_mm: float | None = None) -> RangeModel:
    """Return the range model of a catalogue sensor, with an assumed incidence limit of 85 deg."""
    if sigma_mm is not None and not 0 <= sigma_mm <= _MOST_NOISE_MM:
        raise TaskError(f"noise {sigma_mm} mm: 0 to {_MOST_NOISE_MM:g}")
    return RangeModel(
        sigma_m=(lambda range_m: lidar.sigma_mm(1000 * range_m) / 1000) if sigma_mm is None else sigma_mm / 1000,
        quantum_m=0.001,
        range_min_m=lidar.range_min_mm / 1000,
        range_max_m=lidar.range_max_mm / 1000,
        incidence_max_rad=np.radians(85),
    )


def rays(
    angles: AngleSet, bearing_rad: Float64[ndarray, " n"], joint_rad: Float64[ndarray, " n"]
) -> tuple[Float64[ndarray, "n 3"], Float64[ndarray, "n 3"]]:
    """Return origins and unit directions of beams in the world, each at its joint position; all shapes (n, ...)."""
    T_world_laser = angles.T_world_laser(joint_rad)
    in_plane = np.stack([np.cos(bearing_rad), np.sin(bearing_rad)], axis=-1)
    return T_world_laser[:, :3, 3], np.einsum("nij,nj->ni", T_world_laser[:, :3, :2], in_plane)


def see(scene: Scene, angles: AngleSet, bearing_rad: Float64[ndarray, " n"], joint_rad: Float64[ndarray, " n"]) -> Hits:
    """Cast beams of one sensor in a scene (world frame), each at its joint position."""
    return cast(scene, *rays(angles, bearing_rad, joint_rad))


def measure_ranges(hits: Hits, model: RangeModel, rng: np.random.Generator) -> Measured:
    """Return rounded ranges with noise, and plausible intensities; draws one random number per beam."""
    sigma_m = model.sigma_m(hits.range_m) if callable(model.sigma_m) else model.sigma_m
    noise_m = sigma_m * rng.standard_normal(hits.range_m.size)
    range_m = np.rint((hits.range_m + noise_m) / model.quantum_m) * model.quantum_m
    lost = ~(hits.incidence_rad <= model.incidence_max_rad) | (range_m > model.range_max_m)
    near = ~lost & (range_m < model.range_min_m)
    intensity = 4000 * np.cos(hits.incidence_rad) / (1 + hits.range_m)
    return Measured(
        np.where(lost, np.inf, np.where(near, -np.inf, range_m)),
        np.where(lost | near, 0.0, intensity),
    )


def scene_ranging(
    scene: Scene,
    angles: AngleSet,
    angle_at: Callable[[Times], Floats],
    model: RangeModel,
    seed: int = 0,
) -> Callable[[Times, Floats], tuple[Floats, Floats]]:
    """Return the `Ranging` of a lidar emulator; `angle_at`: true angle of the axis at given times."""
    rng = np.random.default_rng(seed)

    def ranging(time_ns: Times, bearing_rad: Floats) -> tuple[Floats, Floats]:
        measured = measure_ranges(see(scene, angles, bearing_rad, angle_at(time_ns)), model, rng)
        return measured.range_m, measured.intensity

    return ranging


def turned_deg(rate_hz: float, since_s: Floats) -> tuple[Floats, Floats]:
    """Return angle [deg] and speed [deg/s] of a low-cost sensor's motor, which varies by 1 % [assumed]."""
    mean_deg_s, phase = 360 * rate_hz, 2 * np.pi * since_s / _VARIATION_S
    ahead_s = _SPEED_VARIATION * _VARIATION_S / (2 * np.pi) * (1 - np.cos(phase))
    return mean_deg_s * (since_s + ahead_s), mean_deg_s * (1 + _SPEED_VARIATION * np.sin(phase))


def spun_up(since_s: Floats) -> tuple[Floats, Floats]:
    """Return the time [s] at full speed for the same angle since rest, and the fraction of that speed (exponential)."""
    share = -np.expm1(-since_s / SPIN_UP_S)
    return since_s - SPIN_UP_S * share, share


def furnished_room() -> Float64[ndarray, "triangles 3 3"]:
    """Return the triangles of a room, 7.2 x 5.6 x 2.8 m, its floor 0.9 m below the world's origin: (t, 3, 3)."""
    room = [[-3.2, -2.4, -0.9], [4.0, 3.2, 1.9]]
    furniture = [
        [[1.6, -2.4, -0.9], [3.0, -1.6, -0.15]],  # table
        [[3.4, 0.4, -0.9], [4.0, 2.0, 1.1]],  # cupboard
        [[-2.2, 2.2, -0.9], [-1.8, 2.6, 1.9]],  # pillar
        [[-3.2, -1.6, -0.9], [-2.5, -0.2, -0.4]],  # bench
        [[0.2, 2.8, -0.1], [1.4, 3.2, 0.9]],  # shelf
        [[0.4, -0.4, 1.6], [1.6, 0.4, 1.9]],  # lamp
    ]
    return np.concatenate([trimesh.creation.box(bounds=bounds).triangles for bounds in [room, *furniture]])


def room(mesh: Path | None, unit_m: float = 1.0, at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    """Return the scene of a mesh or the furnished room, with the scanner at `at_m`; SceneError for a bad mesh."""
    if mesh is None:
        return build_scene(furnished_room() - np.array(at_m))
    return load_scene(mesh, unit_m, frames.rigid(np.eye(3), -np.array(at_m)))
