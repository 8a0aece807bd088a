"""Running statistics of observations."""

import jax
import jax.numpy as jnp
import numpy as np
from brax.training.acme import running_statistics

from footfall.train.brax.statistics import MIN_STD, moments, updated, updated_alone

SIZES = {"state": 3, "privileged_state": 2}
STEPS, ENVIRONMENTS = 5, 40
SAMPLES = STEPS * ENVIRONMENTS


def test_two_shares_give_the_statistics_of_brax_for_the_whole() -> None:
    rng = np.random.default_rng(0)
    start = running_statistics.init_state({name: jnp.zeros(size) for name, size in SIZES.items()})
    ours = theirs = start
    for mean in (2.0, 2.5, -1.0):
        whole = {
            name: jnp.asarray(rng.normal(mean, 0.5, (STEPS, ENVIRONMENTS, size)), jnp.float32)
            for name, size in SIZES.items()
        }
        first, second = (
            moments(ours, {name: x[:, half] for name, x in whole.items()})
            for half in (slice(None, ENVIRONMENTS // 2), slice(ENVIRONMENTS // 2, None))
        )
        ours = updated(ours, jax.tree.map(lambda a, b: (a + b) / 2, first, second), SAMPLES)
        theirs = updated_alone(theirs, whole)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-5), ours, theirs)


def test_an_observation_that_hardly_varies_is_not_amplified() -> None:
    start = running_statistics.init_state({"state": jnp.zeros(1)})
    constant = {"state": jnp.full((STEPS, ENVIRONMENTS, 1), 9.81)}
    for after in (updated(start, moments(start, constant), SAMPLES), updated_alone(start, constant)):
        np.testing.assert_allclose(after.mean["state"], 9.81, rtol=1e-6)
        assert float(after.std["state"][0]) == np.float32(MIN_STD)
