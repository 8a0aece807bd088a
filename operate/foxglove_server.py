"""The process that serves a run's feed to Foxglove and similar viewers: `python -m … FEED HOST PORT`.

Viewers get the same bytes as the log. They cannot send anything: the server accepts no messages from clients,
and has no services or parameters. It ends with the feed or when its standard input is closed.
"""

import logging
import os
import sys
import threading
import time
from typing import Any

import foxglove
from foxglove import Channel, Schema
from foxglove.websocket import ServerListener

from footfall.deploy.telemetry.feed_reader import FeedMessage, FeedReader
from footfall.operate.foxglove import READY

RETRY_S = 0.1
ENCODING = "cdr"


class Publisher(ServerListener):
    """Publishes messages, and repeats the last one of a latched topic for each new subscriber."""

    def __init__(self) -> None:
        self._channels: dict[str, Channel] = {}
        self._latched: dict[str, FeedMessage] = {}
        self._lock = threading.Lock()

    def pass_on(self, message: FeedMessage) -> None:
        """Publish a message."""
        topic = message.channel.topic
        with self._lock:
            channel = self._channels.get(topic)
            if channel is None:
                schema = Schema(
                    name=message.channel.kind, encoding="ros2msg", data=message.channel.definition.encode()
                )
                channel = self._channels[topic] = Channel(topic, message_encoding=ENCODING, schema=schema)
            if message.channel.latched:
                self._latched[topic] = message
            channel.log(message.data, log_time=message.time_ns)

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Called when a viewer subscribes to a topic."""
        with self._lock:
            message = self._latched.get(channel.topic)
            if message is not None:
                self._channels[channel.topic].log(message.data, log_time=message.time_ns)


def end_with_input() -> None:
    """End the process when its parent has ended."""
    while os.read(sys.stdin.fileno(), 4096):  # unbuffered: the buffer's lock would interfere with the exit
        pass
    os._exit(0)


def main() -> int:
    feed, host, port = sys.argv[1], sys.argv[2], int(sys.argv[3])
    logging.getLogger("foxglove").setLevel(logging.ERROR)
    publisher = Publisher()
    try:
        server = foxglove.start_server(
            name="footfall", host=host, port=port, capabilities=[], services=[], server_listener=publisher
        )
    except Exception as error:  # the library has several error types
        print(" ".join(str(error).split()), flush=True)
        return 1
    print(READY, flush=True)
    threading.Thread(target=end_with_input, daemon=True).start()
    while True:
        try:
            reader = FeedReader(feed)
            break
        except OSError:
            time.sleep(RETRY_S)
    for message in reader:
        publisher.pass_on(message)
    server.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
