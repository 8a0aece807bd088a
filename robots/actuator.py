"""The joint law: the torque that a motor delivers for a command.

It works on NumPy and JAX arrays. The MJX environment applies it at each physics step, the
simulated motor applies it behind the bus, and the joint layer predicts torque with it.
"""

from typing import Any, NamedTuple

from footfall.common.arrays import clamped, library

Array = Any  # a NumPy or a JAX array


class JointCommand(NamedTuple):
    """The content of a motor command: five arrays in joint order, shape (..., n)."""

    position: Array  # rad
    velocity: Array  # rad/s
    kp: Array  # N m/rad
    kd: Array  # N m s/rad
    torque: Array  # N m, feed-forward

    @classmethod
    def of(cls, values: Array) -> "JointCommand":
        """The command with the rows of an array (5, ..., n). Unpacking would take twice as long."""
        return cls(values[0], values[1], values[2], values[3], values[4])


class Motor(NamedTuple):
    """Limits and losses of motors, seen at the joint: arrays that broadcast to (..., n).

    An optional effect is None if no joint has it, and is then not computed.
    """

    peak_torque: Array  # N m, the current limit
    stall_torque: Array  # N m, on the torque-speed line at zero speed
    no_load_speed: Array  # rad/s
    friction: Array  # N m, Coulomb friction when fully developed
    friction_speed: Array  # rad/s at which Coulomb friction is fully developed
    damping: Array  # N m s/rad, viscous
    strength: Array | None  # delivered torque over commanded torque; 1 or None for a nominal motor
    lag_s: Array | None = None  # time constant of the torque, a first-order lag; 0: no lag
    stribeck: Array | None = None  # N m, friction at rest beyond Coulomb friction
    # rad/s, speed at which half of `stribeck` remains; None: STRIBECK_RAMPS friction speeds
    stribeck_speed: Array | None = None
    load_friction: Array | None = None  # share of the motor torque that friction takes
    backlash: Array | None = None  # rad, whole play of the gearbox
    compliance: Array | None = None  # rad/(N m), of the gearbox
    # Of a motor whose command sets a voltage: supply over nominal voltage. 0: the command sets a current.
    voltage_gain: Array | None = None
    # Of a voltage-driven motor: share by which the resistance at full duty exceeds that at rest.
    duty_resistance: Array | None = None


def weaker(motor: Motor, share: float) -> Motor:
    """The motor with its torque limits scaled by `share`, 0 to 1, at all speeds."""
    return motor._replace(peak_torque=share * motor.peak_torque, stall_torque=share * motor.stall_torque)


def at_supply(motor: Motor, share: Array) -> Motor:
    """The motor with its supply voltage scaled by `share`.

    Stall torque and no-load speed scale with it, and so does the torque of a voltage-driven motor.
    """
    gain = motor.voltage_gain
    return motor._replace(
        stall_torque=share * motor.stall_torque,
        no_load_speed=share * motor.no_load_speed,
        voltage_gain=None if gain is None else share * gain,
    )


STRIBECK_RAMPS = 5.0  # default Stribeck speed, in friction speeds


class Lag(NamedTuple):
    """A first-order lag over one time step: weights of the torque before the step, (..., n)."""

    at_end: Array  # weight in the torque at the end of the step
    in_mean: Array  # weight in the step's mean torque


def lag_over(lag_s: Array, step_s: float) -> Lag:
    """The exact first-order lag of a torque demand that is constant over a step.

    T f' = u - f has f(t) = u + (f(0) - u) exp(-t / T); its mean over a step h is
    u + (f(0) - u) (T / h) (1 - exp(-h / T)).

    Args:
        lag_s: time constants T, (..., n); 0 for no lag.
        step_s: length h of the step.
    """
    xp = library(lag_s)
    lag_s = xp.maximum(lag_s, 1e-6 * step_s)  # a step of a million time constants means no lag
    at_end = xp.exp(-step_s / lag_s)
    return Lag(at_end, (lag_s / step_s) * (1.0 - at_end))


def lagged(demand: Array, previous: Array, lag: Lag) -> tuple[Array, Array]:
    """The mean torque over a step and the torque at its end, N m, (..., n).

    Args:
        demand: torque that the motor approaches in this step, N m.
        previous: torque at the beginning of the step, N m.
        lag: lag of the step.
    """
    change = previous - demand
    return demand + lag.in_mean * change, demand + lag.at_end * change


def pd_torque(command: JointCommand, position: Array, velocity: Array) -> Array:
    """Torque of the motor's PD law, N m, before any limit. Shapes (..., n)."""
    return (
        command.kp * (command.position - position)
        + command.kd * (command.velocity - velocity)
        + command.torque
    )


def limit_torque(torque: Array, velocity: Array, motor: Motor) -> Array:
    """Torque that a DC motor can deliver at this speed, N m. Shapes (..., n).

    A current limit caps torque at low speed. The supply voltage minus the back-EMF caps it along the line
    from stall torque to no-load speed, in the direction of motion only; past the no-load speed the motor
    can only brake. The current limit holds there too, so it is applied last.
    """
    lower, upper = _supply_range(velocity, motor)
    return clamped(clamped(torque, lower, upper), -motor.peak_torque, motor.peak_torque)


def _supply_range(velocity: Array, motor: Motor) -> tuple[Array, Array]:
    """Least and greatest torque that the supply voltage allows at this speed, N m."""
    speed = velocity / motor.no_load_speed
    return motor.stall_torque * (-1.0 - speed), motor.stall_torque * (1.0 - speed)


def friction_torque(velocity: Array, motor: Motor, load: Array | None = None) -> Array:
    """Torque lost in the gearbox, N m, opposing motion: dry friction, ramped through zero, and viscous.

    Args:
        velocity: joint velocities, rad/s.
        motor: the motors' parameters.
        load: motor torque that the gearbox transmits, N m; None: without load friction.
    """
    upper = _dry_friction(velocity, motor, load)
    lower = -upper
    coulomb = clamped(lower * (velocity / motor.friction_speed), lower, upper)
    return coulomb - motor.damping * velocity


def _dry_friction(velocity: Array, motor: Motor, load: Array | None) -> Array:
    """Dry friction beyond the ramp, N m: Coulomb, Stribeck and a share of the load.

    The Stribeck part falls with speed as 1 / (1 + (v / v_s)^2): Hess and Soom, Journal of Tribology 112
    (1990), 147-152.
    """
    dry = motor.friction
    if motor.stribeck is not None:
        half_speed = motor.stribeck_speed
        relative = velocity / (STRIBECK_RAMPS * motor.friction_speed if half_speed is None else half_speed)
        dry = dry + motor.stribeck / (1.0 + relative * relative)
    if motor.load_friction is not None and load is not None:
        dry = dry + motor.load_friction * library(velocity).abs(load)
    return dry


def motor_torque(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Electromagnetic torque at the joint, N m: the PD law within the motor's limits, shape (..., n).

    A lag is not included: it needs the previous torque (`lagged`).
    """
    return limit_torque(_demand(command, position, velocity, motor), velocity, motor)


def _demand(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Torque that the command demands of the motor at this speed, N m, before the motor's limits."""
    torque_demand = _requested(command, position, velocity, motor)
    if motor.voltage_gain is None:
        return torque_demand
    return library(velocity).where(
        motor.voltage_gain > 0.0, _voltage_driven_torque(torque_demand, velocity, motor), torque_demand
    )


def _requested(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Torque that the PD law demands through the gearbox, N m."""
    if motor.backlash is None and motor.compliance is None:
        return _delivered_share(pd_torque(command, position, velocity), motor)
    return _delivered_share(_through_gear(command, position, velocity, motor), motor)


def _delivered_share(requested: Array, motor: Motor) -> Array:
    """The part of a torque or a damping that the motor delivers."""
    return requested if motor.strength is None else requested * motor.strength


def _duty(torque_demand: Array, motor: Motor) -> Array:
    """Share of the supply's voltage, -1 to 1, that a voltage-driven motor sets for a torque demand, N m."""
    return clamped(torque_demand * motor.voltage_gain / motor.stall_torque, -1.0, 1.0)


def _voltage_driven_torque(torque_demand: Array, velocity: Array, motor: Motor) -> Array:
    """Torque of a voltage-driven motor for the PD law's demand `torque_demand`, N m, minus its back-EMF."""
    duty = _duty(torque_demand, motor)
    return motor.stall_torque * (duty - velocity / motor.no_load_speed) * _conductance(duty, motor)


def _conductance(duty: Array, motor: Motor) -> Array | float:
    """Conductance of a voltage-driven motor over that at rest: 1 / (1 + r |duty|), duty from -1 to 1.

    A real servo's torque at full duty follows from recordings at smaller duties only with |duty|. With its
    square, the predicted torque is too small (docs/measurements.yaml, recordings-xl330).
    """
    if motor.duty_resistance is None:
        return 1.0
    return 1.0 / (1.0 + motor.duty_resistance * library(duty).abs(duty))


def _through_gear(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Torque of the PD law through a gearbox with play and compliance, N m.

    The loop is closed on the rotor's encoder, and the rotor follows without inertia (the joint has the
    reflected inertia). With gear stiffness k and play b, a rotor at x from the joint has

        kp (e - x) + ff = k dead_zone(x, b / 2),  e = position error of the joint,

    so the joint gets dead_zone(kp e + ff, kp b / 2) / (1 + kp / k). Damping acts through two such shares,
    to first order in the frequency, and not while the rotor is within the play.
    """
    spring = command.kp * (command.position - position) + command.torque
    damping = _engaged_damping(command, position, motor)
    if motor.backlash is not None:
        half = 0.5 * command.kp * motor.backlash
        spring = spring - clamped(spring, -half, half)
    if motor.compliance is not None:
        spring = spring / (1.0 + command.kp * motor.compliance)
    return spring + damping * (command.velocity - velocity)


def _engaged_damping(command: JointCommand, position: Array, motor: Motor) -> Array:
    """Damping that reaches the joint through the gearbox, N m s/rad; see `_through_gear`."""
    damping = command.kd
    if motor.backlash is not None:
        spring = command.kp * (command.position - position) + command.torque
        xp, half = library(spring), 0.5 * command.kp * motor.backlash
        damping = xp.where(xp.abs(spring) < half, 0.0, damping)
    if motor.compliance is not None:
        share = 1.0 / (1.0 + command.kp * motor.compliance)
        damping = damping * share * share
    return damping


def joint_torque(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Torque that reaches the joint, N m: `motor_torque` minus friction, shape (..., n).

    Args:
        command: the command.
        position: joint positions, rad.
        velocity: joint velocities, rad/s.
        motor: the motors' parameters.
    """
    torque = motor_torque(command, position, velocity, motor)
    return torque + friction_torque(velocity, motor, torque)


def joint_damping(
    command: JointCommand, position: Array, velocity: Array, motor: Motor, lag: Lag | None = None
) -> Array:
    """Damping of `joint_torque`, N m s/rad: minus its derivative in velocity, (..., n).

    It is the sum of three parts: kd within the limits, the slope of the torque-speed line on that line and
    nothing at the current limit; the ramp of dry friction at low speed; viscous friction. Long physics steps
    integrate it implicitly (envs/physics/interface.py).

    With a lag, only the share of the motor's part that reaches the step's mean torque counts. The change of
    friction with load and the fall of Stribeck friction with speed stay in the explicit part.
    """
    xp = library(velocity)
    torque_demand = _demand(command, position, velocity, motor)
    peak = motor.peak_torque
    lower, upper = (bound.clip(-peak, peak) for bound in _supply_range(velocity, motor))
    limit = xp.where(torque_demand > upper, upper, lower)
    line = motor.stall_torque / motor.no_load_speed
    limit_damping = xp.where(xp.abs(limit) < motor.peak_torque, line, 0.0)
    demand_damping = _delivered_share(_engaged_damping(command, position, motor), motor)
    if motor.voltage_gain is not None:
        gain, duty = motor.voltage_gain, _duty(_requested(command, position, velocity, motor), motor)
        slope = xp.where(xp.abs(duty) < 1.0, demand_damping * gain, 0.0) + line
        demand_damping = xp.where(gain > 0.0, slope * _conductance(duty, motor), demand_damping)
    delivered = xp.where((torque_demand > upper) | (torque_demand < lower), limit_damping, demand_damping)
    if lag is not None:
        delivered = delivered * (1.0 - lag.in_mean)
    dry = _dry_friction(velocity, motor, torque_demand.clip(lower, upper))
    ramp = xp.where(xp.abs(velocity) < motor.friction_speed, dry / motor.friction_speed, 0.0)
    return delivered + ramp + motor.damping
