"""From a URDF or MJCF of another maker to a robot folder."""
