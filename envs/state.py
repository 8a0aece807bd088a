"""The state of an episode, and the result of a step."""

from typing import Any, NamedTuple

import jax

from footfall.domain_rand.sample import Sample


class State(NamedTuple):
    """The whole state of one robot's episode."""

    key: jax.Array
    level: jax.Array  # () of the curriculum, 0 to 1
    qpos: jax.Array
    qvel: jax.Array
    qacc_warmstart: jax.Array
    sample: Sample
    fields: dict[str, jax.Array]  # randomised model fields
    command: jax.Array  # (3,) forward m/s, leftward m/s, yaw rad/s
    hold_steps: jax.Array  # () control steps until the next command
    event_steps: dict[str, jax.Array]  # () control steps until each timed event, by its name
    steps: jax.Array  # () control steps since the reset
    phase: jax.Array  # (1,) cycles
    actions: jax.Array  # (3, n) newest first
    goals: jax.Array  # (actuation.KEPT_GOALS, n) newest first, rad
    target: jax.Array  # (n,) rate-limited target, rad
    recent_readings: jax.Array  # (substeps, m) true readings after each physics step, oldest first
    history: jax.Array  # (steps, size_per_step) observation values of the last control steps, oldest first
    terms: dict[str, dict[str, Any]]  # states of the terms that have one, by kind and name
    lagged_torque: jax.Array | None = None  # (n,) N m, of motors with lag
    net_memory: jax.Array | None = None  # (n, m, inputs) of the actuator net, of a robot that has one
    winding_c: jax.Array | None = None  # (n,) degrees Celsius, of motors with a thermal model
    lateness_s: jax.Array | None = None  # (KEPT_GOALS, n) s, delay of each goal; None if constant
    supply: jax.Array | None = None  # () battery voltage over nominal; None if the charge is not randomised
    limp_steps: jax.Array | None = None  # () control steps left in which the motors only damp


class Step(NamedTuple):
    """The result of a control step."""

    observation: dict[str, jax.Array]  # "state" for the actor, "privileged_state" for the critic
    reward: jax.Array
    terminated: jax.Array  # 1.0 after a fall or a diverged simulation
    truncated: jax.Array  # 1.0 at the episode's time limit
    metrics: dict[str, jax.Array]
