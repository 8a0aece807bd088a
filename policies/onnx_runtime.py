"""ONNX Runtime without telemetry.

Official builds send telemetry since 1.29 unless ORT_DISABLE_TELEMETRY is set: they write a database in the
user's cache folder and start a thread beside the control loop. A value that the user has set is kept.
"""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # read when the library is loaded

import onnxruntime

__all__ = ["onnxruntime"]
