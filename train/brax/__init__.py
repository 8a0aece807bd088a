"""Training with brax's PPO: one iteration as one compiled function, on any number of devices."""
