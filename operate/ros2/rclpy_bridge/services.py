"""ROS 2 services that send requests to the run."""

from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node

from footfall.operate.ros2.link import Link
from footfall.operate.ros2.rclpy_bridge.publishing import message_type
from footfall.operate.ros2.table import (
    CHOICES,
    SERVICES,
    TRIGGER,
    WAVE,
    WAVE_GAIT,
    in_name,
)


class Services:
    """The services of `table.py`, and one per gait and policy of the run."""

    def __init__(self, node: Node, link: Link) -> None:
        self._node, self._link = node, link
        self._gaits: Sequence[str] = ()
        self._chosen: dict[str, Any] = {}  # services by name
        for each in SERVICES:
            self._trigger(each.name, each.request)
        node.create_service(message_type(WAVE.kind), WAVE.name, self._wave)

    def offer(self, gaits: Sequence[str], policies: Sequence[str]) -> None:
        """Provide services for these gaits and policies from now on."""
        self._gaits = gaits
        offered = {
            service.name.format(in_name(name)): {key: name}
            for (key, service), names in zip(CHOICES.items(), (gaits, policies), strict=True)
            for name in names
        }
        for name in self._chosen.keys() - offered.keys():
            self._node.destroy_service(self._chosen.pop(name))
        for name in offered.keys() - self._chosen.keys():
            self._chosen[name] = self._trigger(name, offered[name])

    def _trigger(self, name: str, request: Mapping[str, Any]) -> Any:
        def answer(_: Any, response: Any) -> Any:
            return self._ask(response, request)

        return self._node.create_service(message_type(TRIGGER), name, answer)

    def _wave(self, switch: Any, response: Any) -> Any:
        others = [gait for gait in self._gaits if gait != WAVE_GAIT]
        if not switch.data and not others:
            response.success, response.message = False, "the current policy has no other gait"
            return response
        return self._ask(response, {"gait": WAVE_GAIT if switch.data else others[0]})

    def _ask(self, response: Any, request: Mapping[str, Any]) -> Any:
        refused = self._link.request(**request)
        response.success, response.message = not refused, refused
        return response
