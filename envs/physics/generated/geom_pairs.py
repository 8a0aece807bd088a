"""Pairs of geoms that can touch, with the parameters of their contact.

MuJoCo: its documentation, chapter Computation, section Parameters.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.robots.self_contact import adjacent, excluded_bodies

PLANE, SPHERE, CAPSULE, BOX = (
    mujoco.mjtGeom.mjGEOM_PLANE,
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_BOX,
)
GENERATED = {(PLANE, shape) for shape in (SPHERE, CAPSULE, BOX)} | {
    (SPHERE, SPHERE),
    (SPHERE, CAPSULE),
    (CAPSULE, CAPSULE),
}
SMOOTH, SLIDING = 1, 3  # dimensions of a contact: its normal, and friction along the surface
MIN_FRICTION = 1e-5  # MuJoCo's mjMINMU
TINY = 1e-15  # MuJoCo's mjMINVAL


class GeomPair(NamedTuple):
    """Two geoms that can touch, in the order of their types, and the parameters of their contact."""

    geoms: tuple[int, int]
    dimensions: int
    solref: tuple[float, ...]
    solimp: tuple[float, ...]
    margin: float  # m; contacts in a gap beyond the margin have no force
    friction: tuple[float, float] | None  # None: the geoms' own


def geom_pairs(model: mujoco.MjModel) -> list[GeomPair]:
    """All pairs of geoms that MuJoCo would test for contact."""
    pairs = [_declared(model, pair) for pair in range(model.npair)]
    declared = {geom_pair.geoms for geom_pair in pairs}
    excluded = excluded_bodies(model)
    for a, b in combinations(range(model.ngeom), 2):
        geoms = _by_type(model, a, b)
        if geoms not in declared and _can_touch(model, a, b, excluded):
            pairs.append(_mixed(model, geoms))
    return pairs


def contact_refusals(model: mujoco.MjModel) -> Iterator[str]:
    """Contacts of a model that the generator does not support, one line each."""
    for geom_pair in geom_pairs(model):
        names = " and ".join(repr(model.geom(g).name or f"geom {g}") for g in geom_pair.geoms)
        kinds = tuple(mujoco.mjtGeom(model.geom_type[g]) for g in geom_pair.geoms)
        if kinds not in GENERATED:
            shapes = " and ".join(kind.name[7:].lower() for kind in kinds)
            yield f"contact of {names}: {shapes}"
        elif geom_pair.dimensions not in {SMOOTH, SLIDING}:
            yield f"contact of {names}: condim {geom_pair.dimensions}"
        elif geom_pair.solimp[4] not in {1.0, 2.0}:
            yield f"contact of {names}: solimp's power {geom_pair.solimp[4]:g}"
        elif kinds[0] == PLANE and model.body_weldid[model.geom_bodyid[geom_pair.geoms[0]]] != 0:
            yield f"contact of {names}: a plane that moves"


def _by_type(model: mujoco.MjModel, a: int, b: int) -> tuple[int, int]:
    return (a, b) if model.geom_type[a] <= model.geom_type[b] else (b, a)


def _can_touch(model: mujoco.MjModel, a: int, b: int, excluded: set[tuple[int, int]]) -> bool:
    """MuJoCo's filters: contact bits, excluded pairs, bodies that are welded or parent and child."""
    bits = (model.geom_contype[a] & model.geom_conaffinity[b]) | (
        model.geom_contype[b] & model.geom_conaffinity[a]
    )
    bodies = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
    return bool(bits) and not adjacent(model, *bodies) and tuple(bodies) not in excluded


def _declared(model: mujoco.MjModel, pair: int) -> GeomPair:
    geoms = _by_type(model, int(model.pair_geom1[pair]), int(model.pair_geom2[pair]))
    first, second = model.pair_friction[pair][:2].tolist()
    return GeomPair(
        geoms,
        int(model.pair_dim[pair]),
        tuple(model.pair_solref[pair].tolist()),
        tuple(model.pair_solimp[pair].tolist()),
        float(model.pair_margin[pair]),
        (max(MIN_FRICTION, first), max(MIN_FRICTION, second)),
    )


def _mixed(model: mujoco.MjModel, geoms: tuple[int, int]) -> GeomPair:
    """MuJoCo's mixing of two geoms' parameters: by priority, or by weight if priorities are equal."""
    one, two = geoms
    margin = model.geom_margin[one] + model.geom_margin[two]
    priority = model.geom_priority
    if priority[one] != priority[two]:
        dominant = one if priority[one] > priority[two] else two
        solref, solimp = model.geom_solref[dominant], model.geom_solimp[dominant]
        dimensions = model.geom_condim[dominant]
    else:
        weights = model.geom_solmix[[one, two]]
        share = weights[0] / weights.sum() if weights.sum() >= TINY else 0.5
        first, second = model.geom_solref[one], model.geom_solref[two]
        is_standard = first[0] > 0.0 and second[0] > 0.0
        solref = share * first + (1.0 - share) * second if is_standard else np.minimum(first, second)
        solimp = share * model.geom_solimp[one] + (1.0 - share) * model.geom_solimp[two]
        dimensions = max(model.geom_condim[one], model.geom_condim[two])
    return GeomPair(
        geoms, int(dimensions), tuple(solref.tolist()), tuple(solimp.tolist()), float(margin), None
    )
