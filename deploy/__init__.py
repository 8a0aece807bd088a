"""Where a policy acts: control loop, joint layer, drivers, buses, supervisor, estimator, log, replay."""
