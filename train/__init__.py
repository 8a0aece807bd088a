"""How a policy learns: PPO, checkpoints, export."""
