"""What a sweep's trials will report, known before one runs."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

from footfall.train.config import TrainConfig


def reported_metrics(robot: str, config: TrainConfig) -> list[str]:
    """Names of a training's metrics. Its program is traced, not compiled, in another process.

    Ray forks this process, and its trials need all of a GPU's memory: JAX is not to be started here.

    Raises:
        UserError: there is no such robot, or the configuration does not fit it.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as apart:
        return apart.submit(_trace, robot, config).result()


def _trace(robot_name: str, config: TrainConfig) -> list[str]:
    import jax

    from footfall.envs.symmetry import environment_mirror
    from footfall.envs.velocity import VelocityEnv
    from footfall.robots.description import load_robot
    from footfall.train.brax.networks import make_networks
    from footfall.train.brax.ppo import initial_state, make_iteration

    jax.config.update("jax_platforms", "cpu")
    robot, ppo = load_robot(robot_name), config.ppo
    env = VelocityEnv(robot, config.env)
    networks = make_networks(env.observation_sizes, env.action_size, ppo)
    mirror = environment_mirror(robot, env.config, env.contract) if ppo.symmetry else None
    state = jax.eval_shape(partial(initial_state, env, networks, ppo, 0))
    _, metrics, _ = jax.eval_shape(make_iteration(env, networks, ppo, mirror=mirror), state)
    return sorted(metrics)
