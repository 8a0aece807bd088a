"""Where a policy learns: the MJX environment, its rewards and commands."""
