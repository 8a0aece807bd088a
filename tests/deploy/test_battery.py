"""The battery's charge from the motors' reports, against a pack whose charge is known."""

import re

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from some_motors import MAKERS, with_motors

from footfall import Robot, run_episode
from footfall.deploy.battery import BatteryLimits, BatteryMonitor, BatteryState
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.plant.robot import SimulatedRobot
from footfall.robots.battery import Battery

PERIOD_S, LIMITS = 0.05, BatteryLimits()
STILL = np.zeros((3, 12))


class Pack:
    """A pack and the motors' reports of it. The pack may differ from its declaration."""

    def __init__(self, robot: Robot, charge: float, chemistry: str = "lithium_ion") -> None:
        self.battery = Battery(10, 20.0, 0.1, chemistry)
        self.charge = charge
        self.resistance = self.reported_current = 1.0  # over the true ones
        self.voltage_error_v = np.zeros(12)  # of each motor
        self.monitor = BatteryMonitor(robot, self.battery, LIMITS)
        self.now_us = 0

    def draw(self, seconds: float) -> BatteryState:
        """Draw a current that swings about 6 A, as steps do."""
        battery = self.battery
        for sample in range(round(seconds / PERIOD_S)):
            amps = 6.0 * (1.0 + 0.5 * np.sin(sample))
            self.charge = max(self.charge - amps * PERIOD_S / battery.capacity_c, 0.0)
            drop_v = self.resistance * battery.internal_resistance_ohm * amps
            voltage = battery.open_circuit_v(self.charge) - drop_v + self.voltage_error_v
            current = np.full(12, self.reported_current * amps / 12)
            self.now_us += round(PERIOD_S * 1e6)
            self.monitor.update(self.now_us, voltage, current, STILL)
        return self.monitor.state


@pytest.mark.parametrize(("chemistry", "error"), [("lithium_ion", 0.06), ("lithium_iron_phosphate", 0.15)])
def test_the_charge_is_right_despite_wrong_figures(go1: Robot, chemistry: str, error: float) -> None:
    """A flat curve determines the charge less precisely."""
    pack = Pack(go1, 0.95, chemistry)
    pack.resistance, pack.reported_current = 1.2, 0.9
    errors = [pack.draw(10.0).charge - pack.charge for _ in range(55)]
    assert pack.charge < 0.15
    assert np.abs(errors).max() < error


def test_limits_fall_with_the_charge_until_the_run_has_to_end(go1: Robot) -> None:
    pack = Pack(go1, 0.25)
    states = [pack.draw(2.0) for _ in range(65)]
    first, *_, last = allowed = [state.allowed for state in states]
    assert (first, last) == (1.0, pytest.approx(LIMITS.min_share))
    assert allowed == sorted(allowed, reverse=True)
    middle = next(state for state in states if state.charge < 0.5 * (LIMITS.low_charge + LIMITS.empty_charge))
    assert middle.allowed == pytest.approx(0.5 * (1.0 + LIMITS.min_share), abs=0.05)
    end = next(state for state in states if state.fault)
    assert "empty" in end.fault
    assert end.charge == pytest.approx(LIMITS.empty_charge, abs=0.02)


def test_a_sagging_pack_and_a_wrong_voltage_reading_are_faults(go1: Robot) -> None:
    for change, fault in (
        ({}, "^$"),
        ({"resistance": 3.0}, "^$"),  # old and cold: less is allowed, and the robot continues
        ({"resistance": 12.0}, "empty|differs"),  # below the cells' limit
        ({"voltage_error_v": np.full(12, -8.0)}, "differs"),
        ({"voltage_error_v": np.full(12, 8.0)}, "differs"),
        ({"voltage_error_v": -30.0 * (np.arange(12) < 3)}, "^$"),  # readings of the other motors count
    ):
        pack = Pack(go1, 0.6)
        assert pack.draw(5.0).fault == ""
        vars(pack).update(change)
        assert re.search(fault, pack.draw(5.0).fault), change


def test_motors_that_report_no_current_are_counted_by_torque_and_speed(go1: Robot) -> None:
    pack = Pack(go1, 0.5)
    joints = STILL.copy()
    joints[1:, 0] = 3.0, 20.0  # 60 W at the shaft, and the winding's loss
    pack.monitor.update(0, np.full(12, 35.0), np.full(12, np.nan), joints)
    watts = 60.0 + 0.17 * (20.0 / (0.105 * 6.0)) ** 2
    assert pack.monitor.state.current_a == pytest.approx(watts / pack.battery.nominal_v)


def test_a_low_battery_slows_the_robot_weakens_its_motors_and_lays_it_down(go1: Robot) -> None:
    """The pack has a few hundred joules, and takes 1.2 s from low to empty."""
    battery = Battery(8, 0.25, 0.1, idle_w=60.0)
    robot = with_motors(go1, battery=battery, **MAKERS["ODrive"])
    result: list[tuple[float, float, float]] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        battery = loop.battery
        if loop.walking and battery.allowed < 1.0:
            result.append((battery.charge - body.battery.charge, battery.allowed, loop.status.command[0]))  # type: ignore[union-attr]

    config = DeployConfig(stand_s=0.4, joint_rate_hz=250.0, pose_rate_rad_s=3.0)
    settings = {"config": config, "charge": 0.35, "lie_down": True}
    episode = short_episode(command_source=lambda _: np.array([1.0, 0.0, 0.0]), duration_s=10.0, **settings)
    trace = run_episode(robot, Hold(robot), episode, watch)
    error, allowed, forward = np.array(result).T
    assert np.abs(error).max() < 0.03
    np.testing.assert_allclose(forward[-10:], allowed[-10:], atol=0.05)
    assert forward[-1] < 0.7
    assert "battery" in trace.faults[0]
    assert (trace.final_state, trace.fell, trace.walked_s < 9.0) == ("ESTOP", False, True)
