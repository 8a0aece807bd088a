"""All engines give the same motion, for batches and single robots; MuJoCo C equals plain MuJoCo."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from go1_smoke import FEW_TERMS, ROBOT, SMOKE

from footfall.domain_rand.randomisation import load_randomisation
from footfall.envs.batch import step_batch
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.c import LINE_SEARCH_EVALUATIONS, _Simulations, c_physics
from footfall.envs.physics.engines import ENGINES
from footfall.envs.physics.interface import Drive, Motion
from footfall.envs.physics.mjx import mjx_physics
from footfall.envs.state import State
from footfall.robots.actuator import JointCommand, joint_damping, joint_torque, lag_over
from footfall.robots.model import joint_addresses, training_model

CONFIG = replace(SMOKE, **FEW_TERMS | {"randomisation": load_randomisation()})
ROBOTS, STEPS, COMPARED_EVERY = 32, 24, 4
EFFECTS = {
    "lag_s": 0.004, "stribeck": 0.3, "load_friction": 0.06, "backlash": 0.01, "compliance": 0.002,
    "voltage_gain": 0.9,
}  # fmt: skip


@pytest.fixture(scope="module", params=["c", "generated"])
def engine(request: pytest.FixtureRequest) -> str:
    return request.param


IN_C = pytest.mark.parametrize("engine", ["c"], indirect=True)


@pytest.fixture(scope="module")
def env(engine: str) -> LocomotionEnv:
    return LocomotionEnv(ROBOT, replace(CONFIG, physics=engine))


@pytest.fixture(scope="module")
def begun(env: LocomotionEnv) -> State:
    return jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(0), ROBOTS))[0]


@pytest.fixture(scope="module")
def step(env: LocomotionEnv) -> Callable[..., Any]:
    return jax.jit(lambda state, action: step_batch(env, state, action))


def actions(steps: int = 1) -> jax.Array:
    return 0.5 * jax.random.normal(jax.random.PRNGKey(1), (steps, ROBOTS, len(ROBOT.joint_names)))


def equal(one: object, two: object) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(*map(jax.tree.leaves, (one, two)), strict=True))


def worst(one: jax.Array, two: jax.Array) -> float:
    return float(np.abs(np.asarray(one) - np.asarray(two)).max())


@IN_C
def test_a_control_step_in_c_equals_mjx(begun: State, step) -> None:
    """In states of a walk, with every effect of the motors. MJX has single precision, hence the limits."""
    model, ones = training_model(ROBOT, SMOKE.timestep_s), jnp.ones((ROBOTS, 12))
    model.opt.iterations, model.opt.ls_iterations = 20, 50
    mjx, c = (jax.jit(jax.vmap(physics(model, ROBOT))) for physics in (mjx_physics, c_physics))
    state, contacts = begun, set()
    for k, action in enumerate(actions(STEPS)):
        if k % COMPARED_EVERY == 0:
            motion, drive, fields = arguments(state)
            motor = drive.motor._replace(**{name: value * ones for name, value in EFFECTS.items()})
            drive = drive._replace(motor=motor, lag=lag_over(motor.lag_s, SMOKE.timestep_s))
            given = (motion._replace(lagged_torque=2.0 * ones), drive, fields)
            (mjx_end, mjx_trace), (c_end, c_trace) = mjx(*given), c(*given)
            for name, limit in (("lagged_torque", 2e-2), ("qpos", 1e-4), ("qvel", 5e-3)):
                assert worst(getattr(mjx_end, name), getattr(c_end, name)) < limit
            for name, limit in (("foot_position", 1e-4), ("torque", 1e-2)):
                assert worst(getattr(mjx_trace, name), getattr(c_trace, name)) < limit
            contacts |= set(np.asarray(c_trace.foot_position[..., 2] < 0.025).sum(axis=(1, 2)).tolist())
        state, *_ = step(state, action)
    assert len(contacts) > 3  # feet in the air, on the ground and landing


@IN_C
def test_a_control_step_in_c_equals_plain_mujoco(begun: State) -> None:
    """Each robot has its own model and data, with the motors' law at each physics step."""
    motion, drive, fields = arguments(begun)
    end, _ = jax.vmap(c_physics(training_model(ROBOT, SMOKE.timestep_s), ROBOT))(motion, drive, fields)
    positions, dofs = joint_addresses(training_model(ROBOT), ROBOT)
    for k in range(0, ROBOTS, 8):
        model = training_model(ROBOT, SMOKE.timestep_s)
        model.body_sameframe[:], model.opt.ls_iterations = 0, LINE_SEARCH_EVALUATIONS
        for name, value in fields.items():
            getattr(model, name)[:] = value[k]
        data, armature = mujoco.MjData(model), model.dof_armature[dofs].copy()
        data.qpos[:], data.qvel[:] = motion.qpos[k], motion.qvel[k]
        kp, kd, bias = (np.asarray(each[k], float) for each in (drive.kp, drive.kd, drive.encoder_bias))
        motor = jax.tree.map(lambda part, k=k: np.asarray(part[k], float), drive.motor)
        for target in np.asarray(drive.target[k]):
            q, v = data.qpos[positions] + bias, data.qvel[dofs]
            command = JointCommand(target, np.zeros(12), kp, kd, np.zeros(12))
            data.qfrc_applied[dofs] = joint_torque(command, q, v, motor)
            damping = joint_damping(command, q, v, motor)
            model.dof_armature[dofs] = armature + 0.5 * SMOKE.timestep_s * damping
            mujoco.mj_step(model, data)
        assert worst(end.qpos[k], data.qpos) < 1e-5
        assert worst(end.qvel[k], data.qvel) < 1e-3


class TestPurity:
    def test_a_step_depends_on_its_arguments_alone(self, step, begun: State) -> None:
        one, two = actions(2)
        first = step(begun, one)
        step(first[0], two)
        assert equal(step(begun, one), first)

    def test_results_do_not_depend_on_the_batch(
        self, monkeypatch: pytest.MonkeyPatch, begun: State, engine: str
    ) -> None:
        for module in ("c", "generated.on_processor"):
            monkeypatch.setattr(f"footfall.envs.physics.{module}.usable_cores", lambda: 3)
        monkeypatch.setattr("footfall.envs.physics.generated.on_processor.MIN_ROBOTS_PER_THREAD", 5)
        physics, given = ENGINES[engine](training_model(ROBOT), ROBOT), jax.device_get(arguments(begun))
        many = jax.device_get(jax.vmap(physics)(*given))
        few = jax.vmap(physics)(*jax.tree.map(lambda x: x[5:8], given))
        one = physics(*jax.tree.map(lambda x: x[5], given))
        nested = jax.vmap(jax.vmap(physics))(*jax.tree.map(lambda x: x.reshape(4, -1, *x.shape[1:]), given))
        assert equal(jax.tree.map(lambda x: x[5:8], many), few)
        assert equal(jax.tree.map(lambda x: x[5], many), one)
        assert equal(many, jax.tree.map(lambda x: x.reshape(ROBOTS, *x.shape[2:]), nested))

    @IN_C
    def test_an_accelerators_arrays_give_the_same_result(self, begun: State) -> None:
        model, given = training_model(ROBOT), arguments(begun)
        assert equal(_Simulations(model, ROBOT)(*given), jax.vmap(c_physics(model, ROBOT))(*given))


def test_a_diverging_robot_affects_no_other_and_nothing_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], step, begun
) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo would log its warnings
    undisturbed, _, undisturbed_result = jax.device_get(step(begun, actions()[0]))
    qpos, qvel = begun.qpos.at[3, 6].set(jnp.nan), begun.qvel.at[5, 6].set(jnp.inf).at[7, 0].set(1e20)
    after, observation, result = jax.device_get(step(begun._replace(qpos=qpos, qvel=qvel), actions()[0]))
    for flags in (result.metrics["episode/diverged"], result.terminated):
        assert np.flatnonzero(flags).tolist() == [3, 5, 7]
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((observation, result, after.qpos)))
    others = np.setdiff1d(np.arange(ROBOTS), [3, 5, 7])
    expected = (undisturbed, undisturbed_result)
    assert equal(*(jax.tree.map(lambda x: x[others], each) for each in ((after, result), expected)))
    assert list(tmp_path.iterdir()) == []
    assert "WARNING" not in capfd.readouterr().err


@IN_C
def test_a_centre_of_mass_at_the_bodys_origin_moves(begun: State) -> None:
    """MuJoCo marks such a body when it compiles it, and would then ignore the offset."""
    plain, moved = training_model(ROBOT), training_model(ROBOT)
    for model in (plain, moved):
        model.body_ipos[1], model.body_sameframe[1] = 0.0, mujoco.mjtSameFrame.mjSAMEFRAME_BODY
    moved.body_ipos[1], moved.body_sameframe[1] = (0.05, 0.0, 0.02), mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    motion, drive, _ = arguments(begun)
    fields = {"body_ipos": jnp.tile(jnp.float32(moved.body_ipos), (ROBOTS, 1, 1))}
    by_field = jax.vmap(c_physics(plain, ROBOT))(motion, drive, fields)
    by_model = jax.vmap(c_physics(moved, ROBOT))(motion, drive, {})
    assert worst(by_field[0].qvel, by_model[0].qvel) < 1e-4
    assert worst(by_field[0].qvel, jax.vmap(c_physics(plain, ROBOT))(motion, drive, {})[0].qvel) > 1e-2


def arguments(state: State) -> tuple[Motion, Drive, dict[str, jax.Array]]:
    """Inputs of the physics of a batch, in which all robots, joints and physics steps differ."""
    rng = np.random.default_rng(3)

    def each(values: np.ndarray) -> jax.Array:
        return jnp.asarray(values * rng.uniform(0.9, 1.1, (ROBOTS, len(values))), dtype=jnp.float32)

    offset = 0.01 * jnp.arange(SMOKE.substeps)[:, None] * jnp.linspace(-1.0, 1.0, 12)
    target = state.target[:, None] + offset
    bias = jnp.asarray(0.02 * rng.normal(size=(ROBOTS, 12)), dtype=jnp.float32)
    drive = Drive(target, each(ROBOT.kp), each(ROBOT.kd), jax.tree.map(each, ROBOT.motor), bias)
    return Motion(state.qpos, state.qvel, state.qacc_warmstart), drive, state.fields
