"""An evolution strategy for fits whose residuals have no slope: a servo that sticks."""

import numpy as np

from footfall.identify.shooting import Shooting

ROUNDS = 3  # of refining starts between searches
POPULATION = 16
FIRST_SPREAD = 0.4  # of candidates, in scales


def search(windows: Shooting, first: np.ndarray, generations: int, seed: int) -> np.ndarray:
    """Numbers, (p,), with the least mean absolute error that CMA-ES finds from `first`.

    Args:
        windows: of the recordings that count.
        first: numbers of another fit.
        generations: of each round.
        seed: of the draws.
    """
    import cma

    best = first
    for turn in range(ROUNDS):
        residuals = windows.linearised(best)
        strategy = cma.CMAEvolutionStrategy(
            windows.scaled(best),
            FIRST_SPREAD / 2**turn,
            {
                "bounds": windows.bounds,
                "seed": 1 + seed + turn,
                "popsize": POPULATION,
                "maxiter": generations,
                "verbose": -9,
            },
        )
        while not strategy.stop():
            candidates = strategy.ask()
            error = np.abs(residuals(np.array(candidates).T)).mean(axis=(1, 2))
            strategy.tell(candidates, error.tolist())
        best = windows.unscaled(np.array(strategy.result.xbest))
    return best
