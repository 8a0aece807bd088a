"""A run folder and its files: checkpoints, metrics, failures."""
