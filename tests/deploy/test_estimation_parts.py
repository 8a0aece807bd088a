"""The parts of the base estimator, each against figures worked out by hand or by another library."""

import math
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up import bodies
from scipy.spatial.transform import Rotation

from footfall.deploy.estimation.config import ContactConfig, FilterConfig, OdometryConfig
from footfall.deploy.estimation.contact import ContactEstimator
from footfall.deploy.estimation.feet import ContactPoints
from footfall.deploy.estimation.filter import MotionFilter
from footfall.deploy.estimation.odometry import YAW, Drift, Lateness
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot, load_robot
from footfall.robots.feet import FootBalls, foot_balls
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
G1 = load_robot("g1")
UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.eye(3).tolist()
TRUSTING = FilterConfig(outlier_freedom=1e12, push_m_s=1e6)  # neither outliers nor pushes: Kalman's own


def about(axis: str, angle: float) -> np.ndarray:
    """Rotation (3, 3) about x or y."""
    cos, sin = np.cos(angle), np.sin(angle)
    if axis == "x":
        return np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])


# -- the filter --------------------------------------------------------------------------------------


def matrix(motion: MotionFilter) -> np.ndarray:
    """The covariance of (p, v, b) of one axis."""
    m = motion
    return np.array([[m.pp, m.pv, m.pb], [m.pv, m.vv, m.vb], [m.pb, m.vb, m.bb]])


def coupled(config: FilterConfig = TRUSTING, seed: int = 3) -> MotionFilter:
    """A filter in the middle of something: each of its numbers differs from the others."""
    rng = np.random.default_rng(seed)
    motion = MotionFilter(config)
    root = 0.02 * rng.standard_normal((3, 3))
    cov = root @ root.T + 1e-5 * np.eye(3)
    motion.pp, motion.pv, motion.pb, motion.vv, motion.vb, motion.bb = cov[np.triu_indices(3)].tolist()
    motion.place, motion.velocity, motion._bias = rng.standard_normal((3, 3)).tolist()
    return motion


class TestFilter:
    def test_prediction_is_the_textbooks(self) -> None:
        """F P F' + Q with p' = p + v dt, v' = v + (a - b) dt; a is the mean of two readings'."""
        config, dt_s, turn = TRUSTING, 0.003, about("x", 0.3)
        motion = coupled()
        place, velocity, bias = (np.array(x) for x in (motion.place, motion.velocity, motion._bias))
        forces = np.array([[1.0, -2.0, 11.0], [1.5, -2.5, 10.0]])
        motion.predict(forces[0].tolist(), turn.tolist(), 0.0)
        before = matrix(motion)
        motion.predict(forces[1].tolist(), turn.tolist(), dt_s)

        acceleration = turn @ (forces.mean(axis=0) - bias) - 9.81 * UP
        np.testing.assert_allclose(motion.velocity, velocity + dt_s * acceleration)
        np.testing.assert_allclose(motion.place, place + dt_s * velocity + dt_s**2 / 2 * acceleration)
        transition = np.array([[1.0, dt_s, 0.0], [0.0, 1.0, -dt_s], [0.0, 0.0, 1.0]])
        change = (0.5**2 + 0.5**2 + 1.0**2) / 3
        noise = config.acceleration_noise**2 + config.acceleration_change**2 * change
        added = np.diag([0.0, noise * dt_s**2, config.acceleration_bias_drift**2 * dt_s])
        np.testing.assert_allclose(matrix(motion), transition @ before @ transition.T + added, rtol=1e-10)

    def test_correction_is_the_textbooks(self) -> None:
        """Each leg measures v, with a noise that grows as its contact falls."""
        config, motion = TRUSTING, coupled()
        state = np.array([motion.place, motion.velocity, motion._bias])
        covariance = matrix(motion)
        velocities = np.random.default_rng(5).standard_normal((4, 3))
        contact = np.array([1.0, 0.6, 0.0, 0.3])
        motion.correct(velocities.tolist(), contact.tolist(), LEVEL, 0.002)

        measures = np.zeros((4, 3))
        measures[:, 1] = 1.0
        factor = np.array([1.0, 1 / 0.36, 1000.0, 1 / 0.09])
        noise = np.diag((config.leg_velocity_noise * factor) ** 2)
        gain = covariance @ measures.T @ np.linalg.inv(measures @ covariance @ measures.T + noise)
        expected = state + gain @ (velocities - measures @ state)
        np.testing.assert_allclose([motion.place, motion.velocity, motion._bias], expected, rtol=1e-9)
        np.testing.assert_allclose(matrix(motion), (np.eye(3) - gain @ measures) @ covariance, rtol=1e-7)

    def test_the_bias_is_the_bodys(self) -> None:
        """It takes what the legs say in the body's axes, however the robot is turned: R' e, by scipy."""
        for seed, turn in enumerate(Rotation.random(4, random_state=1)):
            motion, error = coupled(seed=seed), np.array([0.1, -0.2, 0.3])
            bias, seen = np.array(motion._bias), np.array(motion.velocity) + error
            share = motion.vb / (motion.vv + TRUSTING.leg_velocity_noise**2)
            motion.correct([seen.tolist()], [1.0], turn.as_matrix().tolist(), 0.002)
            np.testing.assert_allclose(motion._bias, bias + share * turn.inv().apply(error), rtol=1e-9)

    @settings(max_examples=100, deadline=None)
    @given(st.integers(0, 10**6))
    def test_its_covariance_stays_one(self, seed: int) -> None:
        """Whatever readings come, no variance becomes negative and no correlation exceeds one."""
        rng = np.random.default_rng(seed)
        motion = coupled(FilterConfig(), seed)
        for _ in range(60):
            motion.predict((10 * rng.standard_normal(3)).tolist(), LEVEL, float(rng.uniform(0, 0.02)))
            legs = rng.standard_normal((3, 3)) * rng.choice([0.01, 10.0])
            motion.correct(legs.tolist(), rng.uniform(size=3).tolist(), LEVEL, 0.002)
            cov = matrix(motion)
            assert np.linalg.eigvalsh(cov / np.sqrt(np.outer(np.diag(cov), np.diag(cov)))).min() > -1e-9

    def test_a_leg_that_slips_is_outvoted(self) -> None:
        """Of three legs one slips at 0.5 m/s: a plain filter would believe it for a third."""
        plain, robust = MotionFilter(TRUSTING), MotionFilter(FilterConfig())
        legs = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]
        for motion in (plain, robust):
            motion.vv = 1e-4
            for _ in range(200):
                motion.correct(legs, [1.0] * 3, LEVEL, 0.002)
        assert plain.velocity[0] == pytest.approx(0.5 / 3, rel=0.05)
        assert 0.0 < robust.velocity[0] < 0.02

    def test_how_far_an_outlier_counts(self) -> None:
        """Student's weight by hand: misfit d = e'e / (3 (P + R)), noise R (1 + d / freedom)."""
        motion = MotionFilter(FilterConfig(push_m_s=1e6))
        motion.vv, noise = 4e-4, 9e-4
        motion.correct([[0.3, 0.0, 0.0]], [1.0], LEVEL, 0.002)
        misfit = 0.09 / (3 * (4e-4 + noise))
        expected = 0.3 * 4e-4 / (4e-4 + noise * (1 + misfit / 4.0))
        assert motion.velocity[0] == pytest.approx(expected)

    @pytest.mark.parametrize(("ticks", "follows"), [(1, False), (15, True)])
    def test_a_push_is_believed_once_it_lasts(self, ticks: int, follows: bool) -> None:
        """All legs say 0.4 m/s, which the accelerometer did not see: for 2 ms a shock, for 30 ms a push."""
        motion = MotionFilter(FilterConfig())
        motion.predict([0.0, 0.0, 9.81], LEVEL, 0.002)
        for _ in range(500):
            motion.predict([0.0, 0.0, 9.81], LEVEL, 0.002)
            motion.correct([[0.0, 0.0, 0.0]] * 2, [1.0, 1.0], LEVEL, 0.002)
        for _ in range(ticks):
            motion.predict([0.0, 0.0, 9.81], LEVEL, 0.002)
            motion.correct([[0.4, 0.0, 0.0]] * 2, [1.0, 1.0], LEVEL, 0.002)
        assert (motion.velocity[0] > 0.35) == follows
        assert (motion.velocity[0] < 0.02) != follows

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_how_far_a_push_makes_the_velocity_uncertain(self, axis: int) -> None:
        """In 2 ms of 10: a fifth of what the legs say, then a fifth of the rest; a third of squares."""
        motion, seen = MotionFilter(FilterConfig(push_m_s=0.3, push_filter_s=0.01)), np.zeros(3)
        seen[axis], motion.vv = -2.0, 0.0
        motion._look_for_push(seen.tolist(), 0.9, 0.002)
        first = 0.2 * 0.9 * 2.0
        assert motion.vv == pytest.approx((first**2 - 0.09) / 3)
        motion._look_for_push(seen.tolist(), 0.9, 0.002)
        second = first + 0.2 * (0.9 * 2.0 - first)
        assert motion.vv == pytest.approx((first**2 + second**2 - 2 * 0.09) / 3)
        motion._look_for_push((-seen).tolist(), 1.0, 0.02)  # longer than it is filtered: at once
        assert motion._surprise[axis] == pytest.approx(2.0)

    def test_legs_in_the_air_do_not_look_like_a_push(self) -> None:
        motion = MotionFilter(FilterConfig())
        motion.vv = 1e-4
        for _ in range(50):
            motion.correct([[1.0, 0.0, 0.0]] * 2, [0.0, 0.0], LEVEL, 0.002)
        assert motion.vv < 1e-4
        assert abs(motion.velocity[0]) < 0.01

    def test_a_tilted_accelerometer_is_found_out(self) -> None:
        """0.2 m/s^2 sideways for ever, on legs that stand: the velocity stays none."""
        motion = MotionFilter(FilterConfig())
        for _ in range(5000):
            motion.predict([0.2, 0.0, 9.81], LEVEL, 0.002)
            motion.correct([[0.0, 0.0, 0.0]], [1.0], LEVEL, 0.002)
        np.testing.assert_allclose(motion._bias, [0.2, 0.0, 0.0], atol=0.01)
        np.testing.assert_allclose(motion.velocity, 0.0, atol=1e-3)


# -- contacts ----------------------------------------------------------------------------------------


def carried(robot: Robot, force: np.ndarray, acceleration: np.ndarray = 9.81 * UP) -> Sensed:
    """At rest in the default pose, with forces (legs, 3), N, on the feet, and limbs that weigh."""
    legs = robot.legs
    jacobian = legs.pose(robot.default_pose).jacobian
    torque = legs.holding_torque(robot.default_pose, acceleration) + legs.torque(jacobian, force)
    still = np.zeros(3), acceleration, np.array([1.0, 0.0, 0.0, 0.0])
    zero = np.zeros(len(robot.joint_names))
    return Sensed(*still, robot.default_pose, zero, legs.scatter(torque, zero))


def held_out(robot: Robot, pose: np.ndarray) -> Sensed:
    """At rest in any pose, motors off."""
    zero = np.zeros_like(pose)
    return Sensed(np.zeros(3), 9.81 * UP, np.array([1.0, 0.0, 0.0, 0.0]), pose, zero, zero)


class TestContact:
    CONFIG = ContactConfig()

    def begun(self, robot: Robot, sensed: Sensed) -> ContactEstimator:
        contact = ContactEstimator(robot.legs, nominal_body(robot), self.CONFIG)
        contact.reset(sensed)
        return contact

    def after(
        self,
        robot: Robot,
        contact: ContactEstimator,
        sensed: Sensed,
        ticks: int,
        plan: np.ndarray | None = None,
    ) -> np.ndarray:
        rates = robot.legs.gather(sensed.joint_velocity)
        jacobian = robot.legs.pose(sensed.joint_position).jacobian
        for _ in range(ticks):
            found = contact.update(sensed, rates, jacobian, UP, plan, 0.002)
        return np.array(found)

    @pytest.mark.parametrize("name", ["go1", "hexapod"])
    @pytest.mark.parametrize(("share", "trust"), [(0.15, 0.0), (0.5, 0.5), (0.8, 1.0), (1.5, 1.0)])
    def test_trust_follows_the_force_on_the_foot(self, name: str, share: float, trust: float) -> None:
        """None below 0.2 of an even share of the weight, full above 0.8, half in the middle."""
        robot = load_robot(name)
        even = 9.81 * nominal_body(robot).mass / robot.legs.count
        sensed = carried(robot, np.tile(share * even * UP, (robot.legs.count, 1)))
        found = self.after(robot, self.begun(robot, sensed), sensed, 200)
        np.testing.assert_allclose(found, trust, atol=0.01)

    def test_legs_in_the_air_do_not_stand_however_heavy_they_are(self) -> None:
        """The hexapod's weigh as much as its body: held up, then yanked down faster than they would fall."""
        robot = load_robot("hexapod")
        for felt in (9.81 * UP, np.array([10.0, -20.0, 60.0]), np.array([5.0, 5.0, -30.0])):
            hanging = carried(robot, np.zeros((6, 3)), felt)
            assert np.abs(hanging.joint_torque).max() > 0.1
            np.testing.assert_array_equal(self.after(robot, self.begun(robot, hanging), hanging, 100), 0.0)

    def test_a_leg_that_is_thrown_is_no_standing_one(self) -> None:
        """Motors accelerate legs in the air with the very torques that would carry 30 N each."""
        legs, zero, gather = ROBOT.legs, np.zeros(12), ROBOT.legs.gather
        hanging, standing = (carried(ROBOT, np.tile(f * UP, (4, 1))) for f in (0.0, 30.0))
        driving = gather(standing.joint_torque - hanging.joint_torque)
        acceleration = np.linalg.solve(nominal_body(ROBOT).leg_inertia, driving[:, :, None])[:, :, 0]
        contact = self.begun(ROBOT, hanging)
        contact.probability = [0.0] * 4
        for tick in range(1, 40):
            speed = legs.scatter(0.002 * tick * acceleration, zero)
            found = self.after(ROBOT, contact, standing._replace(joint_velocity=speed), 1)
            np.testing.assert_allclose(found, 0.0, atol=1e-9)
        assert self.after(ROBOT, self.begun(ROBOT, standing), standing, 40).min() > 0.9

    def test_a_stretched_leg_does_not_stop_it(self, tmp_path: Path) -> None:
        """All links in a line: no torque tells of a force along it."""
        robot = bodies(tmp_path)["biped without ankles"]
        straight = held_out(robot, np.zeros(6))
        jacobian = robot.legs.pose(straight.joint_position).jacobian
        assert np.linalg.matrix_rank(jacobian[0]) == 2
        assert np.isfinite(self.after(robot, self.begun(robot, straight), straight, 3)).all()

    def test_a_plan_limits_trust(self) -> None:
        standing = carried(ROBOT, np.tile(40.0 * UP, (4, 1)))
        plan = np.array([1.0, 0.5, 0.0, 1.0])
        found = self.after(ROBOT, self.begun(ROBOT, standing), standing, 200, plan)
        np.testing.assert_allclose(found, plan, atol=0.01)

    def test_trust_is_won_slowly_and_lost_at_once(self) -> None:
        """After one time constant of 30 ms 63 %; the force is gone soon after."""
        standing, hanging = (carried(ROBOT, np.tile(f * UP, (4, 1))) for f in (40.0, 0.0))
        contact = self.begun(ROBOT, standing)
        contact.probability = [0.0] * 4
        assert self.after(ROBOT, contact, standing, 15)[2] == pytest.approx(1 - np.exp(-1), abs=0.01)
        self.after(ROBOT, contact, standing, 200)
        assert self.after(ROBOT, contact, hanging, 2)[2] > 0.8
        assert self.after(ROBOT, contact, hanging, 8)[2] == 0.0


# -- feet --------------------------------------------------------------------------------------------


class TestContactPoints:
    def test_of_a_ball_it_is_the_lowest_point(self) -> None:
        """Pitched or rolled, a ball touches the ground below its centre."""
        up = about("x", 0.4).T @ UP
        arms = ContactPoints(ROBOT.legs, 0.002).arms(ROBOT.default_pose, up)
        np.testing.assert_allclose(arms, -0.023 * np.tile(up, (4, 1)))

    def test_of_a_level_sole_it_is_below_its_middle(self) -> None:
        arms = ContactPoints(G1.legs, 0.002).arms(G1.default_pose, UP)
        np.testing.assert_allclose(arms, [[0.0, 0.0, -0.005]] * 2, atol=1e-6)

    @pytest.mark.parametrize(
        ("axis", "angle", "expected"),
        [
            ("y", 0.06, (0.085, 0.0)),  # nose down: the toes
            ("y", -0.06, (-0.085, 0.0)),  # nose up: the heel
            ("x", 0.3, (0.0766, -0.0297)),  # rolled: the edge, which is 1.48 mm higher at the narrower heel
        ],
    )
    def test_of_a_sole_that_tips_it_is_the_edge(
        self, axis: str, angle: float, expected: tuple[float, float]
    ) -> None:
        """Corners 0.085 m ahead and behind, 0.03 and 0.025 m aside, seen from the sole's middle."""
        up = about(axis, angle).T @ UP
        arms = ContactPoints(G1.legs, 0.0005).arms(G1.default_pose, up)
        np.testing.assert_allclose(arms[:, :2] + 0.005 * up[:2], [expected] * 2, atol=1e-3)

    def test_soles_follow_their_ankles(self) -> None:
        """The base level, ankles bent by 0.1 rad: one foot on its toes, one on its heel."""
        pose = G1.default_pose.copy()
        left, right = (G1.joint_index(f"{side}_ankle_pitch_joint") for side in ("left", "right"))
        pose[left], pose[right] = pose[left] + 0.1, pose[right] - 0.1
        arms = ContactPoints(G1.legs, 0.001).arms(pose, UP)
        np.testing.assert_allclose(arms[:, 0], [0.085 * np.cos(0.1), -0.085 * np.cos(0.1)], atol=1e-4)

    def test_feet_of_several_kinds_go_together(self, tmp_path: Path) -> None:
        """Four balls on one foot, a box on the other: each touches at its own lower edge."""
        robot = bodies(tmp_path)["six hinges and soles"]
        up = about("y", 0.1).T @ UP
        arms = ContactPoints(robot.legs, 0.0005).arms(robot.default_pose, up)
        balls = np.array([0.07, 0.0, 0.0]) - 0.012 * up  # toes, 0.1 m from the ankle, 0.03 m to the middle
        np.testing.assert_allclose(arms, [balls, [0.09, 0.0, -0.01]], atol=1e-4)

    def test_the_thickest_of_level_balls_touches(self) -> None:
        balls = FootBalls(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), np.array([0.01, 0.03]))
        legs = SimpleNamespace(balls=[balls], count=1, turn=lambda _: np.eye(3)[None])
        arms = ContactPoints(legs, 0.001).arms(np.zeros(0), UP)  # type: ignore[arg-type]
        np.testing.assert_allclose(arms, [[0.1, 0.0, -0.03]], atol=1e-6)

    def test_what_a_foot_touches_with(self) -> None:
        """A ball, both ends of a tilted capsule, the corners of a turned box: on its own axes, by scipy."""
        model = mujoco.MjModel.from_xml_string(
            """<mujoco><worldbody><body><freejoint/>
            <geom type="sphere" size="0.02" pos="0.1 0 0" mass="1"/>
            <geom type="capsule" size="0.01" fromto="-0.01 -0.05 0.18 0.03 0.05 0.22"/>
            <geom type="box" size="0.03 0.02 0.01" euler="20 0 50"/>
            </body></worldbody></mujoco>"""
        )
        tip = np.array([0.1, 0.0, 0.0])
        ball, ends, corners = (foot_balls(model, np.array([geom]), tip) for geom in range(3))
        np.testing.assert_allclose(ball.place, [[0.0, 0.0, 0.0]])
        assert ball.radius.tolist() == [0.02]
        np.testing.assert_allclose(sorted(ends.place.tolist()), [[-0.11, -0.05, 0.18], [-0.07, 0.05, 0.22]])
        assert ends.radius.tolist() == [0.01, 0.01]
        turn = Rotation.from_euler("XYZ", [20, 0, 50], degrees=True)
        edges = turn.apply(list(product((-0.03, 0.03), (-0.02, 0.02), (-0.01, 0.01)))) - tip
        np.testing.assert_allclose(sorted(corners.place.tolist()), sorted(edges.tolist()), atol=1e-12)
        assert not corners.radius.any()
        together = foot_balls(model, np.arange(3), tip)
        assert together.radius.tolist() == [0.02, 0.01, 0.01, *[0.0] * 8]

    def test_a_mesh_touches_with_the_corners_of_its_box(self) -> None:
        """Which is about the mesh, not about its centre of mass: it holds all vertices, and no less would."""
        model = mujoco.MjModel.from_xml_string(
            """<mujoco><asset><mesh name="wedge" vertex="0.1 0 0  0.4 0 0  0.1 0.2 0  0.1 0 0.3"/></asset>
            <worldbody><body><freejoint/><geom type="mesh" mesh="wedge" pos="1 2 3" euler="20 0 50"/>
            </body></worldbody></mujoco>"""
        )
        turn = Rotation.from_quat(model.geom_quat[0], scalar_first=True)
        corners = foot_balls(model, np.array([0]), np.zeros(3)).place - model.geom_pos[0]
        across = turn.inv().apply(corners)
        np.testing.assert_allclose(across.min(axis=0), model.mesh_vert.min(axis=0), atol=1e-7)
        np.testing.assert_allclose(across.max(axis=0), model.mesh_vert.max(axis=0), atol=1e-7)


# -- drift -------------------------------------------------------------------------------------------


def walked(config: OdometryConfig, velocity: tuple[float, float], time_s: float) -> Drift:
    drift = Drift(config)
    for _ in range(round(time_s / 0.001)):
        drift.advance([*velocity, 0.3], 0.001)
    return drift


NO_DRIFT = OdometryConfig(orientation_noise=0.0, yaw_drift=0.0, scale_error=0.0, climb_error=0.0, slip=0.0)


class TestDrift:
    def test_yaw_that_drifts_turns_the_way(self) -> None:
        """Straight at v, yaw a random walk of q: variances q^2 T of the yaw, v^2 q^2 T^3 / 3 across."""
        drift = walked(OdometryConfig(**{**vars(NO_DRIFT), "yaw_drift": 0.01}), (0.0, 0.5), 8.0)
        found = drift.covariance(np.array([0.0, 4.0, 0.0]))
        assert found[YAW, YAW] == pytest.approx(8e-4)
        assert found[0, 0] == pytest.approx(0.25e-4 * 8**3 / 3, rel=2e-3)
        assert found[0, YAW] == found[YAW, 0] == pytest.approx(-0.5e-4 * 8**2 / 2, rel=2e-3)
        np.testing.assert_allclose([found[1, 1], found[0, 1], found[1, YAW], found[2, 2]], 0.0, atol=1e-12)

    def test_it_is_the_same_whichever_way_one_walks(self) -> None:
        config = OdometryConfig(**{**vars(NO_DRIFT), "yaw_drift": 0.02})
        angle, along = 0.7, walked(config, (0.5, 0.0), 3.0).covariance(np.zeros(3))
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        oblique = walked(config, (0.5 * np.cos(angle), 0.5 * np.sin(angle)), 3.0).covariance(np.zeros(3))
        np.testing.assert_allclose(oblique, turn @ along @ turn.T, atol=1e-12)

    def test_a_wrong_scale_is_a_share_of_the_displacement(self) -> None:
        drift = Drift(OdometryConfig(**{**vars(NO_DRIFT), "scale_error": 0.02}))
        moved = np.array([3.0, -4.0, 0.0])
        np.testing.assert_allclose(
            drift.covariance(moved)[:3, :3], 0.0004 * np.outer(moved, moved), atol=1e-15
        )

    def test_slips_add_up_with_the_way_not_with_the_displacement(self) -> None:
        """There and back, 2 x 1.5 m: three metres."""
        drift = Drift(OdometryConfig(**{**vars(NO_DRIFT), "slip": 0.02, "climb_error": 0.1}))
        for speed in (0.5, -0.5):
            for _ in range(300):
                drift.advance([speed, 0.0, 0.0], 0.01)
        found = drift.covariance(np.zeros(3))
        np.testing.assert_allclose(np.diag(found), [0.0012, 0.0012, 0.0012 + 0.09, 0.0])


# -- late readings -----------------------------------------------------------------------------------


class TestLateness:
    def swayed(self, late_s: float, frequency_hz: float = 2.0) -> Lateness:
        """After a second at 0.5 m/s ahead, 0.1 m/s of sway to the left and right."""
        lateness = Lateness(OdometryConfig(latency_s=late_s, latency_filter_s=0.5))
        for tick in range(4000):
            angle = math.tau * frequency_hz * 0.001 * tick
            lateness.advance([0.5, 0.1 * math.sin(angle), 0.0], 0.001)
        return lateness

    def test_a_velocity_that_stays_is_as_sure_as_if_it_were_not_late(self) -> None:
        np.testing.assert_array_equal(self.swayed(0.01).covariance[0], 0.0)

    def test_one_that_sways_is_off_by_its_acceleration_times_the_lateness(self) -> None:
        """Mean square of 0.01 s times 0.1 w cos w t, w = 4 pi: (0.01 * 1.257)^2 / 2 m^2/s^2."""
        assert self.swayed(0.01).covariance[1, 1] == pytest.approx((0.01 * 0.4 * math.pi) ** 2 / 2, rel=0.1)

    def test_changes_along_several_axes_go_together(self) -> None:
        """One that changes by 1, -2 and 3 along x, y and z has their products for covariances."""
        ways, lateness = np.array([1.0, -2.0, 3.0]), Lateness(OdometryConfig())
        for tick in range(100):
            lateness.advance((math.sin(0.1 * tick) * ways).tolist(), 0.002)
        found = lateness.covariance
        assert found[0, 0] > 0.0
        np.testing.assert_allclose(found, found[0, 0] * np.outer(ways, ways))

    def test_it_is_the_mean_square_of_what_a_filter_lags_behind(self) -> None:
        """A leap of 1 m/s, late by 3 ms: in ticks of 1 ms it lags by 3/4 at first; a tenth of that counts."""
        lateness = Lateness(OdometryConfig(latency_s=0.003, latency_filter_s=0.009))
        lateness.advance([0.0, 0.0, 0.0], 0.001)
        lateness.advance([0.0, 0.0, 1.0], 0.001)
        assert lateness.covariance[2, 2] == pytest.approx(0.1 * 0.75**2)
        lateness.advance([0.0, 0.0, 1.0], 0.001)
        assert lateness.covariance[2, 2] == pytest.approx(0.9 * 0.1 * 0.75**2 + 0.1 * 0.75**4)

    def test_readings_that_are_not_late_add_nothing(self) -> None:
        np.testing.assert_allclose(self.swayed(0.0).covariance, 0.0, atol=1e-30)

    def test_it_begins_anew(self) -> None:
        lateness = self.swayed(0.01)
        lateness.reset()
        lateness.advance([9.0, 9.0, 9.0], 0.001)
        assert not lateness.covariance.any()
