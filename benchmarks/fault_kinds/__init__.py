"""The kinds of faults: one row each, with the expected response."""

from fault_kinds.battery import BATTERY
from fault_kinds.body import BODY
from fault_kinds.getting_up import GETTING_UP
from fault_kinds.imu import IMU
from fault_kinds.intermittent import INTERMITTENT
from fault_kinds.operator import OPERATOR
from fault_kinds.policy import POLICY
from fault_kinds.replies import REPLIES
from fault_kinds.slow import SLOW
from fault_kinds.start import START
from fault_kinds.wiring import WIRING

GROUPS = {
    "IMU": IMU,
    "motors' replies": REPLIES,
    "motors and body": BODY,
    "battery": BATTERY,
    "slow or intermittent": (*INTERMITTENT, *SLOW),
    "policy and program": POLICY,
    "operator": OPERATOR,
    "at the start": START,
    "wiring": WIRING,
    "getting up": GETTING_UP,
}
KINDS = tuple(kind._replace(group=group) for group, kinds in GROUPS.items() for kind in kinds)
