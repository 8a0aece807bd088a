"""`footfall export`."""

from pathlib import Path

from footfall.common.outputs import check_outputs
from footfall.options import OptionalPath
from footfall.train.entry import learning_libraries


def export(run: Path, /, *, out: OptionalPath = None) -> None:
    """Write a run's last checkpoint as ONNX, verified against the trainer's own network.

    Parameters
    ----------
    run
        Run folder of footfall train.
    out
        File to write (default: RUN/policy.onnx).
    """
    check_outputs(out)
    with learning_libraries():
        from footfall.train import api
    path, difference = api.export_run(run, out)
    print(f"wrote {path}; its actions differ from the trained network's by at most {difference:.1e}")
