"""A user's own drivers, named in robot.yaml, drive a simulated robot or are refused in one line."""

from dataclasses import replace
from typing import Any

import numpy as np
import own_drivers
import pytest
from changed_robots import described
from deploy_policies import Hold, stand_still
from own_drivers import OwnDriver, OwnImu
from refused import refusal_of
from some_motors import two_motors
from watched_simulation import Simulation

from footfall import Robot, UserError
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.choice import filters_of, open_driver, open_imu
from footfall.deploy.drivers.driver import Replies
from footfall.deploy.frames import no_frames
from footfall.deploy.session import Session, run_session
from footfall.deploy.wiring import wiring_of
from footfall.plant.imu_ends import open_imu_end

MOTOR, IMU = "own_drivers:OwnDriver", "own_drivers:OwnImu"


def with_own(robot: Robot, imu: str = IMU, **protocols: str) -> Robot:
    motors = robot.description.motors.items()
    own = {name: replace(motor, protocol=protocols.get(name, motor.protocol)) for name, motor in motors}
    return described(robot, motors=own, imu_protocol=imu)


@pytest.mark.parametrize("protocols", [{"hip": MOTOR, "knee": MOTOR}, {"knee": MOTOR}], ids=["all", "mixed"])
def test_a_robot_with_own_motor_and_imu_drivers_holds_its_pose(go1: Robot, protocols: Any) -> None:
    robot = with_own(go1, **protocols)
    simulated = Simulation(robot, hanging=True)
    positions: list[np.ndarray] = []
    session = Session(stand_still, 0.3, realtime=False, config=DeployConfig(stand_s=0.3), lie_down=False)
    outcome = run_session(
        robot,
        Hold(robot),
        simulated.bus,
        session,
        each_tick=lambda loop: positions.append(loop.sensed.joint_position) if loop.walking else None,
    )
    assert outcome.faults == ()
    assert outcome.walked_s == pytest.approx(0.3, abs=0.005)
    np.testing.assert_allclose(positions[-1], robot.default_pose, atol=0.1)
    assert not simulated.body.motors_on.any()


def test_filters_and_readings_come_from_the_users_imu(go1: Robot) -> None:
    wiring = wiring_of(with_own(go1))
    assert OwnImu.filters[0] in filters_of(wiring)
    imu, end = open_imu(wiring), open_imu_end(wiring)
    imu.absorb(end.encode(imu.reading._replace(gyro=(0.1, -0.2, 0.3))), 5000)
    assert imu.reading.gyro == (0.1, -0.2, 0.3)
    assert imu.arrived_us == 5000


def test_a_motor_with_the_own_imus_ids_is_refused(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OwnDriver, "identifiers", staticmethod(lambda motor: (0x4FE + motor,)))
    with pytest.raises(UserError, match=r"FR_thigh_joint .*IMU.* 0x500"):
        open_driver(wiring_of(with_own(go1, hip=MOTOR, knee=MOTOR)))


def lacking(name: str) -> type:
    """The own driver without one of its parts."""
    parts = {key: value for base in reversed(OwnDriver.__mro__[:-1]) for key, value in vars(base).items()}
    return type("Lacking", (), {k: v for k, v in parts.items() if k not in (name, "__dict__", "__weakref__")})


def with_part(name: str, part: Any) -> type:
    return type("Changed", (OwnDriver,), {name: part})


def of_shape(*shape: int) -> property:
    return property(lambda self: np.zeros(shape), lambda self, value: None)


PARTS = "identifiers replies error_name filters maker damping not_confirmed_off"
WRONG_PARTS = {
    **{name: lacking(name) for name in PARTS.split()},
    "lowest": with_part("lowest", of_shape(2)),
    "gain_rounding": with_part("gain_rounding", of_shape(2, 3)),
    "exchange_bits": with_part("exchange_bits", of_shape(5)),
    "command": with_part("command", lambda self, values: values),
    "enable": with_part("enable", lambda self: None),
    "zero": with_part("zero", lambda self: no_frames()._replace(data=np.zeros((0, 7), np.uint8))),
    "disable": with_part("disable", lambda self: 1 / 0),
    "not_ready": with_part("not_ready", lambda self: True),
    "not_enabled": with_part("not_enabled", lambda self: None),
    "damping ": with_part("damping", lambda self, kd: no_frames()),
    "not_confirmed_off ": with_part("not_confirmed_off", lambda self: np.zeros(5, bool)),
    "replies ": with_part("replies", lambda self, frames: np.zeros((3, 0))),
    "replies  ": with_part(
        "replies", lambda self, frames: Replies(np.zeros(0, int), *np.zeros((4, 0)), None)
    ),
    "__init__": with_part("__init__", lambda self: None),
}


def assert_refused(wiring: Any, import_path: str, part: str) -> None:
    """Loading must fail with one line that names the class and the missing part."""
    message = refusal_of(open_driver, wiring)
    assert import_path in message
    assert part in message


@pytest.mark.parametrize("part", WRONG_PARTS)
def test_an_unsuitable_motor_driver_is_refused(monkeypatch: pytest.MonkeyPatch, part: str) -> None:
    monkeypatch.setattr(own_drivers, "Misfit", WRONG_PARTS[part], raising=False)
    import_path = "own_drivers:Misfit"
    assert_refused(two_motors(import_path, import_path), import_path, part.strip())


@pytest.mark.parametrize(
    ("import_path", "part"),
    [
        ("no_such_module:Driver", "no_such_module"),
        ("own_drivers:NoSuchDriver", "NoSuchDriver"),
        ("own_drivers:REPLY", "not a class"),
        ("NoSuchMotor", "MODULE:NAME"),
    ],
)
def test_a_missing_driver_is_refused_with_its_joint_or_as_the_imus(import_path: str, part: str) -> None:
    assert_refused(two_motors(import_path, "RS00"), "joint hip", part)
    with pytest.raises(UserError, match=part):
        open_imu(replace(two_motors("RS00", "RS00"), imu_protocol=import_path))
