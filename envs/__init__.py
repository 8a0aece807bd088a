"""Where a policy learns: the environment and its physics, rewards and commands."""
