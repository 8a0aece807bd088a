"""The cockpit: our own page, from which a robot is steered and stopped."""
