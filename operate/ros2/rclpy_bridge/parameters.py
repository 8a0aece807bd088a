"""Parameters of the node: live settings, gait and policy of the run."""

from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from footfall.operate.ros2.link import Link

CHOICES = ("gait", "policy")  # texts; empty until set here


class Parameters:
    """Declares a parameter for each setting; changing a parameter sends a request to the run."""

    def __init__(self, node: Node, link: Link) -> None:
        self._node, self._link = node, link
        self._declared: dict[str, tuple[float, ...]] = {}
        self._declaring = True
        for name in CHOICES:
            node.declare_parameter(name, "", ParameterDescriptor(description=f"{name} to change to"))
        node.add_on_set_parameters_callback(self._changed)
        self._declaring = False

    def offer(self, settings: Mapping[str, Sequence[float]]) -> None:
        """Declare these settings: minimum, maximum and default value by name."""
        self._declaring = True
        for name in [n for n, span in self._declared.items() if tuple(settings.get(n, ())) != span]:
            self._node.undeclare_parameter(name)
            del self._declared[name]
        for name in [n for n in settings if n not in self._declared]:
            lowest, highest, default = settings[name]
            span = FloatingPointRange(from_value=lowest, to_value=highest, step=0.0)
            about = ParameterDescriptor(description="live setting", floating_point_range=[span])
            try:
                value = self._node.declare_parameter(name, default, about).value
            except InvalidParameterValueException as error:  # from a value set when the node was started
                self._node.get_logger().error(str(error))
                value = self._node.declare_parameter(name, default, about, ignore_override=True).value
            self._declared[name] = lowest, highest, default
            if value != default:
                self._link.post(settings={name: value})
        self._declaring = False

    def _changed(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        if self._declaring:
            return SetParametersResult(successful=True)
        request: dict[str, Any] = {p.name: p.value for p in parameters if p.name in CHOICES and p.value}
        if settings := {p.name: p.value for p in parameters if p.name in self._declared}:
            request["settings"] = settings
        refused = self._link.request(**request) if request else ""
        return SetParametersResult(successful=not refused, reason=refused)
