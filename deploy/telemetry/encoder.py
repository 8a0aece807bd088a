"""Encodes the records of the control loop as messages."""

import struct
from collections.abc import Callable
from typing import Any

from footfall.deploy.frames import EXTENDED, ID_MASK
from footfall.deploy.log_records import FD_FRAME, FRAME, Kind
from footfall.deploy.telemetry import messages
from footfall.deploy.telemetry.health import STOPPED, Health
from footfall.deploy.telemetry.scene_feeder import SceneFeeder
from footfall.deploy.telemetry.transforms import Transforms

Put = Callable[[str, int, bytes], None]  # called with a topic, a time in ns, and a message's bytes

ARRAYS = {  # records copied unchanged: topic, bytes per number
    Kind.DECISION: ("/policy/command", 8),
    Kind.OBSERVATION: ("/policy/observation", 4),
    Kind.ACTION: ("/policy/action", 4),
    Kind.CONTACTS: ("/contacts", 8),
    Kind.AGES: ("/reading_ages", 8),
    Kind.HEALTH: ("/motor_health", 8),
    Kind.FOOTHOLDS: ("/footholds", 8),
    Kind.TIMING: ("/loop_timing", 8),
}
TEXTS = {Kind.STATE: "/state", Kind.NOTE: "/notes", Kind.CHANGE: "/policy/changes", Kind.ORDER: "/orders"}
FrameTemplate = Callable[[str, bool, int], messages.Template]
FRAMES: dict[Kind, tuple[str, struct.Struct, FrameTemplate]] = {
    Kind.RECEIVED: ("/from_can_bus", FRAME, messages.can_frame),
    Kind.SENT: ("/to_can_bus", FRAME, messages.can_frame),
    Kind.RECEIVED_FD: ("/from_can_bus_fd", FD_FRAME, messages.can_fd_frame),
    Kind.SENT_FD: ("/to_can_bus_fd", FD_FRAME, messages.can_fd_frame),
}
GONE = "the process of the run died before the end of the run"


class Encoder:
    """Encoder for the records of one run."""

    def __init__(self, begin: dict[str, Any], put: Put) -> None:
        """Encoder without records. `begin` is the content of a run's first record.

        `put` is called with each message.
        """
        self._put = put
        self._names = tuple(begin["joints"])
        self._start_ns = begin["start_ns"]
        self._readings, self._inputs = begin["readings"], begin["inputs"]  # number of values of each part
        self._size = 8 * len(self._names)  # bytes of one value per joint
        self._last_ns = self._start_ns
        self._buses = begin["buses"]
        self._transforms = Transforms(begin.get("links", []), put)
        self._scene = SceneFeeder(begin, put)
        self._health = Health(begin["robot"], self._names, put)
        self._consumers = {  # further users of a record's content
            Kind.ODOMETRY: (self._transforms.odometry, self._scene.odometry),
            Kind.CONTACTS: (self._scene.contacts,),
            Kind.FOOTHOLDS: (self._scene.footholds,),
            Kind.AGES: (self._health.ages,),
            Kind.HEALTH: (self._health.motors,),
            Kind.TIMING: (self._health.timing,),
        }
        self.state = "no state"  # state of the supervisor as last logged
        self.complete = False  # the run has ended properly
        if "urdf" in begin:
            put("/robot_description", self._start_ns, messages.text(begin["urdf"]))
        self._transforms.begin(self._start_ns)

    def encode(self, kind: Kind, now_us: int, content: bytes) -> None:
        """Encode a record."""
        time_ns = self._last_ns = self._start_ns + now_us * 1000
        for consume in self._consumers.get(kind, ()):
            consume(content)
        if kind in ARRAYS:
            topic, size = ARRAYS[kind]
            self._array(topic, time_ns, content, size)
        elif kind in TEXTS:
            self._text(kind, time_ns, content.decode())
        elif kind is Kind.APPLIED:  # no event: until a setting has its new value, it changes in each step
            self._put("/policy/applied", time_ns, messages.text(content.decode()))
        elif kind in FRAMES:
            self._frames(*FRAMES[kind], content)
        elif kind is Kind.READINGS:
            self._sensed(time_ns, _parts(content, self._readings))
        elif kind is Kind.COMMANDED:
            position, velocity, torque = (self._rows(content, row) for row in (0, 1, 4))
            joints = messages.joint_state(self._names)
            self._put("/joint_commands", time_ns, joints.fill(time_ns, position, velocity, torque))
            self._array("/joint_gains", time_ns, content[2 * self._size : 4 * self._size])
        elif kind is Kind.INPUTS:
            command = _parts(content, self._inputs)["command"]
            self._scene.command = command
            self._put("/cmd_vel", time_ns, messages.twist().fill(time_ns, command[:16], command[16:]))
            self._array("/policy/inputs", time_ns, content)
        elif kind is Kind.ODOMETRY:
            self._put("/odom", time_ns, messages.odometry().fill(time_ns, content))
        elif kind is Kind.BATTERY:
            numbers = (struct.pack("<f", each) for each in struct.unpack("<3d", content))
            self._put("/battery_state", time_ns, messages.battery().fill(time_ns, *numbers))
        elif kind is Kind.END:
            self.complete = True

    def end(self) -> None:
        """Add a note if the run's process died before the end of the run."""
        if not self.complete:
            self._text(Kind.NOTE, self._last_ns, GONE)

    def _text(self, kind: Kind, time_ns: int, text: str) -> None:
        """A change of state or policy, an order or a note; also as an event with a severity."""
        level = messages.WARN if kind is Kind.NOTE else messages.INFO
        if kind is Kind.STATE:
            self.state = self._health.state = text
            mode, _, fault = text.partition(": ")
            level = messages.ERROR if mode in STOPPED or fault else level
        self._put(TEXTS[kind], time_ns, messages.text(text))
        self._put("/rosout", time_ns, messages.event(time_ns, level, text))

    def _frames(
        self,
        topic: str,
        layout: struct.Struct,
        template_of: FrameTemplate,
        content: bytes,
    ) -> None:
        for at_us, bus, length, identifier, data in layout.iter_unpack(content):
            time_ns = self._start_ns + at_us * 1000
            template = template_of(self._buses[bus], identifier >= EXTENDED, length)
            number = (identifier & ID_MASK).to_bytes(4, "little")
            self._put(topic, time_ns, template.fill(time_ns, number, data))

    def _sensed(self, time_ns: int, part: dict[str, bytes]) -> None:
        joints = messages.joint_state(self._names)
        state = joints.fill(time_ns, part["joint_position"], part["joint_velocity"], part["joint_torque"])
        self._put("/joint_states", time_ns, state)
        w, xyz = part["quaternion"][:8], part["quaternion"][8:]
        imu = messages.imu().fill(time_ns, xyz, w, part["gyro"], part["acceleration"])
        self._put("/imu/data", time_ns, imu)
        if part["foot_force"]:
            self._array("/foot_forces", time_ns, part["foot_force"])
        self._transforms.readings(time_ns, part["joint_position"], part["quaternion"])
        self._scene.readings(time_ns, part)
        self._health.publish(time_ns)

    def _rows(self, content: bytes, row: int) -> bytes:
        return content[row * self._size : (row + 1) * self._size]

    def _array(self, topic: str, time_ns: int, content: bytes, size: int = 8) -> None:
        label = topic.rpartition("/")[2]
        self._put(topic, time_ns, messages.multi_array(label, len(content) // size, size).fill(0, content))


def _parts(content: bytes, sizes: dict[str, int]) -> dict[str, bytes]:
    """Split a record of float64 into its parts by name, given the number of values of each part in order."""
    parts, start = {}, 0
    for name, size in sizes.items():
        parts[name] = content[start : start + 8 * size]
        start += 8 * size
    return parts
