"""Checks everything that a run offers in ROS 2, with real rclpy, and steers it: `python looks.py TABLE.json`.

`check.py` runs it with a Python that has rclpy. It does not import footfall.
"""

import json
import math
import signal
import subprocess
import sys
import time
from importlib import import_module

from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Path
from observing import look_at_graph, look_at_values, stamp_s, state
from peer import Peer, report
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters
from rclpy.action import ActionClient
from std_msgs.msg import Empty, String
from std_srvs.srv import SetBool, Trigger

PUBLISHER = """
import sys, time, rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node = rclpy.create_node("publisher")
publisher = node.create_publisher(Twist, "/cmd_vel", 10)
message = Twist()
message.linear.x = 0.3
while True:
    publisher.publish(message)
    time.sleep(0.05)
"""


def velocity(forward: float, yaw_rate: float = 0.0) -> Twist:
    message = Twist()
    message.linear.x, message.angular.z = forward, yaw_rate
    return message


def steer(peer: Peer) -> None:
    """Test valid and invalid velocities, the other message type, and a killed publisher."""
    publisher = peer.node.create_publisher(Twist, "/cmd_vel", 10)
    peer.until(lambda: publisher.get_subscription_count() > 0, 10.0)
    before = peer.latest("/odom")
    peer.drive(publisher, velocity(0.3), 4.0)
    after = peer.latest("/odom")
    old, new = before.pose.pose.position, after.pose.pose.position
    distance_m, duration_s = math.hypot(new.x - old.x, new.y - old.y), stamp_s(after) - stamp_s(before)
    report(
        "cmd_vel of 0.3 m/s: mean speed, m/s (a hexapod is slower)",
        0.05 < distance_m / duration_s < 0.4,
        round(distance_m / duration_s, 3),
    )
    speeds = [m.twist.twist.linear.x for at_s, m in peer.received["/odom"] if at_s > time.monotonic() - 2.0]
    report(
        "odometry's velocity, m/s",
        0.05 < sum(speeds) / len(speeds) < 0.45,
        round(sum(speeds) / len(speeds), 3),
    )
    peer.drive(publisher, velocity(math.nan), 0.5)
    lines = lambda: [m.msg for _, m in peer.received["/rosout"] if "finite" in m.msg]  # noqa: E731
    peer.until(lines, 10.0)
    report("NaN is refused in /rosout", lines(), lines()[:1])
    peer.node.destroy_publisher(publisher)
    killed_publisher(peer)


def killed_publisher(peer: Peer) -> None:
    process = subprocess.Popen([sys.executable, "-c", PUBLISHER])
    commands = peer.received["/footfall/command"]
    try:
        peer.until(lambda: commands and commands[-1][1].twist.linear.x > 0.25, 15.0)
    finally:
        process.send_signal(signal.SIGKILL)
    killed_s = time.time()
    process.wait()

    def zero_s() -> float:
        """Time stamp of the run's first zero command after the kill, without delays of this process."""
        zeros = (stamp_s(m) for _, m in commands if m.twist.linear.x == 0.0)
        return next((at_s for at_s in zeros if at_s > killed_s), 0.0)

    peer.until(zero_s, 5.0)
    after_s = zero_s() - killed_s
    report("killed publisher: command is zero after, s", 0.0 < after_s < 0.5, round(after_s, 3))


def other_type(peer: Peer) -> None:
    """Publish the other message type from another process: one node cannot have two types on a topic."""
    code = PUBLISHER.replace("Twist\n", "TwistStamped\n").replace("(Twist,", "(TwistStamped,")
    code = code.replace("Twist()", "TwistStamped()").replace("message.linear", "message.twist.linear")
    process = subprocess.Popen([sys.executable, "-c", code])
    try:
        lines = lambda: [m.msg for _, m in peer.received["/rosout"] if "TwistStamped" in m.msg]  # noqa: E731
        peer.until(lines, 20.0)
        report("the other type of cmd_vel is named", lines(), lines()[:1])
    finally:
        process.kill()
        process.wait()


def ask(peer: Peer, expected: list[list[str]]) -> None:
    """Test services and parameters."""
    services = dict(peer.node.get_service_names_and_types())
    missing = [name for name, kind in expected if kind not in services.get(name, [])]
    report("services", not missing, missing or f"{len(expected)} services")
    for name in ("stand", "walk"):
        answer = peer.call(Trigger, f"/footfall/{name}", Trigger.Request())
        report(f"service {name}", answer is not None and answer.success, str(answer))
    answer = peer.call(SetBool, "/footfall/wave", SetBool.Request(data=True))
    has_wave = "/footfall/gait/wave" in services
    report("service wave", answer is not None and answer.success == has_wave, str(answer))
    listed = peer.call(ListParameters, "/footfall/list_parameters", ListParameters.Request())
    names = [] if listed is None else list(listed.result.names)
    report("parameters", {"gait", "policy", "step_height_m"} <= set(names), names)
    if "step_height_m" not in names:
        return
    request = DescribeParameters.Request(names=["step_height_m"])
    described = peer.call(DescribeParameters, "/footfall/describe_parameters", request)
    ranges = described.descriptors[0].floating_point_range if described else []
    report("a parameter's range", len(ranges) == 1, str(ranges))
    span = ranges[0]
    for value, accepted in ((0.5 * (span.from_value + span.to_value), True), (span.to_value + 1.0, False)):
        parameter = Parameter(name="step_height_m", value=ParameterValue(type=3, double_value=value))
        answer = peer.call(
            SetParameters, "/footfall/set_parameters", SetParameters.Request(parameters=[parameter])
        )
        result = answer.results[0] if answer else None
        report(f"step_height_m to {value:.3f}", result and result.successful == accepted, str(result))


def follow(peer: Peer) -> None:
    """Test the action with a goal half a metre ahead of the robot."""
    kind = import_module("nav2_msgs.action").FollowPath
    client = ActionClient(peer.node, kind, "/footfall/follow_path")
    if not peer.until(client.server_is_ready, 10.0):
        report("action", False, "there is no server")
        return
    pose = peer.latest("/odom").pose.pose
    yaw = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
    path = Path()
    path.header.frame_id = "odom"
    for distance_m in (0.1, 0.2, 0.3, 0.4, 0.5):
        point = PoseStamped()
        point.pose.position.x = pose.position.x + distance_m * math.cos(yaw)
        point.pose.position.y = pose.position.y + distance_m * math.sin(yaw)
        point.pose.orientation = pose.orientation
        path.poses.append(point)
    feedback: list[float] = []
    sending = client.send_goal_async(
        kind.Goal(path=path), feedback_callback=lambda f: feedback.append(f.feedback.distance_to_goal)
    )
    peer.until(sending.done, 5.0)
    handle = sending.result()
    getting = handle.get_result_async()
    peer.until(getting.done, 30.0)
    status = getting.result().status if getting.done() else None
    peer.spin(2.0)
    end, goal = peer.latest("/odom").pose.pose.position, path.poses[-1].pose.position
    error_m = math.hypot(end.x - goal.x, end.y - goal.y)
    decreases = len(feedback) > 3 and feedback[-1] < feedback[0]
    report("action follow_path", status == 4 and error_m < 0.15, [status, f"error {error_m:.3f} m"])
    report("its feedback", decreases, [round(each, 2) for each in feedback[:: max(1, len(feedback) // 5)]])
    far_goal = kind.Goal(path=path)
    far_goal.path.poses[-1].pose.position.x += 3.0
    sending = client.send_goal_async(far_goal)
    peer.until(sending.done, 5.0)
    if not sending.done() or not sending.result().accepted:
        report("action takes another goal", False, "")
        return
    cancelling = sending.result().cancel_goal_async()
    getting = sending.result().get_result_async()
    peer.until(lambda: cancelling.done() and getting.done(), 10.0)
    report(
        "action is cancelled",
        getting.done() and getting.result().status == 5,
        getting.done() and getting.result().status,
    )


def ask_by_topics(peer: Peer) -> None:
    """Test requests by topics, the only way without rclpy."""
    behaviour = peer.node.create_publisher(String, "/footfall/behaviour", 10)
    policy = peer.node.create_publisher(String, "/footfall/policy", 10)
    peer.until(lambda: behaviour.get_subscription_count() and policy.get_subscription_count(), 10.0)
    policy.publish(String(data="nobody"))
    lines = lambda: [m.data for _, m in peer.received["/footfall/notes"] if "nobody" in m.data]  # noqa: E731
    peer.until(lines, 20.0)
    report("an unknown policy is refused in the notes", lines(), lines()[:1])


def stop(peer: Peer, by_service: bool) -> None:
    """Stop the run, as the last test: the robot lies down."""
    if by_service:
        answer = peer.call(Trigger, "/footfall/stop", Trigger.Request())
        report("service stop answers", answer and answer.success, str(answer))
    else:
        publisher = peer.node.create_publisher(Empty, "/footfall/stop", 10)
        peer.until(publisher.get_subscription_count, 10.0)
        publisher.publish(Empty())
    ended = peer.until(lambda: "WALKING" not in state(peer), 5.0)
    report("stop ends the walk", ended, state(peer))


def main() -> None:
    with open(sys.argv[1], encoding="utf-8") as file:
        table = json.load(file)
    peer, by_rclpy = Peer(), bool(table["services"])
    look_at_graph(peer, table)
    look_at_values(peer)
    steer(peer)
    if by_rclpy:
        ask(peer, table["services"])
        follow(peer)
    else:
        ask_by_topics(peer)
    other_type(peer)
    stop(peer, by_rclpy)


if __name__ == "__main__":
    main()
