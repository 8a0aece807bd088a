"""The forms that an environment's settings had in older presets, run folders and checkpoints.

Each function takes plain data, complete or partial, and does not change data in today's form.
"""

from typing import Any

from footfall.common.config import merged
from footfall.common.old_keys import with_current_keys

# Sections that became terms: old name, then the list and the name of the term in it.
SECTIONS = {"initial": ("events", "reset_pose"), "pushes": ("events", "push")}
TERMINATIONS = {
    "tilt_limit_rad": ("tilted", "limit_rad"),
    "min_height_share": ("sunk", "min_height_share"),
}
# Settings of `reward_scales`: the reward that each belongs to now, and its parameter.
SCALES = {
    "linear_sigma_m2_s2": ("track_linear", "sigma_m2_s2"),
    "yaw_sigma_rad2_s2": ("track_yaw", "sigma_rad2_s2"),
    "swing_height_m": ("swing_height", "height_m"),
    "foot_distance_m": ("crowded_feet", "distance_m"),
    "pose_shares": ("pose", "joint_shares"),
}
SHARES = {"commands": "commands", "pushes": "push", "randomisation": "randomisation"}  # of `curriculum`


def with_terms(env: Any) -> Any:
    """Settings of an environment, as read from YAML, in today's form.

    A list of terms that was written as settings becomes a mapping by name (see `merged`).
    """
    if not isinstance(env, dict):
        return env
    new = dict(with_current_keys(env))
    for name, (kind, term) in SECTIONS.items():
        if isinstance(new.get(name), dict):
            _put(new, kind, term, {"term": term} | new.pop(name))
    for name, (term, parameter) in TERMINATIONS.items():
        if name in new:
            _put(new, "terminations", term, {parameter: new.pop(name)})
    if isinstance(new.get("reward_scales"), dict):
        _put_scales(new, new.pop("reward_scales"))
    if isinstance(new.get("curriculum"), dict):
        _put_curriculum(new, new.pop("curriculum"))
    if isinstance(new.get("observation"), list):
        new["observation"] = [_observation(term) for term in new["observation"]]
    return new


def with_current_state(saved: Any) -> Any:
    """A saved training state, as nested mappings, with the parts that environments have today."""
    if not isinstance(saved, dict):
        return saved
    current = {key: with_current_state(value) for key, value in saved.items()}
    if "push_steps" in current:
        current["event_steps"] = {"push": current.pop("push_steps")}
        current["terms"] = {"rewards": {}, "terminations": {}, "critic": {}}
    if "frames" in current and "recent_readings" in current:
        current["history"] = current.pop("frames")
    if "asked" in current and "piece" in current:  # progress on a piece of ground
        current["commanded"] = current.pop("asked")
    return current


def _put_scales(env: dict[str, Any], scales: dict[str, Any]) -> None:
    """Put each setting of `reward_scales` into the reward that it belongs to."""
    for name, value in scales.items():
        if name == "least":
            env["reward_floor"] = value
        elif name in SCALES:
            reward, parameter = SCALES[name]
            _put(env, "rewards", reward, {parameter: value})
        else:
            env["reward_scales"] = {name: value}  # refused later as unknown


def _put_curriculum(env: dict[str, Any], curriculum: dict[str, Any]) -> None:
    """Put each setting of `curriculum` into a list of curricula."""
    for name, value in curriculum.items():
        if name == "steps":
            env["curriculum_steps"] = value
        else:
            of = SHARES.get(name, name)
            _put(env, "curricula", of, {"term": "linear", "of": of, "start": value})


def _put(env: dict[str, Any], kind: str, name: str, settings: dict[str, Any]) -> None:
    """Add settings to a term of a list that is written as a mapping."""
    listed = env.get(kind) or {}
    if isinstance(listed, dict) and not isinstance(listed.get(name, {}), dict):
        listed = listed | {name: {"weight": listed[name]}}
    env[kind] = merged(listed, {name: settings})


def _observation(term: Any) -> Any:
    if isinstance(term, dict) and "name" in term and "term" not in term:
        return {"term": term["name"]} | {key: value for key, value in term.items() if key != "name"}
    return term
