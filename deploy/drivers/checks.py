"""Checks whether an external driver class implements its protocol."""

from collections.abc import Callable
from types import FunctionType
from typing import Any, NoReturn

import numpy as np

from footfall.common.errors import UserError
from footfall.common.outside import find, one_line
from footfall.deploy.drivers.driver import Driver, MotorDriver, Replies
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.drivers.imu_driver import ImuDriver
from footfall.deploy.frames import FD, MAX_FD_BYTES, Frames, no_frames
from footfall.deploy.wiring import Wiring

MOTOR_PAGE, IMU_PAGE = "deploy/drivers/driver.py", "deploy/drivers/imu_driver.py"
MOTOR_ATTRIBUTES = ("maker", "models", "motor_end", "filters")  # members of a motor driver's class
IMU_ATTRIBUTES = ("filters", "identifiers", "imu_end")  # members of an IMU driver's class


def motor_driver_at(import_path: str) -> type[MotorDriver]:
    """Motor driver class at MODULE:NAME.

    Raises:
        UserError: there is no such class, or it lacks a member of `MotorDriver`.
    """
    found: type[MotorDriver] = _class_at(
        import_path, "motor driver", (*MOTOR_ATTRIBUTES, *_methods(MotorDriver)), MOTOR_PAGE
    )
    return found


def imu_driver_at(import_path: str) -> type[ImuDriver]:
    """IMU driver class at MODULE:NAME.

    Raises:
        UserError: there is no such class, it cannot be built, or it lacks a member of `ImuDriver`.
    """
    found: type[ImuDriver] = _class_at(
        import_path, "IMU driver", (*IMU_ATTRIBUTES, *_methods(ImuDriver)), IMU_PAGE
    )
    driver = _call(import_path, "__init__", lambda: found(0))
    _require(driver, import_path, "IMU driver", _members(ImuDriver), IMU_PAGE)
    _call(import_path, "absorb", lambda: driver.absorb(no_frames(), 0))
    lengths = [len(part) for part in _call(import_path, "reading", lambda: Inertial(*driver.reading))]
    if lengths != [3, 3, 4]:
        _refuse(import_path, "reading", f"parts of lengths {lengths}, not [3, 3, 4]")
    return found


def open_external(driver: type[MotorDriver], wiring: Wiring) -> Driver:
    """An external driver for its motors.

    Raises:
        UserError: it cannot be built, lacks a member of `MotorDriver`, or returns wrong types or shapes.
    """
    import_path, n = wiring.models[0], len(wiring.motor_id)
    instance = _call(import_path, "__init__", lambda: driver(wiring))
    _require(instance, import_path, "motor driver", _members(MotorDriver), MOTOR_PAGE)
    for name, shape in (("lowest", (5, n)), ("highest", (5, n)), ("gain_rounding", (2, n))):
        _check_shape(import_path, name, getattr(instance, name), shape)
    _check_shape(import_path, "exchange_bits", instance.exchange_bits, (n,))
    for name in ("query_settings", "enable", "disable", "clear", "zero"):
        _check_frames(import_path, name, _call(import_path, name, getattr(instance, name)))
    _check_frames(
        import_path, "command", _call(import_path, "command", lambda: instance.command(np.zeros((5, n))))
    )
    damping = _call(import_path, "damping", lambda: instance.damping(np.zeros(n)))
    if not isinstance(damping, tuple) or not damping:
        _refuse(import_path, "damping", "not a tuple of batches")
    for frames in damping:
        _check_frames(import_path, "damping", frames)
    for name in ("not_ready", "not_enabled"):
        if not isinstance(_call(import_path, name, getattr(instance, name)), str):
            _refuse(import_path, name, "not a string")
    _check_shape(
        import_path,
        "not_confirmed_off",
        _call(import_path, "not_confirmed_off", instance.not_confirmed_off),
        (n,),
    )
    replies = _call(import_path, "replies", lambda: instance.replies(no_frames()))
    if not isinstance(replies, Replies):
        _refuse(import_path, "replies", "not Replies")
    _check_shape(import_path, "replies", replies.values, (3, 0))
    return driver(wiring)  # a new object, whose state the checks have not changed


def _class_at(import_path: str, what: str, names: tuple[str, ...], page: str) -> Any:
    found = find(import_path, what)
    if not isinstance(found, type):
        raise UserError(f"no {what} '{import_path}': it is not a class")
    _require(found, import_path, what, names, page)
    return found


def _require(found: Any, import_path: str, what: str, names: tuple[str, ...], page: str) -> None:
    if missing := [name for name in names if not hasattr(found, name)]:
        raise UserError(
            f"{import_path} cannot be used as {what}: it has no {', '.join(missing)} (see {page})"
        )


def _members(protocol: type) -> tuple[str, ...]:
    """Public names in a protocol."""
    names = [
        name for base in protocol.__mro__ for name in (*vars(base), *getattr(base, "__annotations__", ()))
    ]
    return tuple(dict.fromkeys(name for name in names if not name.startswith("_")))


def _methods(protocol: type) -> tuple[str, ...]:
    """Public methods of a protocol, which a class has before it is built."""
    members = {name: value for base in protocol.__mro__[:-1] for name, value in vars(base).items()}
    return tuple(
        name for name in _members(protocol) if isinstance(members.get(name), FunctionType | staticmethod)
    )


def _call(import_path: str, name: str, act: Callable[[], Any]) -> Any:
    """Result of the member `name` of an external class; raises UserError if it fails."""
    try:
        return act()
    except UserError:
        raise
    except Exception as error:  # of any type, because the class is external
        raise UserError(f"{import_path} fails at {name}: {one_line(error)}") from error


def _check_frames(import_path: str, name: str, frames: Any) -> None:
    if not isinstance(frames, Frames):
        _refuse(import_path, name, f"{type(frames).__name__}, not Frames")
    k = len(frames.id)
    width = MAX_FD_BYTES if (frames.id & FD != 0).any() else 8
    for part, shape in (("channel", (k,)), ("id", (k,)), ("length", (k,)), ("data", (k, width))):
        _check_shape(import_path, f"{name} ({part})", getattr(frames, part), shape)


def _check_shape(import_path: str, name: str, values: Any, shape: tuple[int, ...]) -> None:
    if not isinstance(values, np.ndarray) or values.shape != shape:
        found = f"shape {values.shape}" if isinstance(values, np.ndarray) else type(values).__name__
        _refuse(import_path, name, f"{found}, not an array of shape {shape}")


def _refuse(import_path: str, name: str, found: str) -> NoReturn:
    raise UserError(f"{import_path} does not fit: {name} returns {found} (see deploy/drivers)")
