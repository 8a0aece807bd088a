"""The cockpit: the page from which a robot is steered and stopped."""
