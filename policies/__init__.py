"""Policies: everything that turns readings into joint commands.

- `policy.py`: the interface that all policies share; `registry.py`: from a name to a policy.
- `contract.py`, `observation.py`, `action.py`, `learned.py`: learned policies; `zoo/` holds trained ones.
- `controllers/`: hand-written policies: standing, a gait generator, convex MPC.
"""
