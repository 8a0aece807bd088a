"""Walking by capture-point footsteps, on whole-body control."""

from footfall.policies.controllers.step.controller import Step

__all__ = ["Step"]
