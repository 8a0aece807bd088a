"""ONNX Runtime without telemetry, which its official builds have sent since 1.29 unless a variable is set.

They also write a database in the user's cache folder and start a thread beside the control loop. A user's own
value of the variable is kept.
"""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # read when the library is loaded

import onnxruntime

__all__ = ["onnxruntime"]
