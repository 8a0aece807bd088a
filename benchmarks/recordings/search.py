"""An evolution strategy for fits whose residuals have zero gradient, as those of a servo that sticks."""

import numpy as np

from footfall.identify.shooting import Shooting

ROUNDS = 3  # searches; initial states are refined before each
POPULATION = 16
FIRST_SPREAD = 0.4  # initial standard deviation of candidates, in scales


def search(windows: Shooting, first: np.ndarray, generations: int, seed: int) -> np.ndarray:
    """Parameters, (p,), with the smallest mean absolute error found by CMA-ES from `first`.

    Args:
        windows: windows of the recordings to fit.
        first: parameters of another fit, (p,).
        generations: generations of each search.
        seed: seed of CMA-ES.
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
