"""Walking in any named gait, by position control of the joints."""

from footfall.policies.controllers.walk.controller import Walk

__all__ = ["Walk"]
