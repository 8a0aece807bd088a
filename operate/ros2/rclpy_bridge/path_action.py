"""The action for walking along a path: `nav2_msgs/action/FollowPath`, if that package is installed."""

import math
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.task import Future

from footfall.common.rotations import yaw_of
from footfall.operate.ros2.link import Link
from footfall.operate.ros2.rclpy_bridge.publishing import message_type
from footfall.operate.ros2.table import FOLLOW_PATH, ODOM

SPACING_M = 0.05
MAX_OUTDATED = 5  # consecutive statuses that may be older than the goal


class PathAction:
    """Provides the action; one path at a time, and a newer one replaces it."""

    def __init__(self, node: Node, link: Link) -> None:
        """Start the action server.

        Raises:
            ImportError: `nav2_msgs` is not installed.
        """
        self._node, self._link = node, link
        self._type = message_type(FOLLOW_PATH.kind)
        self._status: Future = Future()
        self._goals = 0
        self._server = ActionServer(
            node,
            self._type,
            FOLLOW_PATH.name,
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def update(self, status: dict[str, Any]) -> None:
        """Process a status of the run."""
        waiting, self._status = self._status, Future()
        waiting.set_result(status)

    def _accept(self, goal: Any) -> GoalResponse:
        """Accept paths in `odom` only: there is no map."""
        frame = goal.path.header.frame_id
        if frame not in ("", ODOM) or not goal.path.poses:
            self._node.get_logger().error(f"a path has at least one pose, in frame {ODOM}, not '{frame}'")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        result = self._type.Result()
        self._goals += 1
        number = self._goals
        poses = [each.pose for each in handle.request.path.poses]
        points = thinned([[pose.position.x, pose.position.y] for pose in poses])
        refused = self._link.request(path=points, yaw_rad=_yaw(poses[-1].orientation), goal=number)
        if refused:
            return self._aborted(handle, result, refused)
        outdated = 0  # consecutive statuses without a path or with another one
        while True:
            status = await self._status
            if number != self._goals:
                return self._aborted(handle, result, "another path replaced it")
            if handle.is_cancel_requested:
                self._link.request(path=None)
                handle.canceled()
                return result
            path = status["path"]
            if path is None or path["goal"] != number:
                outdated += 1
                if outdated > MAX_OUTDATED:
                    return self._aborted(handle, result, "the path was replaced by another request")
                continue
            outdated = 0
            if path["outcome"]:
                break
            if math.isfinite(path["distance_m"]):  # the walk has started
                feedback = self._type.Feedback()
                feedback.distance_to_goal = float(path["distance_m"])
                feedback.speed = math.hypot(*status["velocity"][:2])
                handle.publish_feedback(feedback)
        if path["outcome"] != "done":
            return self._aborted(handle, result, path["outcome"])
        handle.succeed()
        return result

    def _aborted(self, handle: Any, result: Any, why: str) -> Any:
        self._node.get_logger().error(f"path: {why}")
        handle.abort()
        result.error_code = self._type.Result.UNKNOWN  # its value differs between releases of Nav2
        if hasattr(result, "error_msg"):  # only in some releases
            result.error_msg = why
        return result


def thinned(points: list[list[float]]) -> list[list[float]]:
    """Points with a minimum spacing; the last one is kept."""
    kept = points[:1]
    for point in points[1:]:
        if not math.dist(kept[-1], point) < SPACING_M:  # NaN is kept here, and refused by the run
            kept.append(point)
    return [*kept[:-1], points[-1]] if len(kept) > 1 else points[-1:]


def _yaw(q: Any) -> float | None:
    """Yaw of a quaternion; None for zeros, which mean no heading."""
    if not any((q.w, q.x, q.y, q.z)):
        return None
    return yaw_of([q.w, q.x, q.y, q.z])
