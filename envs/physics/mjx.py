"""The physics in MJX: one robot, to be vmapped, on whatever device JAX has."""

from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from footfall.common.arrays import single
from footfall.envs.physics.interface import Drive, Fields, Motion, Physics, Trace, bodies, joint_effort
from footfall.envs.workarounds.fewer_kernels import fewer_kernels
from footfall.envs.workarounds.quiet_mjx import mjx
from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms
from footfall.robots.model import joint_addresses


def mjx_physics(model: mujoco.MjModel, robot: Robot) -> Physics:
    """The physics of a robot with this nominal model."""
    # Set here: by default MJX takes the first device of all hosts, and an environment variable selects Warp.
    options: dict[str, Any] = {"device": jax.local_devices()[0], "impl": "jax"}
    nominal, template = mjx.put_model(model, **options), mjx.make_data(model, **options)
    positions, dofs = map(jnp.asarray, joint_addresses(model, robot))
    net = None if robot.actuator_net is None else jax.tree.map(single, robot.actuator_net)
    # The joint of each degree of freedom; those of the base get the index after the last joint.
    joint_of = np.full(model.nv, len(dofs))
    joint_of[dofs] = np.arange(len(dofs))
    points = jnp.asarray(np.concatenate(foot_geoms(model, robot.description)))

    def simulate(motion: Motion, drive: Drive, fields: Fields) -> tuple[Motion, Trace]:
        sampled = nominal.replace(**fields)

        def substep(motion: Motion, target: jax.Array) -> tuple[Motion, Trace]:
            position, velocity = motion.qpos[positions], motion.qvel[dofs]
            effort = joint_effort(
                *(drive, target, position, velocity, model.opt.timestep, motion.lagged_torque),
                *(net, motion.net_memory),
            )
            of_joints = jnp.pad(jnp.stack([effort.torque, effort.inertia]), ((0, 0), (0, 1)))
            force, inertia = of_joints[:, joint_of]
            stepped = sampled.replace(dof_armature=sampled.dof_armature + inertia)
            with fewer_kernels():
                data = mjx.step(stepped, template.replace(**bodies(motion), qfrc_applied=force))
            trace = Trace(data.qpos, data.qvel, data.geom_xpos[points], effort.motor_torque)
            carried = effort.lagged_torque, effort.net_memory
            return Motion(data.qpos, data.qvel, data.qacc_warmstart, *carried), trace

        return jax.lax.scan(substep, motion, drive.target)

    return simulate
