"""A robot of identical limbs as the sum of robots with one limb each, which share the base.

All these robots have the same base, and each has an equal share of its inertia. Energies, forces on the base
and the base's entries of matrices are then sums over the limbs. A contact between two limbs adds one
coordinate that all share: its force (`solver.py`).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.envs.physics.generated.expression import Expression, Graph, Scalar
from footfall.envs.physics.generated.geom_pairs import SMOOTH, GeomPair, geom_pairs
from footfall.envs.physics.generated.tree import BASE, ROUNDING, Hinge, Tree

GEOMETRY = ("rotation", "position", "axis")  # of a hinge
MAX_PAIRS = 6  # contacts between limbs; every limb computes the forces of all of them


class LimbsDifferError(Exception):
    """The robot's limbs differ; the message is the reason."""


class Pair(NamedTuple):
    """A contact between two limbs, as the program of one of them sees it."""

    geom_pair: GeomPair
    number: int | None  # index among all such contacts; None: this limb has no such contact
    slot: int  # index of the exchange with a partner
    own_geoms: tuple[int, int]  # this limb's geoms that correspond to the first and the second geom
    side: int  # index of this limb's geom in the contact


class Part:
    """The part of a robot that one program simulates: all of it, or one limb with a share of the base."""

    def __init__(self, tree: Tree, limbs: int = 1) -> None:
        self.graph, self.tree, self.limbs = Graph(), tree, limbs
        self.share = 1.0 / limbs  # of the base
        self.geom_pairs: list[GeomPair] = []  # of this part with itself and with the world
        self.pairs: list[Pair] = []
        self.num_pairs = 0  # of the whole robot
        self._numbers = 0

    def total(self, value: Scalar) -> Scalar:
        """The sum of a value over all limbs."""
        if self.limbs == 1 or (not isinstance(value, Expression) and value == 0.0):
            return value
        return self.graph.node("total", self.number(value))

    def partner(self, value: Scalar, slot: int) -> Scalar:
        """The value of the limb that touches this one."""
        return self.graph.node("partner", self.number(value), slot)

    def of_both(self, value: Scalar, pair: Pair | None) -> Scalar:
        """The sum of a value over both limbs of a pair; the value itself outside of pairs."""
        return value if pair is None else value + self.partner(value, pair.slot)

    def number(self, value: Scalar) -> Expression:
        """A number that may differ between limbs: it is neither folded nor shared with an equal one."""
        if isinstance(value, Expression):
            return value
        self._numbers += 1
        return self.graph.node("constant", float(value), self._numbers)


def whole_robot(model: mujoco.MjModel, tree: Tree) -> Part:
    """The whole robot as one part."""
    part = Part(tree)
    part.geom_pairs = geom_pairs(model)
    return part


def limbs_of(model: mujoco.MjModel, tree: Tree) -> tuple[list[Part], list[tuple[int, ...]]]:
    """The limbs, and the partner of each limb in each slot.

    Raises:
        LimbsDifferError: limbs differ in more than numbers.
    """
    families: dict[int, list[int]] = {}
    for link in range(len(tree.hinges)):
        families.setdefault(tree.chain(link)[0], []).append(link)
    limbs = [Part(tree.limb(links), len(families)) for links in families.values()]
    if len(limbs) < 2 or len({tuple(h.parent for h in limb.tree.hinges) for limb in limbs}) > 1:
        raise LimbsDifferError("limbs differ")
    _separate_numbers(limbs)
    geoms = [list(_geoms(model, limb.tree)) for limb in limbs]
    location = {geom: (n, k) for n, limb_geoms in enumerate(geoms) for k, geom in enumerate(limb_geoms)}
    between_limbs = []
    for geom_pair in geom_pairs(model):
        owners = {location[geom][0] for geom in geom_pair.geoms if geom in location}
        for n in owners or range(len(limbs)):
            if len(owners) < 2:
                limbs[n].geom_pairs.append(geom_pair)
        if len(owners) == 2:
            between_limbs.append(geom_pair)
    if len(between_limbs) > MAX_PAIRS or any(geom_pair.dimensions != SMOOTH for geom_pair in between_limbs):
        raise LimbsDifferError("limbs touch each other in many contacts, or with friction")
    return limbs, list(_pair_up(limbs, geoms, location, between_limbs))


def _separate_numbers(limbs: Sequence[Part]) -> None:
    """Prevent the folding of numbers in which the limbs' hinges differ: they may be 0 in some limbs only."""
    hinges: list[list[Hinge]] = [[] for _ in limbs]
    for each in zip(*(limb.tree.hinges for limb in limbs), strict=True):
        numbers: dict[str, np.ndarray] = {}
        for name in GEOMETRY:
            values = np.array([getattr(hinge, name) for hinge in each])
            differ = (np.abs(values - values[0]) > ROUNDING).any(axis=0)
            numbers[name] = np.where(differ, values, values[0]).astype(object)
            for limb_values, limb in zip(numbers[name], limbs, strict=True):
                limb_values[differ] = [limb.number(value) for value in limb_values[differ]]
        for n, hinge in enumerate(each):
            hinges[n].append(hinge._replace(**{name: values[n] for name, values in numbers.items()}))
    for limb, limb_hinges in zip(limbs, hinges, strict=True):
        limb.tree = limb.tree._replace(hinges=tuple(limb_hinges))


def _geoms(model: mujoco.MjModel, tree: Tree) -> Iterator[int]:
    """The geoms on links."""
    for geom in range(model.ngeom):
        body = tree.bodies.get(int(model.geom_bodyid[geom]))
        if body is not None and body.link != BASE:
            yield geom


def _pair_up(
    limbs: Sequence[Part],
    geoms: list[list[int]],
    location: dict[int, tuple[int, int]],
    between_limbs: list[GeomPair],
) -> Iterator[tuple[int, ...]]:
    """Give each limb its contacts with other limbs; yields the partners in each slot.

    Contacts of the same geoms of different limbs share a slot. A limb without a partner in a slot is its own:
    it computes the contact, too, but without weight.
    """
    slots: list[tuple[tuple[int, ...], dict[int, GeomPair]]] = []  # the geoms' numbers, and contacts by limb
    for geom_pair in between_limbs:
        owners, places = zip(*(location[geom] for geom in geom_pair.geoms), strict=True)
        available = (
            members for kind, members in slots if kind == places and members.keys().isdisjoint(owners)
        )
        members = next(available, None)
        if members is None:
            slots.append((places, members := {}))
        members |= dict.fromkeys(owners, geom_pair)
    for slot, ((one, two), members) in enumerate(slots):
        partners = list(range(len(limbs)))
        for n, limb in enumerate(limbs):
            geom_pair = members.get(n, next(iter(members.values())))
            owners = tuple(location[geom][0] for geom in geom_pair.geoms)
            side = int(owners[0] != n)
            if n in members:
                partners[n] = owners[1 - side]
            number = between_limbs.index(geom_pair) if n in members else None
            limb.pairs.append(Pair(geom_pair, number, slot, (geoms[n][one], geoms[n][two]), side))
            limb.num_pairs = len(between_limbs)
        yield tuple(partners)
