"""Hand-written controllers. Their settings for a robot are in its `controllers.yaml`.

- `stand.py`, `walk/` (all gaits), `mpc/`: the controllers, each with the dataclass of its settings.
- `gait.py`: gait clock, contact schedule and swing curves; `command.py`: rate-limited velocity commands;
  `stance.py`: positions of standing feet, and how they level a tilted base.
"""
