"""Write the robot's current digest into a policy: `python -m footfall.train.restamp FOLDER`.

For one case only: the computation of the digest has changed (robots/digest.py), the robot has not. After any
other change the policy must be trained anew. The rest of the contract must still fit. The network stays as it
is; the folder's run.yaml is restamped too. Record the restamping in the policy's card.
"""

import sys
from dataclasses import replace
from pathlib import Path

import onnx
from onnx import helper

from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.policies.contract import CONTRACT_KEY, Contract
from footfall.robots.description import load_robot


def restamp(folder: Path) -> tuple[str, str]:
    """Write the current digest into a folder's policy.onnx and run.yaml; returns the old and the new digest.

    Raises:
        UserError: there is no policy, or it differs from the robot in more than the digest.
    """
    path = folder / "policy.onnx"
    if not path.is_file():
        raise UserError(f"no policy file at {path}")
    model = onnx.load(path)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    old = Contract.from_json(metadata.get(CONTRACT_KEY, ""), str(path))
    robot = load_robot(old.robot)
    new = replace(old, digest=robot.digest)
    differences = new.mismatches(robot)
    if differences:
        raise UserError(f"{path} does not fit robot '{robot.name}': {'; '.join(differences)}")
    helper.set_model_props(model, metadata | {CONTRACT_KEY: new.to_json()})
    write_atomically(path, model.SerializeToString())
    run = folder / "run.yaml"
    if run.is_file():
        write_atomically(run, run.read_text().replace(old.digest, new.digest).encode())
    return old.digest, new.digest


if __name__ == "__main__":
    print("{} is now {}".format(*restamp(Path(sys.argv[1]))))
