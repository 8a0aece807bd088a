"""The generated physics on processors that this machine does not have, beside MuJoCo C.

    python benchmarks/other_processors.py go1 hexapod g1

Compiles the program for each processor of `PROCESSORS`, links it with a few lines of C, and runs it on
the random states of `physics_parity.py`. Programs for Arm run in QEMU. Prints the relative error of the
velocities after one physics step: the maximum in double precision, the 99th percentile in single
precision. Needs gcc, gcc-aarch64-linux-gnu and qemu-user.
"""

import argparse
import subprocess
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import llvmlite.binding as llvm
import numpy as np
import physics_parity

from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.llvm import OPTIMISATION, lanes_of, module_text
from footfall.envs.physics.generated.substep import Substep
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset


class Processor(NamedTuple):
    """A processor to compile for, and the commands that link for it and run there."""

    triple: str
    cpu: str
    features: dict[str, bool]  # those that decide the number of lanes
    linker: str
    runner: tuple[str, ...] = ()


ARM = "aarch64-linux-gnu"
PROCESSORS = {
    "x86-64 without AVX": Processor("x86_64-linux-gnu", "x86-64", {}, "gcc"),
    "x86-64 with AVX": Processor("x86_64-linux-gnu", "sandybridge", {"avx": True}, "gcc"),
    "Arm with Neon": Processor(ARM, "cortex-a72", {}, f"{ARM}-gcc", ("qemu-aarch64", "-L", f"/usr/{ARM}")),
}
MAIN = """
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
void control_step(@POINTERS@, int64_t first, int64_t last);
int main(int count, char **names) {
  const long bytes[] = {@BYTES@}; void *array[@COUNT@];
  FILE *file = fopen(names[1], "r");
  for (int k = 0; k < @COUNT@; k++) {
    array[k] = aligned_alloc(64, (bytes[k] + 63) / 64 * 64);
    if (k < @INPUTS@ && fread(array[k], 1, bytes[k], file) != bytes[k]) return 1;
  }
  control_step(@ARRAYS@, 0, atol(names[3]));
  file = fopen(names[2], "w");
  for (int k = @INPUTS@; k < @COUNT@; k++) fwrite(array[k], 1, bytes[k], file);
  return fclose(file);
}
"""


class Elsewhere:
    """As `footfall.envs.physics.generated.llvm.Program`, run in a process of another processor."""

    def __init__(self, processor: Processor, folder: Path, substep: Substep, steps: int, dtype: Any) -> None:
        self._processor, self._folder = processor, folder
        self.inputs, self.outputs = arguments(substep)
        target = llvm.Target.from_triple(processor.triple)
        machine = target.create_target_machine(cpu=processor.cpu, opt=OPTIMISATION, reloc="pic")
        text = module_text(substep, steps, dtype, lanes_of(processor.features, dtype))
        (folder / "step.o").write_bytes(machine.emit_object(llvm.parse_assembly(text)))

    def __call__(self, arrays: Sequence[np.ndarray], first: int, last: int) -> None:
        """Move all robots."""
        inputs, count = len(self.inputs), len(arrays)
        source = (
            MAIN.replace("@POINTERS@", ", ".join(["void *"] * count))
            .replace("@BYTES@", ", ".join(str(array.nbytes) for array in arrays))
            .replace("@ARRAYS@", ", ".join(f"array[{k}]" for k in range(count)))
            .replace("@COUNT@", str(count))
            .replace("@INPUTS@", str(inputs))
        )
        (self._folder / "main.c").write_text(source)
        (self._folder / "in").write_bytes(b"".join(array.tobytes() for array in arrays[:inputs]))
        run_in_folder = partial(subprocess.run, cwd=self._folder, check=True)
        run_in_folder([self._processor.linker, "main.c", "step.o", "-lm", "-o", "step"])
        run_in_folder([*self._processor.runner, "./step", "in", "out", str(last)])
        written = (self._folder / "out").read_bytes()
        for array in arrays[inputs:]:
            array[:] = np.frombuffer(written[: array.nbytes], array.dtype).reshape(array.shape)
            written = written[array.nbytes :]


def main() -> None:
    """Print one line per robot and processor."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robots", nargs="+", metavar="ROBOT")
    parser.add_argument("--count", type=int, default=100)
    options = parser.parse_args()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    for name in options.robots:
        robot = load_robot(name)
        model = training_model(robot, 0.005)
        randomisation = load_preset("gpu", robot).env.randomisation
        states = physics_parity.random_arguments(robot, model, options.count, randomisation)
        for label, processor in PROCESSORS.items():
            with tempfile.TemporaryDirectory() as folder:
                elsewhere = partial(Elsewhere, processor, Path(folder))
                with patch.object(physics_parity, "Program", elsewhere):
                    double = physics_parity.compare(robot, model, states, np.float64).errors[:, 0]
                    single = physics_parity.compare(robot, model, states, np.float32).errors[:, 0]
            errors = f"double precision {double.max():.1e}, single {np.quantile(single, 0.99):.1e}"
            print(f"{name}, {label}: {errors}", flush=True)


if __name__ == "__main__":
    main()
