"""CAN frames of a log as text, in the format of candump."""

from pathlib import Path
from typing import TextIO

from footfall.common.errors import UserError
from footfall.deploy.log_file import read_log

RECEIVED, SENT = ("/from_can_bus", "/from_can_bus_fd"), ("/to_can_bus", "/to_can_bus_fd")


def write_candump(path: Path, out: TextIO) -> int:
    """Write a log's CAN frames in the order of their times; returns their number.

    Raises:
        UserError: the log cannot be read or has no frames.
    """
    from can import CanutilsLogWriter, Message

    entries = sorted(read_log(path, (*RECEIVED, *SENT)).entries, key=lambda entry: entry.time_ns)
    if not entries:
        raise UserError(f"{path} has no CAN frames: record the run with --log-frames")
    writer = CanutilsLogWriter(out)
    for topic, time_ns, frame in entries:
        fd = topic.endswith("_fd")
        length = frame.len if fd else frame.dlc
        writer.on_message_received(
            Message(
                timestamp=time_ns * 1e-9,
                arbitration_id=frame.id,
                is_extended_id=frame.is_extended,
                is_fd=fd,
                bitrate_switch=fd,
                dlc=length,
                data=bytes(frame.data[:length]),
                channel=frame.header.frame_id,
                is_rx=topic in RECEIVED,
            )
        )
    return len(entries)
