"""TensorBoard's event format, from tensorboardX.

tensorboardX imports torch where it finds it: seconds of every start, for nothing that is used here.
"""

import sys
from typing import Any

_MODULES: dict[str, Any] = sys.modules
_hide = "torch" not in _MODULES
if _hide:
    _MODULES["torch"] = None
try:
    from tensorboardX.proto.event_pb2 import Event, SessionLog
    from tensorboardX.proto.summary_pb2 import Summary
    from tensorboardX.record_writer import masked_crc32c
finally:
    if _hide:
        del _MODULES["torch"]

__all__ = ["Event", "SessionLog", "Summary", "masked_crc32c"]
