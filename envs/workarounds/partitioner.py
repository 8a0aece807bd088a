"""The older of XLA's partitioners for jax 0.11, whose Shardy crashes in footfall's training.

Reason: compiling a `shard_map` over MJX's accelerations for two devices ends in a segmentation fault inside
Shardy's pass over unused inputs (ManualComputationUnusedInputsPattern), seen with jax 0.11.2 on GPUs and on
virtual processors. jax 0.10.2 compiles the same program with Shardy, which is then used.
Upstream: no report of it was found; JAX is about to drop the older partitioner.
Remove it when a jax release no longer crashes: tests/envs/test_workarounds.py then fails where jax 0.11 is
installed.

The older partitioner aborts inside a `shard_map` at a sort of several arrays or of several rows ("Check
failed: !IsManualLeaf()"), depending on what XLA made of the code around it: permutations are drawn outside.
"""

import jax

CRASHES_SINCE = (0, 11)


def avoid_crashing_partitioner() -> None:
    """Compile programs for several devices without Shardy, if Shardy would crash."""
    if jax.__version_info__ >= CRASHES_SINCE:
        jax.config.update("jax_use_shardy_partitioner", False)
