"""Linear Kalman filter for position, velocity and bias of the IMU, with accelerometer and stance legs.

As in Bloesch et al. 2012 ("State estimation for legged robots: consistent fusion of leg kinematics and IMU")
the accelerometer predicts and the legs correct. The orientation is the IMU's, so the filter is linear. All
noise is isotropic: the three axes share one 3 by 3 covariance of six numbers. A leg measures the velocity of
its contact point relative to the IMU. Anchors on the ground would only add states, because motors report
velocities.

It uses Python floats: for so few numbers they take a fraction of NumPy's time.
"""

from collections.abc import Sequence

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.estimation.config import FilterConfig

_AT_REST_M_S = 0.1  # standard deviation of the velocity after a reset

Vector = list[float]  # x, y, z
Matrix = list[list[float]]  # three rows


class MotionFilter:
    """State per world axis: position p, velocity v, and accelerometer bias b (b in the body's axes)."""

    def __init__(self, config: FilterConfig) -> None:
        self._config = config
        self._leg_variance = config.leg_velocity_noise**2
        self._min_share = 1.0 / config.swing_noise
        self._push_variance = config.push_m_s**2 / 3.0
        self.reset()

    def reset(self) -> None:
        """Start at rest, at position zero."""
        self.position = self.velocity = self.bias = [0.0, 0.0, 0.0]
        self._mean_innovation = [0.0, 0.0, 0.0]
        self._last: tuple[float, ...] | None = None  # last reading, and the acceleration from it in the world
        self.pp = self.pv = self.pb = self.vb = 0.0
        self.vv, self.bb = _AT_REST_M_S**2, self._config.acceleration_bias**2

    def set_position(self, position: Vector) -> None:
        """Set the position, m, without uncertainty, and keep the estimated motion."""
        self.position = position
        self.pp = self.pv = self.pb = 0.0

    def predict(self, specific_force: Vector, rotation: Matrix, dt_s: float) -> None:
        """p' = p + v dt + a dt^2 / 2, v' = v + a dt with the mean acceleration a between two readings.

        The noise grows with their difference, because shocks are sampled badly.

        Args:
            specific_force: reading of the accelerometer, m/s^2.
            rotation: body to world.
            dt_s: time between the two readings.
        """
        config = self._config
        (fx, fy, fz), (bx, by, bz) = specific_force, self.bias
        sx, sy, sz = fx - bx, fy - by, fz - bz
        ax, ay, az = [row_x * sx + row_y * sy + row_z * sz for row_x, row_y, row_z in rotation]
        az -= GRAVITY_M_S2
        if self._last is None:
            self._last = fx, fy, fz, ax, ay, az
        last_fx, last_fy, last_fz, last_ax, last_ay, last_az = self._last
        self._last = fx, fy, fz, ax, ay, az
        change = ((fx - last_fx) ** 2 + (fy - last_fy) ** 2 + (fz - last_fz) ** 2) / 3.0
        ax, ay, az = 0.5 * (ax + last_ax), 0.5 * (ay + last_ay), 0.5 * (az + last_az)
        (px, py, pz), (vx, vy, vz), half = self.position, self.velocity, 0.5 * dt_s
        self.position = [
            px + dt_s * (vx + half * ax),
            py + dt_s * (vy + half * ay),
            pz + dt_s * (vz + half * az),
        ]
        self.velocity = [vx + dt_s * ax, vy + dt_s * ay, vz + dt_s * az]
        noise = config.acceleration_noise**2 + config.acceleration_change**2 * change
        # F P F' + Q of p' = p + v dt, v' = v - b dt.
        self.pp += dt_s * (2.0 * self.pv + dt_s * self.vv)
        self.pv += dt_s * (self.vv - self.pb - dt_s * self.vb)
        self.pb += dt_s * self.vb
        self.vv += dt_s * (dt_s * (self.bb + noise) - 2.0 * self.vb)
        self.vb -= dt_s * self.bb
        self.bb += dt_s * config.acceleration_bias_drift**2

    def correct(
        self, velocities: Sequence[Vector], contact: Sequence[float], rotation: Matrix, dt_s: float
    ) -> None:
        """Correct with the legs' velocities, each weighted by its contact and by its agreement.

        A leg that disagrees slips or has not fully landed: noise with Student's t distribution reduces its
        weight. If all stance legs together disagree for a while, the filter is wrong: a push was too
        short for the accelerometer. The uncertainty of its velocity is then increased accordingly.

        Args:
            velocities: measurements of v, one per leg, m/s.
            contact: probability that each leg is in stance.
            rotation: body to world.
            dt_s: time since the last correction.
        """
        config = self._config
        vx, vy, vz = self.velocity
        total = sum_x = sum_y = sum_z = 0.0
        for (leg_x, leg_y, leg_z), probability in zip(velocities, contact, strict=True):
            x, y, z = leg_x - vx, leg_y - vy, leg_z - vz
            variance = self._leg_variance / max(probability * probability, self._min_share) ** 2
            misfit = (x * x + y * y + z * z) / (3.0 * (self.vv + variance))
            certainty = 1.0 / (variance * (1.0 + misfit / config.outlier_freedom))
            total += certainty
            sum_x, sum_y, sum_z = sum_x + certainty * x, sum_y + certainty * y, sum_z + certainty * z
        innovation = [sum_x / total, sum_y / total, sum_z / total]
        self._look_for_push(innovation, max(contact), dt_s)

        variance = self.vv + 1.0 / total
        kp, kv, kb = self.pv / variance, self.vv / variance, self.vb / variance
        x, y, z = innovation
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
        (px, py, pz), (vx, vy, vz), (bx, by, bz) = self.position, self.velocity, self.bias
        self.position = [px + kp * x, py + kp * y, pz + kp * z]
        self.velocity = [vx + kv * x, vy + kv * y, vz + kv * z]
        self.bias = [  # in body axes
            bx + kb * (xx * x + yx * y + zx * z),
            by + kb * (xy * x + yy * y + zy * z),
            bz + kb * (xz * x + yz * y + zz * z),
        ]
        # P - K P_v, whose row is proportional to K; entries of v last.
        self.pp -= kp * self.pv
        self.pb -= kp * self.vb
        self.bb -= kb * self.vb
        self.pv -= kv * self.pv
        self.vb -= kv * self.vb
        self.vv -= kv * self.vv

    def _look_for_push(self, innovation: Vector, contact: float, dt_s: float) -> None:
        share = min(1.0, dt_s / self._config.push_filter_s)
        (x, y, z), (ix, iy, iz) = self._mean_innovation, innovation
        x += share * (contact * ix - x)
        y += share * (contact * iy - y)
        z += share * (contact * iz - z)
        self._mean_innovation = [x, y, z]
        self.vv += max(0.0, (x * x + y * y + z * z) / 3.0 - self._push_variance)
