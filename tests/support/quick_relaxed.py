"""Settings of a real-time loop that tolerate a busy machine and shorten standing up and lying down."""

import json
from dataclasses import replace
from pathlib import Path

from relaxed_limits import RELAXED

from footfall.common.config import unstructure

QUICK = replace(RELAXED, stand_s=0.3, stop_s=0.1, pose_rate_rad_s=8.0)


def write_quick(folder: Path) -> str:
    """Write these settings to a file; returns its path."""
    path = folder / "relaxed.yaml"
    path.write_text(json.dumps(unstructure(QUICK)))
    return str(path)
