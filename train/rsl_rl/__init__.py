"""Training with rsl_rl: upstream's runner on our environment."""
