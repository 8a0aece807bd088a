"""Execution on a robot: control loop, joint layer, drivers, buses, supervisor, estimator, log, replay."""
