"""Where a policy acts: loop, joint layer, motor drivers, bus, safety, log, simulated robot."""
