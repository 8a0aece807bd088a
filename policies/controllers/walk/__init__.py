"""Walking in any named gait, by joint position control."""

from footfall.policies.controllers.walk.controller import Walk

__all__ = ["Walk"]
