"""Convex model-predictive control of a single rigid body through its feet (Di Carlo et al. 2018)."""

from footfall.policies.controllers.mpc.controller import Mpc

__all__ = ["Mpc"]
