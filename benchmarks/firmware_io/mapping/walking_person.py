"""A person walks through the furnished room while scanners turn: how much of him `seen_through` leaves, what else goes.

uv run python -m benchmarks.firmware_io.mapping.walking_person
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.arrays import Floats, Mask
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.motion import Spin
from scanwright.design.scene.ray_caster import Scene, build_scene, cast
from scanwright.firmware_io.emulators.world import furnished_room, rays
from scanwright.firmware_io.mapping.seen_through import Stand, seen_through

FLOOR_M = -0.9
SPEED_M_S = 1.0
_BREAK_S = 0.37  # between turns, so that no two of them meet him at the same place
_TILTED = (0.0, -50.0, 35.0)
_ROLLING = (90.0, 0.0, -90.0)
_ONE_PLACE = ((0.0, 0.0, 0.0),) * 5
_PLACES = ((0.0, 0.0, 0.0), (0.8, 0.5, 0.05), (-0.6, 0.3, 0.0), (0.2, -0.6, 0.0), (1.2, -0.2, 0.0))


@dataclass(frozen=True, slots=True)
class Session:
    """Turns of a scanner in a room that somebody walks through.

    Attributes:
        sensor: of the catalogue.
        mount_deg: beta_rot, alpha_laser, beta_laser.
        period_s: of a turn.
        eyes_m: where the scanner stands, a turn each.
        sigma_m: of the ranges.
        every: only each so many-th beam.
    """

    sensor: str
    mount_deg: tuple[float, float, float]
    period_s: float
    eyes_m: tuple[tuple[float, float, float], ...]
    sigma_m: float
    every: int = 1

    def stands(self, seed: int = 1) -> tuple[list[Stand], list[Mask]]:
        """What each turn sees, and which of its points are of the person."""
        rng = np.random.default_rng(seed)
        room, body = build_scene(furnished_room(), "room"), build_scene(person(), "person")
        turns = [self._turn(k, room, body, rng) for k in range(len(self.eyes_m))]
        return [stand for stand, _ in turns], [his for _, his in turns]

    def _turn(self, number: int, room: Scene, body: Scene, rng: np.random.Generator) -> tuple[Stand, Mask]:
        lidar = load_catalogue().get(self.sensor, Lidar)
        bearing_rad = lidar.bearings_rad()[:: self.every]
        scans = int(np.ceil(self.period_s * lidar.scan_rate_hz))
        within_s = (bearing_rad - bearing_rad[0]) / (2 * np.pi * lidar.scan_rate_hz)
        since_s = (np.arange(scans)[:, None] / lidar.scan_rate_hz + within_s).ravel()
        beta_rot, alpha_laser, beta_laser = self.mount_deg
        angles = AngleSet(
            task="walk",
            angles_deg=Angles(alpha_rot=0, beta_rot=beta_rot, alpha_laser=alpha_laser, beta_laser=beta_laser),
            sensor=self.sensor,
            servo="MX-64R",
            motion=Spin(period_s=self.period_s),
        )
        origin_m, along = rays(angles, np.tile(bearing_rad, scans), 2 * np.pi * since_s / self.period_s)
        eye_m = np.array(self.eyes_m[number])
        origin_m = origin_m + eye_m
        behind_m = cast(room, origin_m, along).range_m
        stands_m = where(since_s + number * (self.period_s + _BREAK_S))
        his_m = cast(body, origin_m - stands_m, along).range_m
        range_m = np.minimum(behind_m, his_m) + rng.normal(0, self.sigma_m, len(along))
        back = np.isfinite(range_m)
        return Stand((origin_m + along * range_m[:, None])[back], eye_m), (his_m < behind_m)[back]


def person() -> Floats:
    """Triangles of somebody 1.75 m tall, his feet at the origin, shape (t, 3, 3)."""
    boxes = [
        [[-0.25, -0.125, 0.825], [0.25, 0.125, 1.475]],
        [[-0.1, -0.1, 1.475], [0.1, 0.1, 1.75]],
        [[-0.2, -0.1, 0], [-0.05, 0.1, 0.825]],
        [[0.05, -0.1, 0], [0.2, 0.1, 0.825]],
    ]
    return np.concatenate([trimesh.creation.box(bounds=box).triangles for box in boxes])


def where(time_s: Floats) -> Floats:
    """Where he is, shape (n, 3): to and fro along the room, a metre off every scanner."""
    gone_m = np.abs((SPEED_M_S * time_s) % 5.0 - 2.5)
    return np.stack([1.6 * gone_m - 1.5, 2.0 - 0.2 * gone_m, np.full_like(gone_m, FLOOR_M)], axis=1)


def shares(gone: Sequence[Mask], his: Sequence[Mask]) -> tuple[float, float]:
    """Of the person's points those that go, and of all others."""
    went, moved = np.concatenate(gone), np.concatenate(his)
    return float(went[moved].mean()), float(went[~moved].mean())


SESSIONS = {
    "UTM-30LX, rolling, 6 s, one place": Session("UTM-30LX", _ROLLING, 6.0, _ONE_PLACE, 0.01),
    "UTM-30LX, tilted, 4 s, one place": Session("UTM-30LX", _TILTED, 4.0, _ONE_PLACE, 0.01),
    "UTM-30LX, tilted, 4 s, five places": Session("UTM-30LX", _TILTED, 4.0, _PLACES, 0.01),
    "the same with 30 mm of noise": Session("UTM-30LX", _TILTED, 4.0, _PLACES, 0.03),
    "URG-04LX, tilted, 8 s, five places": Session("URG-04LX", _TILTED, 8.0, _PLACES, 0.01),
}


def main() -> None:
    """Print the table."""
    print(f"{'session':38}{'beyond':>8}{'of him go':>12}{'of the room go':>17}")
    for name, session in SESSIONS.items():
        stands, his = session.stands()
        for beyond_m in (0.05, 0.1, 0.15):
            moved, still = shares(seen_through(stands, beyond_m), his)
            print(f"{name:38}{beyond_m:6.2f} m{moved:12.2%}{still:17.4%}")


if __name__ == "__main__":
    main()
