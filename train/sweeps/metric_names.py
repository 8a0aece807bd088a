"""Names of the metrics that a sweep's trials will report, determined before the first trial."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from footfall.common.main_guard import check_main_guard
from footfall.robots.description import load_robot
from footfall.train.config import TrainConfig
from footfall.train.trainers import find_trainer


def reported_metrics(robot: str, config: TrainConfig, trainer: str) -> list[str] | None:
    """Names of a training's metrics; None: its trainer cannot list them before it trains.

    They are determined in another process: Ray forks this one and needs all of a GPU's memory for its trials,
    so JAX must not start here.

    Raises:
        UserError: there is no such robot or trainer, or the settings do not fit the robot.
    """
    check_main_guard()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        return executor.submit(_metric_names, robot, config, trainer).result()


def _metric_names(robot: str, config: TrainConfig, trainer: str) -> list[str] | None:
    import jax

    jax.config.update("jax_platforms", "cpu")
    return find_trainer(trainer).metric_names(config, load_robot(robot))
