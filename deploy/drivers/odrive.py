"""ODrive's CANSimple protocol: encoding and decoding of frames.

The joint law runs on the host, and a command frame contains only a torque.

Identifiers have 11 bits, `node << 5 | message`; numbers are little-endian. As of firmware 0.6:

| message | sender | content |
| --- | --- | --- |
| 0x01 heartbeat | axis, every 100 ms | active errors u32, state u8, result u8, trajectory done u8 |
| 0x04 read or write | host | 0 to read or 1 to write, u8; endpoint u16; 0 u8; value to write |
| 0x05 reply to a read | axis | 0 u8; endpoint u16; 0 u8; value |
| 0x07 state | host | u32 (1 idle, 8 closed loop) |
| 0x09 encoder | axis, at its set rate | position f32, velocity f32: turns and turns/s of the rotor |
| 0x0B controller mode | host | control u32 (1 torque, 2 velocity), input u32 (1 passed through) |
| 0x0D input velocity | host | f32, turns/s of the rotor; f32, N m at the rotor on top |
| 0x0E input torque | host | f32, N m at the rotor |
| 0x15 temperature | axis | f32 of its power stage, f32 of the motor |
| 0x17 supply | axis | f32 V, f32 A |
| 0x18 clear errors | host | |
| 0x19 absolute position | host | f32, turns |
| 0x1B velocity gains | host | f32, N m/(turn/s) at the rotor; f32, of the integral |
| 0x1C torques | axis, at its set rate | target f32, estimate f32: N m at the rotor |

Only a read gets a reply: an axis broadcasts its measurements. `encoder_msg_rate_ms` and `torques_msg_rate_ms`
must be set to a joint tick. An axis' watchdog, which is off by default, must be enabled with at most
`timeout_s` of robot.yaml. The watchdog is read before the axis is enabled, if robot.yaml has its
`watchdog_endpoints`: endpoint ids differ between firmwares, and are in each firmware's `flat_endpoints.json`.
The id of `axis0.config.motor.current_soft_max` is `current_endpoint`; this limit is written and read back if
robot.yaml has a current limit.
"""

import math

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.wiring import Wiring

MODEL = "ODrive"
NODES = range(1, 63)  # 63 addresses all nodes

HEARTBEAT, READ, READ_REPLY, STATE, ENCODER, MODE, TORQUE = 0x01, 0x04, 0x05, 0x07, 0x09, 0x0B, 0x0E
VELOCITY, GAINS = 0x0D, 0x1B
TEMPERATURE, SUPPLY, CLEAR, POSITION, TORQUES = 0x15, 0x17, 0x18, 0x19, 0x1C
IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, VELOCITY_CONTROL = (1, 1), (2, 1)  # control mode and input mode

# Codes: index of the lowest set bit, plus one. The host sets these two itself.
NOT_ON, NO_TORQUES = 40, 41
WATCHDOG = 25
ERRORS = {
    1: "that it is initializing",
    2: "a system error",
    3: "a timing error",
    4: "that it lacks an estimate",
    5: "a bad configuration",
    6: "a fault of its gate driver",
    7: "that it lacks an input",
    9: "over-voltage",
    10: "under-voltage",
    11: "over-current of its supply",
    12: "too much current fed back",
    13: "that its current went beyond the limit",
    14: "over-temperature of its motor",
    15: "over-temperature of its power stage",
    16: "that its speed went beyond the limit",
    17: "that its position went beyond the limit",
    WATCHDOG: "a communication timeout, and is disabled",
    26: "that an emergency stop was requested",
    27: "that its encoder slips",
    28: "that its brake resistor is off",
    29: "that its thermistor is disconnected",
    31: "that it is not calibrated",
    NOT_ON: "that it is disabled",
    NO_TORQUES: "no torque (set torques_msg_rate_ms)",
}

TURN = 2 * math.pi

_FLOATS = np.dtype("<f4")
_WORDS = np.dtype("<u4")
_SHORTS = np.dtype("<u2")


def node_lookup(wiring: Wiring) -> np.ndarray:
    """Joint index for a node on a bus, -1 for none: (buses, 64).

    Raises:
        UserError: a motor id that is not a node id.
    """
    for joint, node in zip(wiring.joint_names, wiring.motor_id.tolist(), strict=True):
        if node not in NODES:
            raise UserError(f"joint {joint} has motor id {node}: an ODrive takes {NODES[0]} to {NODES[-1]}")
    lookup = np.full((len(wiring.buses), 64), -1)
    lookup[wiring.channel, wiring.motor_id] = np.arange(len(wiring.motor_id))
    return lookup


def floats(data: np.ndarray) -> np.ndarray:
    """Both numbers in each of k frames (k, 8), as (2, k)."""
    with np.errstate(invalid="ignore"):  # frames of other makers are decoded, too, and may have any bits
        return np.ascontiguousarray(data).view(_FLOATS).T.astype(float)


def error_code(bits: np.ndarray) -> np.ndarray:
    """Codes (k,) from words of error bits (k,): index of the lowest set bit plus one, 0 for none."""
    word = bits.astype(np.int64)
    lowest = word & -word
    return np.where(word == 0, 0, np.log2(np.maximum(lowest, 1)).astype(np.int64) + 1)


def word_of(data: np.ndarray) -> np.ndarray:
    """Bytes 0 to 3 of each of k frames (k, 8) as an unsigned integer, (k,)."""
    return np.ascontiguousarray(data[:, :4]).view(_WORDS)[:, 0]


def endpoint_of(data: np.ndarray) -> np.ndarray:
    """Endpoint of each of k frames (k, 8) that read a value or return one, (k,)."""
    return np.ascontiguousarray(data[:, 1:3]).view(_SHORTS)[:, 0]


def reads(endpoints: np.ndarray) -> np.ndarray:
    """Content of frames that read endpoints (k,), (k, 8)."""
    data = np.zeros((len(endpoints), 8), np.uint8)
    data[:, 1:3] = endpoints.astype(_SHORTS).view(np.uint8).reshape(-1, 2)
    return data


def writes(endpoints: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Content of frames that write floats (k,) to endpoints (k,), (k, 8)."""
    data = reads(endpoints)
    data[:, 0] = 1
    data[:, 4:] = float_bytes(values)[:, :4]
    return data


def float_bytes(first: np.ndarray, second: np.ndarray | float = 0.0) -> np.ndarray:
    """Two numbers for each of k frames, (k,), as bytes (k, 8)."""
    numbers = np.zeros((len(first), 2), _FLOATS)
    numbers[:, 0], numbers[:, 1] = first, second
    return numbers.view(np.uint8)


def word_bytes(count: int, first: int, second: int = 0) -> np.ndarray:
    """Two words, equal in each frame, (count, 8)."""
    return np.tile(np.array([first, second], _WORDS).view(np.uint8), (count, 1))
