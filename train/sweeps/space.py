"""A sweep's search space and scheduler, as Ray Tune's objects."""

from types import ModuleType
from typing import Any

from footfall.common.errors import UserError
from footfall.train.sweeps.config import SweepConfig

DISTRIBUTIONS = (
    "choice", "grid_search", "uniform", "quniform", "loguniform", "qloguniform", "randint", "qrandint",
    "lograndint", "qlograndint", "randn", "qrandn",
)  # fmt: skip
TAKES_LIST = ("choice", "grid_search")  # these take the list; the others take its elements as arguments
DRAWS_SEED = 0  # a file's draws are the same each time


def search_algorithm(config: SweepConfig) -> Any:
    """Ray's search algorithm: the same draws each time, each one for every seed and grid value."""
    from ray.tune.search.basic_variant import BasicVariantGenerator

    return BasicVariantGenerator(
        max_concurrent=config.concurrent or 0, constant_grid_search=True, random_state=DRAWS_SEED
    )


def search_space(tune: ModuleType, config: SweepConfig) -> dict[str, Any]:
    """Ray's search space.

    Raises:
        UserError: a distribution is unknown or its arguments are wrong.
    """
    space: dict[str, Any] = {}
    for key, declared in config.space.items():
        if len(declared) != 1 or next(iter(declared)) not in DISTRIBUTIONS:
            raise UserError(f"space.{key}: expected one of {', '.join(DISTRIBUTIONS)}")
        ((name, values),) = declared.items()
        if not values:
            raise UserError(f"space.{key}: {name}: the list is empty")
        try:
            space[key] = getattr(tune, name)(*([values] if name in TAKES_LIST else values))
            if name not in TAKES_LIST:
                space[key].sample(random_state=DRAWS_SEED)  # Ray refuses empty bounds only here
        except (TypeError, ValueError, AssertionError, ArithmeticError) as error:
            raise UserError(f"space.{key}: {name}: {' '.join(str(error).split())}") from None
    return space


def first_draw(space: dict[str, Any]) -> dict[str, Any]:
    """One point of a search space."""
    return {
        key: domain["grid_search"][0] if isinstance(domain, dict) else domain.sample(random_state=DRAWS_SEED)
        for key, domain in space.items()
    }


def make_scheduler(tune: ModuleType, config: SweepConfig) -> Any:
    """Ray's scheduler.

    Raises:
        UserError: there is none of this name, or its settings are wrong.
    """
    settings = dict(config.scheduler)
    name = settings.pop("name", None)
    try:
        return tune.create_scheduler(name, **settings)
    except (TypeError, ValueError, AssertionError, AttributeError) as error:
        raise UserError(f"scheduler: {' '.join(str(error).split())[:200]}") from None
