"""MuJoCo's forward dynamics with soft contacts: one Newton iteration with an exact line search.

MuJoCo: its documentation, chapter Computation, sections Primal problem and Algorithms. The acceleration x
minimises (x - a)^T M (x - a) / 2 + sum of D_i min(0, J_i x - r_i)^2 / 2 over all rows, where a is the
acceleration without contact and r the reference acceleration.
"""

from footfall.envs.physics.generated.algebra import Factor, Symmetric, dot, product
from footfall.envs.physics.generated.expression import Scalar, absolute, less, maximum, minimum, where
from footfall.envs.physics.generated.rows import Rows

LINE_SEARCH_STEPS = 10


def newton_step(
    mass: Symmetric,
    force: list[Scalar],
    previous: list[Scalar],
    contacts: list[Rows],
    rounding: float,
) -> list[Scalar]:
    """The acceleration after one iteration, from the cheaper start: the last step's, or that without contact.

    Args:
        mass: M, with all armature.
        force: force of all degrees of freedom, without bias forces.
        previous: the last step's acceleration.
        contacts: all possible contacts, and joint limits.
        rounding: relative change of a number that counts as zero.
    """
    smooth = Factor(mass, len(force)).solve(force)
    if not contacts:
        return smooth
    warm = previous, product(mass, previous), _residuals(contacts, previous, reference=True)
    cold = smooth, force, _residuals(contacts, smooth, reference=True)
    gauss = 0.5 * dot(_difference(warm[1], force), _difference(previous, smooth))
    warmer = less(_cost(contacts, warm[2]) + gauss, _cost(contacts, cold[2]))
    start, momentum = (
        [where(warmer, a, b) for a, b in zip(*pair, strict=True)]
        for pair in zip(warm[:2], cold[:2], strict=True)
    )
    residuals = [
        [where(warmer, a, b) for a, b in zip(*pair, strict=True)]
        for pair in zip(warm[2], cold[2], strict=True)
    ]
    smooth_gradient = _difference(momentum, force)
    gradient, hessian = list(smooth_gradient), dict(mass)
    for contact, residual in zip(contacts, residuals, strict=True):
        _add_contact(gradient, hessian, contact, residual)
    search = [-x for x in Factor(hessian, len(force)).solve(gradient)]
    change = _residuals(contacts, search, reference=False)
    slope, curvature = dot(search, smooth_gradient), dot(search, product(mass, search))
    length = _line_search(slope, curvature, contacts, residuals, change, rounding)
    return [x + length * step for x, step in zip(start, search, strict=True)]


def _difference(a: list[Scalar], b: list[Scalar]) -> list[Scalar]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _residuals(contacts: list[Rows], x: list[Scalar], reference: bool) -> list[list[Scalar]]:
    """J x of each contact's rows; with `reference`, minus the reference acceleration."""
    found = []
    for contact in contacts:
        along = [sum((j * x[dof] for dof, j in row.items()), start=0.0) for row in contact.jacobian]
        if reference:
            along = [value + r for value, r in zip(along, contact.reference, strict=True)]
        found.append(contact.edges(along))
    return found


def _cost(contacts: list[Rows], residuals: list[list[Scalar]]) -> Scalar:
    total: Scalar = 0.0
    for contact, residual in zip(contacts, residuals, strict=True):
        pushed = [minimum(value, 0.0) for value in residual]
        total = total + 0.5 * contact.weight * dot(pushed, pushed)
    return total


def _add_contact(gradient: list[Scalar], hessian: Symmetric, contact: Rows, residual: list[Scalar]) -> None:
    """Add J^T D min(0, residual) and J^T D J of the active rows to gradient and Hessian.

    The sums run over normal and tangents instead of the pyramid's edges, which combine them.
    """
    pushed = [contact.weight * minimum(value, 0.0) for value in residual]
    active = [where(less(value, 0.0), contact.weight, 0.0) for value in residual]
    size = len(contact.jacobian)
    force: list[Scalar] = [sum(pushed, start=0.0)]
    weight: dict[tuple[int, int], Scalar] = {(0, 0): sum(active, start=0.0)}
    for k, friction in enumerate(contact.friction):
        plus, minus = 2 * k, 2 * k + 1
        force.append(friction * (pushed[plus] - pushed[minus]))
        weight[k + 1, k + 1] = friction * friction * (active[plus] + active[minus])
        weight[k + 1, 0] = weight[0, k + 1] = friction * (active[plus] - active[minus])
    dofs = sorted({dof for row in contact.jacobian for dof in row})
    for i in dofs:
        column = [row.get(i, 0.0) for row in contact.jacobian]
        gradient[i] = gradient[i] + dot(column, force)
        weighted = [
            sum((weight[a, b] * column[a] for a in range(size) if (a, b) in weight), start=0.0)
            for b in range(size)
        ]
        for j in dofs:
            if j <= i:
                other = [row.get(j, 0.0) for row in contact.jacobian]
                hessian[i, j] = hessian.get((i, j), 0.0) + dot(weighted, other)


def _line_search(
    slope: Scalar,
    curvature: Scalar,
    contacts: list[Rows],
    residuals: list[list[Scalar]],
    change: list[list[Scalar]],
    rounding: float,
) -> Scalar:
    """Step length along the search direction that minimises the cost.

    Its derivative rises piecewise linearly: Newton steps inside a bracket end exactly at the root, most
    often after three steps. MuJoCo's C finds the same length if its `ls_iterations` suffice.
    """
    rows = [
        (residual, step, contact.weight * step, contact.weight * step * step)
        for contact, some, steps in zip(contacts, residuals, change, strict=True)
        for residual, step in zip(some, steps, strict=True)
    ]

    def newton(values: list[Scalar]) -> tuple[list[Scalar], Scalar]:
        length, low, high = values
        first, second = slope + length * curvature, curvature
        for residual, step, weighted, square in rows:
            there = residual + length * step
            first = first + weighted * minimum(there, 0.0)
            second = second + where(less(there, 0.0), square, 0.0)
        before = less(first, 0.0)
        low, high = where(before, length, low), where(before, high, length)
        following = length - first / maximum(second, 1e-20)
        middle = 0.5 * (low + high)
        following = where(less(following, low), middle, where(less(high, following), middle, following))
        moved = less(rounding * absolute(following), absolute(following - length))
        return [following, low, high], moved

    return slope.graph.repeat(LINE_SEARCH_STEPS, [0.0, 0.0, 1e10], newton)[0]
