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
from some_motors import two_motors, with_motors
from watched_simulation import Simulation

from footfall import Robot, UserError
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.choice import filters_of, open_driver, open_imu
from footfall.deploy.drivers.driver import Replies
from footfall.deploy.frames import no_frames
from footfall.deploy.loop import ControlLoop
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.session import Session, run_session
from footfall.deploy.wiring import wiring_of
from footfall.plant.imu_ends import open_imu_end

MOTOR = "own_drivers:OwnDriver"


def with_own(robot: Robot, **protocols: str) -> Robot:
    """The robot with the user's IMU driver, and with other protocols of some motors."""
    return described(with_motors(robot, **protocols), imu_protocol="own_drivers:OwnImu")


@pytest.mark.parametrize("protocols", [{"hip": MOTOR, "knee": MOTOR}, {"knee": MOTOR}], ids=["all", "mixed"])
def test_a_robot_with_own_motor_and_imu_drivers_holds_its_pose(go1: Robot, protocols: Any) -> None:
    robot, positions = with_own(go1, **protocols), list[np.ndarray]()
    simulated = Simulation(robot, hanging=True)
    config = DeployConfig(stand_s=0.3, safety=SafetyConfig(damping_s=0.02))
    session = Session(stand_still, 0.1, realtime=False, config=config, lie_down=False)

    def watch(loop: ControlLoop) -> None:
        if loop.walking:
            positions.append(loop.sensed.joint_position)

    outcome = run_session(robot, Hold(robot), simulated.bus, session, watch)
    assert (outcome.faults, outcome.walked_s) == ((), pytest.approx(0.1, abs=0.005))
    np.testing.assert_allclose(positions[-1], robot.default_pose, atol=0.1)
    assert not simulated.body.motors_on.any()


def test_the_users_imu_has_filters_readings_and_ids(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """A motor with one of its ids is refused."""
    wiring = wiring_of(with_own(go1))
    assert OwnImu.filters[0] in filters_of(wiring)
    imu, end = open_imu(wiring), open_imu_end(wiring)
    imu.absorb(end.encode(imu.reading._replace(gyro=(0.1, -0.2, 0.3))), 5000)
    assert (imu.reading.gyro, imu.arrived_us) == ((0.1, -0.2, 0.3), 5000)
    monkeypatch.setattr(OwnDriver, "identifiers", staticmethod(lambda motor: (0x4FE + motor,)))
    with pytest.raises(UserError, match=r"FR_thigh_joint .*IMU.* 0x500"):
        open_driver(wiring_of(with_own(go1, hip=MOTOR, knee=MOTOR)))


def without(name: str) -> type:
    """The user's driver without one of its attributes."""
    members = {key: value for base in reversed(OwnDriver.__mro__[:-1]) for key, value in vars(base).items()}
    left_out = (name, "__dict__", "__weakref__")
    return type("Incomplete", (), {key: value for key, value in members.items() if key not in left_out})


def array_property(*shape: int) -> property:
    return property(lambda self: np.zeros(shape), lambda self, value: None)


REQUIRED = "identifiers", "replies", "error_name", "filters", "maker", "damping", "not_confirmed_off"
WRONG_ATTRIBUTES: list[tuple[str, Any]] = [
    ("lowest", array_property(2)), ("gain_rounding", array_property(2, 3)),
    ("exchange_bits", array_property(5)), ("command", lambda self, values: values),
    ("enable", lambda self: None),
    ("zero", lambda self: no_frames()._replace(data=np.zeros((0, 7), np.uint8))),
    ("disable", lambda self: 1 / 0),
    ("not_ready", lambda self: True),
    ("not_enabled", lambda self: None),
    ("damping", lambda self, kd: no_frames()),
    ("not_confirmed_off", lambda self: np.zeros(5, bool)),
    ("replies", lambda self, frames: np.zeros((3, 0))),
    ("replies", lambda self, frames: Replies(np.zeros(0, int), *np.zeros((4, 0)), None)),
    ("__init__", lambda self: None),
]  # fmt: skip


def test_an_unsuitable_motor_driver_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, driver in (
        *((name, without(name)) for name in REQUIRED),
        *((name, type("Changed", (OwnDriver,), {name: value})) for name, value in WRONG_ATTRIBUTES),
    ):
        monkeypatch.setattr(own_drivers, "Misfit", driver, raising=False)
        message = refusal_of(open_driver, two_motors("own_drivers:Misfit", "own_drivers:Misfit"))
        assert ("own_drivers:Misfit" in message, name in message) == (True, True)


def test_a_missing_driver_of_a_motor_or_of_the_imu_is_refused() -> None:
    for import_path, reason in (
        ("no_such_module:Driver", "no_such_module"),
        ("own_drivers:NoSuchDriver", "NoSuchDriver"),
        ("own_drivers:REPLY", "not a class"),
        ("NoSuchMotor", "MODULE:NAME"),
    ):
        message = refusal_of(open_driver, wiring := two_motors(import_path, "RS00"))
        assert ("joint hip" in message, reason in message) == (True, True)
        with pytest.raises(UserError, match=reason):
            open_imu(replace(wiring, imu_protocol=import_path))
