"""Whole runs in lockstep time: orderly runs, runs with pushes, and runs with a failure."""

import numpy as np
import pytest
from deploy_policies import Hold, short_episode

from footfall import Robot, Trace, run_episode
from footfall.deploy.config import DeployConfig


@pytest.fixture(scope="module")
def trace(go1: Robot) -> Trace:
    """An orderly run."""
    return run_episode(go1, Hold(go1), short_episode(ground_truth=True))


class TestOrderlyRun:
    def test_an_orderly_run_ends_idle_and_is_recorded_at_the_record_rate(self, trace: Trace) -> None:
        assert (trace.final_state, trace.faults, trace.fell, trace.fall_reason) == ("IDLE", (), False, "")
        np.testing.assert_allclose(trace.time_s, np.arange(101) / 100, atol=1e-9)
        assert len(trace.compute_ms) == 51

    def test_ground_truth_reaches_the_policy(self, trace: Trace) -> None:
        np.testing.assert_allclose(trace.estimated_velocity, trace.base_velocity, atol=1e-9)
        assert trace.estimated_height[-1] == pytest.approx(trace.base_position[-1, 2], abs=0.03)


def test_a_bus_too_small_for_its_motors_overflows_into_an_emergency_stop(go1: Robot) -> None:
    trace = run_episode(go1, Hold(go1), short_episode(config=DeployConfig(host_queue=2)))
    assert trace.final_state == "ESTOP"
    assert "bus overflow" in trace.faults[0]
