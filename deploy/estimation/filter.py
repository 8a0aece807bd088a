"""A linear Kalman filter of the IMU's place, velocity and bias, on the accelerometer and the standing legs.

As in Bloesch et al. 2012 ("State estimation for legged robots: consistent fusion of leg kinematics and IMU")
the accelerometer predicts and the legs correct, with the orientation as the IMU gives it: given that, all is
linear, and since all noise is isotropic the three axes share one 3 by 3 covariance, six plain numbers. Legs
are measured by how fast their points of contact move under the IMU, not by anchors on the ground: with motors
that report velocities, anchors add nothing but their own states.

In Python's own numbers: on so few of them its arithmetic takes a fraction of NumPy's time.
"""

from collections.abc import Sequence

from footfall.deploy.estimation.config import FilterConfig

GRAVITY_M_S2 = 9.81
_AT_REST_M_S = 0.1  # how sure a reset is of the robot's rest

Vector = list[float]  # x, y, z
Matrix = list[list[float]]  # three rows


class MotionFilter:
    """State per world axis: place p, velocity v, and bias b of the accelerometer (b in the body's axes)."""

    def __init__(self, config: FilterConfig) -> None:
        self._config = config
        self._leg_variance = config.leg_velocity_noise**2
        self._least_share = 1.0 / config.swing_noise
        self._push_variance = config.push_m_s**2 / 3.0
        self.reset()

    def reset(self) -> None:
        """Begin at rest, with a place of zero."""
        self.place = self.velocity = self._bias = [0.0, 0.0, 0.0]
        self._surprise = self._acceleration = [0.0, 0.0, 0.0]
        self._force: Vector | None = None
        self.pp = self.pv = self.pb = self.vb = 0.0
        self.vv, self.bb = _AT_REST_M_S**2, self._config.acceleration_bias**2

    def begin_at(self, place: Vector) -> None:
        """Say where it is, m, with certainty. What is known of the motion is kept."""
        self.place = place
        self.pp = self.pv = self.pb = 0.0

    def predict(self, force: Vector, rotation: Matrix, dt_s: float) -> None:
        """p' = p + v dt + a dt^2 / 2, v' = v + a dt with the mean acceleration a between two readings.

        What happened between them is unknown by a share of their difference: shocks are sampled badly.

        Args:
            force: what the accelerometer reads, m/s^2.
            rotation: body to world.
            dt_s: time that passes.
        """
        config = self._config
        x, y, z = (f - b for f, b in zip(force, self._bias, strict=True))
        acceleration = [row[0] * x + row[1] * y + row[2] * z for row in rotation]
        acceleration[2] -= GRAVITY_M_S2
        if self._force is None:
            self._force, self._acceleration = force, acceleration
        change = _square(force, self._force) / 3.0
        mean = [0.5 * (a + b) for a, b in zip(acceleration, self._acceleration, strict=True)]
        self._force, self._acceleration = force, acceleration
        self.place = [
            p + dt_s * (v + 0.5 * dt_s * a) for p, v, a in zip(self.place, self.velocity, mean, strict=True)
        ]
        self.velocity = [v + dt_s * a for v, a in zip(self.velocity, mean, strict=True)]
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
        """Take in what the legs say, each weighted by its contact and by how well it fits.

        A leg that does not fit slips or has not quite landed: noise of Student's distribution forgives it.
        Where all standing legs together do not fit for a while, it was the filter that was wrong: a push too
        short for the accelerometer to see. Its velocity is then uncertain by as much.

        Args:
            velocities: measurements of v, one of each leg, m/s.
            contact: probability that each leg stands.
            rotation: body to world.
            dt_s: time since the last correction.
        """
        config = self._config
        vx, vy, vz = self.velocity
        total = sum_x = sum_y = sum_z = 0.0
        for (leg_x, leg_y, leg_z), stands in zip(velocities, contact, strict=True):
            x, y, z = leg_x - vx, leg_y - vy, leg_z - vz
            variance = self._leg_variance / max(stands * stands, self._least_share) ** 2
            misfit = (x * x + y * y + z * z) / (3.0 * (self.vv + variance))
            certainty = 1.0 / (variance * (1.0 + misfit / config.outlier_freedom))
            total += certainty
            sum_x, sum_y, sum_z = sum_x + certainty * x, sum_y + certainty * y, sum_z + certainty * z
        innovation = [sum_x / total, sum_y / total, sum_z / total]
        self._look_for_push(innovation, max(contact), dt_s)

        variance = self.vv + 1.0 / total
        kp, kv, kb = self.pv / variance, self.vv / variance, self.vb / variance
        x, y, z = innovation
        seen = [rotation[0][k] * x + rotation[1][k] * y + rotation[2][k] * z for k in range(3)]  # by the body
        self.place = [p + kp * i for p, i in zip(self.place, innovation, strict=True)]
        self.velocity = [v + kv * i for v, i in zip(self.velocity, innovation, strict=True)]
        self._bias = [b + kb * i for b, i in zip(self._bias, seen, strict=True)]
        # P - K P_v, a row of which is K's own; v's entries last.
        self.pp -= kp * self.pv
        self.pb -= kp * self.vb
        self.bb -= kb * self.vb
        self.pv -= kv * self.pv
        self.vb -= kv * self.vb
        self.vv -= kv * self.vv

    def _look_for_push(self, innovation: Vector, contact: float, dt_s: float) -> None:
        share = min(1.0, dt_s / self._config.push_filter_s)
        self._surprise = [
            s + share * (contact * i - s) for s, i in zip(self._surprise, innovation, strict=True)
        ]
        x, y, z = self._surprise
        self.vv += max(0.0, (x * x + y * y + z * z) / 3.0 - self._push_variance)


def _square(a: Vector, b: Vector) -> float:
    """Squared distance."""
    x, y, z = (p - q for p, q in zip(a, b, strict=True))
    return x * x + y * y + z * z
