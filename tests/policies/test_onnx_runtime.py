"""ONNX Runtime in a program of its own."""

import os
import subprocess
import sys
from pathlib import Path

from footfall.policies.registry import ZOO


def test_a_policy_leaves_no_telemetry_in_the_users_home(tmp_path: Path) -> None:
    """The library's telemetry keeps an identifier and a database there."""
    silent = ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY", "XDG_CACHE_HOME")  # disable or move it
    environment = {name: value for name, value in os.environ.items() if name not in silent}
    program = "import sys; from pathlib import Path; from footfall.policies.learned import open_network; "
    program += "open_network(Path(sys.argv[1]))"
    policy = ZOO / "go1-flat" / "policy.onnx"
    command = [sys.executable, "-c", program, str(policy)]
    subprocess.run(command, env=environment | {"HOME": str(tmp_path)}, check=True)
    assert list(tmp_path.rglob("*")) == []
