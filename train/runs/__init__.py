"""A run folder and what is written into it: checkpoints, metrics, failures."""
