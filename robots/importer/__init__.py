"""Makes a robot folder from another maker's URDF or MJCF."""
