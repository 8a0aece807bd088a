"""Jump on command: crouch, push, flight with tucked feet, landing on compliant legs."""

from footfall.policies.controllers.jump.controller import Jump

__all__ = ["Jump"]
