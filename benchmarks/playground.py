"""Environment steps per second of MuJoCo Playground's Go1, in the calling process.

The task is Go1JoystickFlatTerrain, or another of Playground's Go1 tasks, with its own PPO settings, networks
and randomisation, trained by brax's own train function. The figure is computed from the wall-clock time
between progress reports after the first, because brax's own `training/sps` counts num_resets_per_eval epochs
against the time of one.
"""

import functools
import importlib.util
import itertools
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

TASK = "Go1JoystickFlatTerrain"
REPORTS = 4  # the first report includes the compilation
MESHES = ("trunk", "hip", "thigh", "thigh_mirror", "calf")  # visual only, without collisions


def measure(impl: str, environments: int, iterations: int, task: str = TASK) -> dict[str, Any]:
    """Steps per second of Playground's PPO, end to end, and of its physics alone: minimum, median, maximum.

    Args:
        impl: physics, jax or warp.
        environments: number of environments instead of 8,192; the batches grow with it.
        iterations: PPO iterations between two reports, at which the environments are reset, too.
        task: Playground's name of the task.

    Returns:
        The figures; if Playground cannot run, the reason under "failed".
    """
    found: dict[str, Any] = {"task": task, "impl": impl, "environments": environments}
    if importlib.util.find_spec("mujoco_playground") is None:
        return found | {"failed": "not installed (pip install playground)"}
    supply_device_put_replicated()
    try:
        with placeholder_meshes():
            (start_s, _), *reports = train(impl, environments, iterations, task)
            rates = sorted((b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.pairwise(reports))
            steps = {"PPO, end to end": (rates[0], statistics.median(rates), rates[-1])}
            if impl == "jax":
                steps["physics alone"] = physics_alone(environments, task)
    except Exception as error:  # any failure of Playground is a result
        lines = str(error).strip().splitlines()
        return found | {"failed": f"{type(error).__name__}: {lines[0] if lines else ''}"}
    return found | {"first_report_s": reports[0][0] - start_s, "steps_per_s": steps}


def physics_alone(
    environments: int, task: str, control_steps: int = 10, repeats: int = 20
) -> tuple[float, float, float]:
    """Control steps per second of Playground's model under random actions: minimum, median, maximum."""
    from mujoco_playground import registry
    from mujoco_playground._src import mjx_env

    env = registry.load(task, config_overrides={"impl": "jax"})
    data = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(0), environments)).data
    actions = 0.1 * jax.random.normal(jax.random.key(0), (control_steps, environments, env.action_size))
    standing = jnp.asarray(env.mj_model.keyframe("home").qpos[7:])

    @jax.jit
    def simulate(data: Any) -> Any:
        def step(data: Any, action: jax.Array) -> tuple[Any, None]:
            step_one = functools.partial(mjx_env.step, env.mjx_model, n_substeps=env.n_substeps)
            return jax.vmap(step_one)(data, standing + action), None

        return jax.lax.scan(step, data, actions)[0]

    jax.block_until_ready(simulate(data))
    rates = []
    for _ in range(repeats):
        began = time.perf_counter()
        jax.block_until_ready(simulate(data))
        rates.append(control_steps * environments / (time.perf_counter() - began))
    return min(rates), statistics.median(rates), max(rates)


def constraint_rows(model: Any) -> int:
    """Rows of MJX's constraint Jacobian for a MuJoCo model."""
    from mujoco import mjx

    return int(mjx.make_data(model, impl="jax")._impl.efc_J.shape[0])


def facts(task: str = TASK) -> dict[str, Any]:
    """Figures of Playground's task and recipe, with the names of `throughput.differences`."""
    if importlib.util.find_spec("mujoco_playground") is None:
        return {}
    from mujoco_playground import registry

    with placeholder_meshes():
        env, config = registry.load(task, config_overrides={"impl": "jax"}), registry.get_default_config(task)
    ppo = ppo_settings("jax", task)
    batch = ppo["batch_size"] * ppo["num_minibatches"] * ppo["unroll_length"]
    updates = ppo["num_minibatches"] * ppo["num_updates_per_batch"]
    return {
        "physics steps": f"{env.n_substeps} x {1e3 * env.sim_dt:g} ms",
        "constraint rows": constraint_rows(env.mj_model),
        "sensors in the model": env.mj_model.nsensor,
        "environments": ppo["num_envs"],
        "updates of the networks": f"{updates} each {batch:,} steps, {ppo['num_updates_per_batch']} epochs",
        "steps of the recipe": f"{ppo['num_timesteps']:,}",
        "history in the observation": f"{config.history_len} frame",
        "delays of actions and readings": "no",
        "pushes": "yes" if config.pert_config.enable else "no",
        "a new episode": "the first state again",
    }


@contextmanager
def placeholder_meshes() -> Iterator[None]:
    """Replaces five meshes of MuJoCo Menagerie, so that Playground does not download all of it.

    The meshes are visual only: masses and inertias are in Playground's own files, and only the feet,
    which are spheres, collide. Each mesh is a small tetrahedron, unless the download exists.
    """
    from etils import epath
    from mujoco_playground._src import mjx_env

    menagerie = mjx_env.MENAGERIE_PATH
    if menagerie.exists():
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
            mjx_env.MENAGERIE_PATH = menagerie


def tetrahedron() -> bytes:
    """A tetrahedron of 1 cm as binary STL: an 80-byte header, a count, each triangle's normal and corners."""
    corners = np.concatenate([np.zeros((1, 3)), 0.01 * np.eye(3)])
    triangles = np.zeros(4, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    return bytes(80) + np.uint32(4).tobytes() + triangles.tobytes()


def train(impl: str, environments: int, iterations: int, task: str) -> list[tuple[float, int]]:
    """Time and environment steps, at the start and at each report."""
    settings = ppo_settings(impl, task)
    settings["batch_size"] *= environments // settings["num_envs"]
    settings["num_envs"] = environments
    iteration = settings["batch_size"] * settings["num_minibatches"] * settings["unroll_length"]
    settings |= {
        "num_timesteps": REPORTS * iterations * iteration,
        "num_evals": REPORTS + 1,
        "num_resets_per_eval": 1,
    }
    reports = [(time.perf_counter(), 0)]
    run_brax(impl, settings, lambda steps, *_: reports.append((time.perf_counter(), steps)), task)
    return reports[:1] + reports[2:]  # brax also reports its untrained policy


def ppo_settings(impl: str, task: str = TASK) -> dict[str, Any]:
    """Playground's PPO settings for a task."""
    from mujoco_playground.config import locomotion_params

    return dict(locomotion_params.brax_ppo_config(task, impl))


def run_brax(impl: str, settings: dict[str, Any], on_policy: Callable[..., None], task: str = TASK) -> None:
    """Train with brax's own function, randomised like Playground, without evaluations.

    Args:
        impl: Playground's physics, jax or warp.
        settings: settings of brax's PPO.
        on_policy: called with the environment steps so far, a function that makes policies, and (normaliser,
            actor, critic), before the training and after each of its stages.
        task: Playground's name of the task.
    """
    from brax.training.agents.ppo import networks
    from brax.training.agents.ppo import train as brax
    from mujoco_playground import registry, wrapper

    settings = dict(settings)
    factory = settings.pop("network_factory")
    env = registry.load(task, config_overrides={"impl": impl})
    # One iteration is often not enough, and Warp then prints a line each time: gigabytes in minutes.
    if impl == "warp":
        env._mjx_model = env.mjx_model.tree_replace({"opt._impl.warn_overflow": 0})
    brax.train(
        environment=env,
        randomization_fn=registry.get_domain_randomizer(task),
        wrap_env_fn=wrapper.wrap_for_brax_training,
        network_factory=functools.partial(networks.make_ppo_networks, **factory),
        policy_params_fn=on_policy,
        run_evals=False,
        max_devices_per_host=1,
        **settings,
    )


def supply_device_put_replicated() -> None:
    """Add the function that jax 0.10 dropped and brax 0.14.2 calls; pmap accepts a stacked array, too."""
    if not hasattr(jax, "device_put_replicated"):

        def replicated(x: Any, devices: Sequence[Any]) -> Any:
            return jax.tree.map(lambda leaf: jnp.stack([jnp.asarray(leaf)] * len(devices)), x)

        jax.device_put_replicated = replicated
