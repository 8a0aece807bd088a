"""Changes of frames and readings in transit, for fault injection."""

from collections.abc import Callable

import numpy as np

from footfall.common.rotations import rotation_matrix
from footfall.deploy.drivers import imu
from footfall.deploy.frames import Frames, joined

Batches = list[Frames]
# From arrived batches and time, us, to the batches that the controller receives.
Incoming = Callable[[Batches, int], Batches]


def late(by_us: int, selects: Callable[[Frames], bool] = lambda _: True) -> Incoming:
    """Delay some batches."""
    held_back: list[tuple[int, Frames]] = []

    def hold(batches: Batches, now_us: int) -> Batches:
        held_back.extend((now_us + by_us, _shifted(frames, by_us)) for frames in batches if selects(frames))
        due = [frames for at, frames in held_back if at <= now_us]
        held_back[:] = [(at, frames) for at, frames in held_back if at > now_us]
        return [*due, *(frames for frames in batches if not selects(frames))]

    return hold


def _shifted(frames: Frames, by_us: int) -> Frames:
    return frames if frames.time_us is None else frames._replace(time_us=frames.time_us + by_us)


def from_imu(frames: Frames) -> bool:
    """Whether a batch is a reading of the IMU."""
    return bool(len(frames.id)) and int(frames.id[0]) in imu.IDS


def nothing(frames: Frames) -> Frames:
    """No frame."""
    return frames.take(np.zeros(0, dtype=np.intp))


def each_imu_frame(identifier: int, change: Callable[[Frames], Frames]) -> Callable[[Frames], Frames]:
    """Change the frame with this identifier among the three of a reading; `change` may drop it."""

    def corrupt(frames: Frames) -> Frames:
        selected = frames.id == identifier
        return joined([frames.take(~selected), change(frames.take(selected))])

    return corrupt


def cut_short(frames: Frames) -> Frames:
    """The first two bytes of each frame."""
    data = frames.data.copy()
    data[:, 2:] = 0
    return frames._replace(data=data, length=np.full(len(data), 2))


def emptied(frames: Frames) -> Frames:
    """All bytes zero."""
    return frames._replace(data=np.zeros_like(frames.data))


def dropped(share: float, rng: np.random.Generator) -> Callable[[Frames], Frames]:
    """Drops a share of the frames."""
    return lambda frames: frames.take(rng.random(len(frames.id)) >= share)


def flipped(share: float, rng: np.random.Generator) -> Callable[[Frames], Frames]:
    """Flips one bit in a share of the frames."""

    def flip(frames: Frames) -> Frames:
        rows = np.flatnonzero(rng.random(len(frames.id)) < share)
        if not len(rows):
            return frames
        data = frames.data.copy()
        data[rows, rng.integers(8, size=len(rows))] ^= (1 << rng.integers(8, size=len(rows))).astype(np.uint8)
        return frames._replace(data=data)

    return flip


def mounted(reading: imu.Inertial, axis: int, angle_rad: float, rate_rad_s: float = 0.0) -> imu.Inertial:
    """The reading of an IMU that is mounted rotated about a body axis, and keeps rotating at a rate."""
    rotated = turned(reading, axis, float(np.rad2deg(angle_rad)))
    half = angle_rad / 2
    rotation = rotation_matrix(
        np.array([np.cos(half), *(np.sin(half) * np.eye(3)[axis])])
    )  # to the body's axes
    gyro = np.array(reading.gyro) @ rotation + rate_rad_s * np.eye(3)[axis]
    return rotated._replace(
        gyro=gyro.tolist(), acceleration=(np.array(reading.acceleration) @ rotation).tolist()
    )


def turned(reading: imu.Inertial, axis: int, degrees: float) -> imu.Inertial:
    """A reading with only its quaternion rotated about a body axis."""
    half = np.deg2rad(degrees) / 2
    w, x, y, z = reading.quaternion
    c, s = float(np.cos(half)), float(np.sin(half))
    a, b, d = (s * float(axis == k) for k in range(3))
    return reading._replace(
        quaternion=(
            w * c - x * a - y * b - z * d,
            w * a + x * c + y * d - z * b,
            w * b - x * d + y * c + z * a,
            w * d + x * b - y * a + z * c,
        )
    )
