"""A jump ahead on command: crouch, push, flight with drawn-up feet, a landing on compliant legs."""

from footfall.policies.controllers.jump.controller import Jump

__all__ = ["Jump"]
