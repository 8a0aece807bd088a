"""A robot's buses, and bus and id of each motor."""

from dataclasses import replace

from footfall.deploy.wiring import wiring_of
from footfall.robots.description import Robot


def test_buses_are_in_the_order_of_the_joints_and_the_imus_comes_last(go1: Robot) -> None:
    """The order does not depend on the buses' names or on the motors' ids."""
    called = {"can0": "z", "can1": "b", "can2": "y", "can3": "a"}
    joints = tuple(replace(each, bus=called[each.bus], id=20 + each.id) for each in go1.description.joints)
    description = replace(go1.description, joints=joints[::-1], imu_bus="imu")
    wiring = wiring_of(replace(go1, description=description))
    assert wiring.buses == ("a", "y", "b", "z", "imu")
    assert wiring.imu_channel == 4
    assert wiring.channel.tolist() == [0] * 3 + [1] * 3 + [2] * 3 + [3] * 3
    assert wiring.motor_id.tolist() == [23, 22, 21] * 4
    shared = wiring_of(replace(go1, description=replace(description, imu_bus="y")))
    assert (shared.buses, shared.imu_channel) == (("a", "y", "b", "z"), 1)
