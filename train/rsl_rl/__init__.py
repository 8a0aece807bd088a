"""Training with rsl_rl: upstream's runner on footfall's environment."""
