"""Makes a robot folder from any URDF or MJCF."""
