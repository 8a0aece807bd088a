"""Training with brax's PPO: one iteration as one compiled function, on any number of devices."""

from footfall.train.brax import lean_brax  # noqa: F401, before anything imports brax
