"""Environment steps per second of MuJoCo Playground's Go1, in the process that calls this.

It is Playground's Go1JoystickFlatTerrain with its own PPO settings, networks and randomisation, trained by
brax's own train function. The figure is taken from the wall clock between progress reports after the first,
since brax's own `training/sps` counts num_resets_per_eval epochs against the time of one.
"""

import functools
import importlib.util
import itertools
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

TASK = "Go1JoystickFlatTerrain"
REPORTS = 4  # the first one contains the compilation
MESHES = ("trunk", "hip", "thigh", "thigh_mirror", "calf")  # for the eye only: nothing collides with them


def measure(impl: str, iterations: int) -> dict[str, Any]:
    """Playground's steps per second of PPO, end to end; empty where it cannot run, after saying why.

    Args:
        impl: its physics, jax or warp.
        iterations: of PPO between two reports, at which it resets too.
    """
    if importlib.util.find_spec("mujoco_playground") is None:
        print("Playground is not installed (pip install playground): no ratio")
        return {}
    if not hasattr(jax, "device_put_replicated"):  # brax still calls it; pmap takes a stacked array as well
        jax.device_put_replicated = lambda tree, devices: jax.tree.map(
            lambda leaf: jnp.stack([jnp.asarray(leaf)] * len(devices)), tree
        )
    try:
        with robot_at_hand():
            times_and_steps = train(impl, iterations)
    except Exception as error:  # someone else's program: its failure is a result, not ours
        lines = str(error).strip().splitlines()
        print(f"Playground did not run, no ratio: {type(error).__name__}: {lines[0] if lines else ''}")
        return {}
    (begun_s, _), *reports = times_and_steps
    rates = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.pairwise(reports)]
    return {
        "playground": {
            "task": TASK,
            "impl": impl,
            "first_report_s": reports[0][0] - begun_s,
            "steps_per_s": statistics.median(rates),
        }
    }


@contextmanager
def robot_at_hand() -> Iterator[None]:
    """Spares Playground its download of all of MuJoCo Menagerie, of which this task wants five meshes.

    They are drawn and nothing else: masses and inertias stand in Playground's own files, and only the feet,
    which are spheres, collide. So a small tetrahedron stands in for each, unless the download is there.
    """
    from etils import epath
    from mujoco_playground._src import mjx_env

    there = mjx_env.MENAGERIE_PATH
    if there.exists():
        yield
        return
    with tempfile.TemporaryDirectory() as folder:
        assets = Path(folder) / "unitree_go1" / "assets"
        assets.mkdir(parents=True)
        for name in MESHES:
            (assets / f"{name}.stl").write_bytes(tetrahedron())
        mjx_env.MENAGERIE_PATH = epath.Path(folder)
        try:
            yield
        finally:
            mjx_env.MENAGERIE_PATH = there


def tetrahedron() -> bytes:
    """One of 1 cm, as binary STL: a header of 80 bytes, a count, normal and corners of each triangle."""
    corners = np.concatenate([np.zeros((1, 3)), 0.01 * np.eye(3)])
    triangles = np.zeros(4, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    return bytes(80) + np.uint32(4).tobytes() + triangles.tobytes()


def train(impl: str, iterations: int) -> list[tuple[float, int]]:
    """Time and environment steps at the start and at each report."""
    from brax.training.agents.ppo import networks
    from brax.training.agents.ppo import train as brax
    from mujoco_playground import registry, wrapper
    from mujoco_playground.config import locomotion_params

    settings = dict(locomotion_params.brax_ppo_config(TASK, impl))
    factory = settings.pop("network_factory")
    iteration = settings["batch_size"] * settings["num_minibatches"] * settings["unroll_length"]
    settings |= {
        "num_timesteps": REPORTS * iterations * iteration,
        "num_evals": REPORTS + 1,
        "num_resets_per_eval": 1,
    }
    reports = [(time.perf_counter(), 0)]
    brax.train(
        environment=registry.load(TASK, config_overrides={"impl": impl}),
        randomization_fn=registry.get_domain_randomizer(TASK),
        wrap_env_fn=wrapper.wrap_for_brax_training,
        network_factory=functools.partial(networks.make_ppo_networks, **factory),
        progress_fn=lambda steps, _: reports.append((time.perf_counter(), steps)),
        run_evals=False,
        max_devices_per_host=1,
        **settings,
    )
    return reports
