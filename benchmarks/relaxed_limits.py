"""Settings of the loop with relaxed time limits, for machines that stall: lost time is not a fault.

A benchmark or a test of one of these limits sets its own value.
"""

from footfall.deploy.config import DeployConfig
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.sensor_checks.table import SensorLimits

RELAXED = DeployConfig(
    motor_timeout_s=30.0,
    safety=SafetyConfig(
        start_timeout_s=30.0,
        silence_timeout_s=20.0,
        pause_limit_s=20.0,
        late_limit_s=20.0,
        late_steps=1000,
        skipped_share=1.0,
        sensors=SensorLimits(  # a stalled process also stops the simulated robot and the targets
            drift_rad=3.0,
            wander_rad=3.0,
            creep_rad=3.0,
            stuck_rad=3.0,
            rotation_rad=3.0,
            repeated_rad=3.0,
            torque_stuck=2.0,
            unexplained=10.0,
            lost_share=1.0,
        ),
    ),
)
