"""Hand-written controllers. A robot's settings for them are in its `controllers.yaml`.

- `stand.py`, `walk/` (all gaits), `mpc/`: the controllers, each beside the dataclass of its settings.
- `gait.py`: clock, contact schedule and swing curves; `command.py`: velocity commands at a bounded rate;
  `stance.py`: where feet stand and how they level a tilted base.
"""
