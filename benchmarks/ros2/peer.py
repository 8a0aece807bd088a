"""A node of real rclpy that stores the messages it receives, for `looks.py`; independent of footfall."""

import json
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor


class Peer:
    """A node that stores the messages it receives, with their times of arrival."""

    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node("peer")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.received: dict[str, list[tuple[float, Any]]] = {}

    def listen(self, topic: str, kind: Any, qos: Any = 10) -> None:
        kept = self.received.setdefault(topic, [])
        self.node.create_subscription(kind, topic, lambda m: kept.append((time.monotonic(), m)), qos)

    def spin(self, seconds: float) -> None:
        self.until(lambda: False, seconds)

    def until(self, done: Callable[[], Any], timeout_s: float) -> Any:
        """The first true value that a function returns, or its last value at the timeout."""
        end_s = time.monotonic() + timeout_s
        while not (found := done()) and time.monotonic() < end_s:
            self.executor.spin_once(timeout_sec=0.02)
        return found

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Response of a service; None without a response."""
        client = self.node.create_client(kind, name)
        try:
            if not self.until(client.service_is_ready, 5.0):
                return None
            future = client.call_async(request)
            self.until(future.done, 5.0)
            return future.result() if future.done() else None
        finally:
            self.node.destroy_client(client)

    def latest(self, topic: str) -> Any:
        return self.received[topic][-1][1] if self.received[topic] else None

    def drive(self, publisher: Any, message: Any, seconds: float) -> None:
        """Publish a velocity 20 times a second."""
        for _ in range(round(20 * seconds)):
            publisher.publish(message)
            self.spin(0.05)


def report(name: str, passed: Any, seen: Any) -> None:
    """Print a finding in JSON: name, whether the check passed, and the observed value."""
    print(json.dumps({"check": name, "ok": bool(passed), "seen": seen}), flush=True)
