"""The result of a diagnosis."""

from dataclasses import dataclass
from pathlib import Path

from footfall.common.versions import versions
from footfall.train.runs.failure import SOURCE, Failure
from footfall.train.runs.provenance import PACKAGES, source_revision


@dataclass(frozen=True)
class Diagnosis:
    """What the replay of a failed training found."""

    failure: Failure
    # Changes of device and versions since the failure; with any, the replay is approximate.
    differences: list[str]
    reason: str | None  # why the iteration failed in the replay; None: it did not
    finding: str  # the first value that was not finite, and where
    saved: Path | None  # file with the failing environment before its failing step, if an environment failed


def differences(failure: Failure, device: str, devices: int) -> list[str]:
    """Changes of devices and packages since a failed training, each as 'NAME OLD, now NEW'."""
    then = {"device": failure.device, "device count": str(failure.devices or devices)} | failure.versions
    now = {"device": device, "device count": str(devices), SOURCE: source_revision()} | versions(PACKAGES)
    return [f"{name} {old}, now {now[name]}" for name, old in then.items() if now.get(name, old) != old]
