"""MuJoCo's forward dynamics with soft contacts: Newton iterations with an exact line search.

MuJoCo: its documentation, chapter Computation, sections Primal problem and Algorithms. The acceleration x
minimises (x - a)^T M (x - a) / 2 + sum of D_i min(0, J_i x - r_i)^2 / 2 over all rows, where a is the
acceleration without contact and r the reference acceleration; contacts with an elliptic cone have a cost of
their own (`cone.py`).
"""

from footfall.envs.physics.generated.algebra import Factor, Symmetric, dot, product
from footfall.envs.physics.generated.expression import Scalar, absolute, less, maximum, minimum, sqrt, where
from footfall.envs.physics.generated.limbs import Part
from footfall.envs.physics.generated.rows import Rows
from footfall.envs.physics.generated.tree import BASE_DOFS

LINE_SEARCH_STEPS, CONE_SEARCH_STEPS = 10, 20


def newton_step(
    mass: Symmetric,
    force: list[Scalar],
    previous: list[Scalar],
    contacts: list[Rows],
    rounding: float,
    part: Part,
) -> list[Scalar]:
    """The acceleration after one iteration, from the cheaper start: the last step's, or that without contact.

    Args:
        mass: M, with all armature.
        force: force of all degrees of freedom, without bias forces.
        previous: the last step's acceleration.
        contacts: all possible contacts, and joint limits.
        rounding: relative change of a number that counts as zero.
        part: the robot or the limb that all arguments belong to.
    """
    smooth = Factor(mass, len(force), BASE_DOFS, part.total).solve(force)
    if not contacts:
        return smooth
    warm = previous, product(mass, previous), _residuals(contacts, previous, part, minus_reference=True)
    cold = smooth, force, _residuals(contacts, smooth, part, minus_reference=True)
    gauss = 0.5 * dot(_difference(warm[1], force), _difference(previous, smooth))
    warm_is_cheaper = less(part.total(_cost(contacts, warm[2]) + gauss), part.total(_cost(contacts, cold[2])))
    start, momentum = (
        [where(warm_is_cheaper, a, b) for a, b in zip(*pair, strict=True)]
        for pair in zip(warm[:2], cold[:2], strict=True)
    )
    residuals = [
        [where(warm_is_cheaper, a, b) for a, b in zip(*pair, strict=True)]
        for pair in zip(warm[2], cold[2], strict=True)
    ]
    smooth_gradient = _difference(momentum, force)
    search = _search(mass, smooth_gradient, contacts, residuals, part)
    change = _residuals(contacts, search, part, minus_reference=False)
    slope, curvature = (part.total(dot(search, along)) for along in (smooth_gradient, product(mass, search)))
    length = _line_search(slope, curvature, contacts, residuals, change, rounding, part)
    return [x + length * step for x, step in zip(start, search, strict=True)]


def _difference(a: list[Scalar], b: list[Scalar]) -> list[Scalar]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _residuals(
    contacts: list[Rows], x: list[Scalar], part: Part, minus_reference: bool
) -> list[list[Scalar]]:
    """J x of each contact's rows; with `minus_reference`, minus the reference acceleration."""
    of_contacts = []
    for contact in contacts:
        along = [sum((j * x[dof] for dof, j in row.items()), start=0.0) for row in contact.jacobian]
        along = [part.of_both(value, contact.pair) for value in along]
        if minus_reference:
            along = [value + r for value, r in zip(along, contact.reference, strict=True)]
        of_contacts.append(contact.edges(along))
    return of_contacts


def _cost(contacts: list[Rows], residuals: list[list[Scalar]]) -> Scalar:
    total: Scalar = 0.0
    for contact, residual in zip(contacts, residuals, strict=True):
        if contact.cone is not None:
            total = total + contact.cone.cost(contact.weight, residual)
            continue
        pushed = [minimum(value, 0.0) for value in residual]
        total = total + 0.5 * contact.weight * dot(pushed, pushed)
    return total


def _search(
    mass: Symmetric,
    smooth_gradient: list[Scalar],
    contacts: list[Rows],
    residuals: list[list[Scalar]],
    part: Part,
) -> list[Scalar]:
    """Newton's direction.

    The force between two limbs is a coordinate before the base's, so that limbs remain independent of each
    other: with s the root of D of an active row J, (H + s^2 J^T J) x = g is
    [[-1, s J], [s J^T, H]] (y, x) = (0, g).
    """
    gradient, hessian, num_pairs = list(smooth_gradient), dict(mass), part.num_pairs
    system: Symmetric = {(k, k): -part.share for k in range(num_pairs)}
    for contact, residual in zip(contacts, residuals, strict=True):
        if contact.pair is None:
            _add_contact(gradient, hessian, contact, residual)
            continue
        weight = 2.0 * contact.weight  # each limb has half of it
        (row,), (value,) = contact.jacobian, residual
        root = sqrt(where(less(value, 0.0), weight, 0.0))
        for dof, j in row.items():
            gradient[dof] = gradient[dof] + j * (weight * minimum(value, 0.0))
            for k in range(num_pairs):
                is_own = part.number(float(k == contact.pair.number))
                system[num_pairs + dof, k] = system.get((num_pairs + dof, k), 0.0) + is_own * (root * j)
    system |= {(num_pairs + i, num_pairs + j): value for (i, j), value in hessian.items()}
    rhs = [*[0.0] * num_pairs, *gradient]
    solution = Factor(system, len(rhs), num_pairs + BASE_DOFS, part.total).solve(rhs)
    return [-x for x in solution[num_pairs:]]


def _add_contact(gradient: list[Scalar], hessian: Symmetric, contact: Rows, residual: list[Scalar]) -> None:
    """Add J^T D min(0, residual) and J^T D J of the active rows to gradient and Hessian.

    The sums run over normal and tangents instead of the pyramid's edges, which combine them.
    """
    size = len(contact.jacobian)
    if contact.cone is not None:
        force, weight = contact.cone.derivatives(contact.weight, residual)
    else:
        force, weight = _of_pyramid(contact, residual)
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


def _of_pyramid(contact: Rows, residual: list[Scalar]) -> tuple[list[Scalar], dict[tuple[int, int], Scalar]]:
    """Gradient and Hessian of a contact's cost by the residual of normal and tangents."""
    pushed = [contact.weight * minimum(value, 0.0) for value in residual]
    active = [where(less(value, 0.0), contact.weight, 0.0) for value in residual]
    force: list[Scalar] = [sum(pushed, start=0.0)]
    weight: dict[tuple[int, int], Scalar] = {(0, 0): sum(active, start=0.0)}
    for k, friction in enumerate(contact.friction):
        plus, minus = 2 * k, 2 * k + 1
        force.append(friction * (pushed[plus] - pushed[minus]))
        weight[k + 1, k + 1] = friction * friction * (active[plus] + active[minus])
        weight[k + 1, 0] = weight[0, k + 1] = friction * (active[plus] - active[minus])
    return force, weight


def _line_search(
    slope: Scalar,
    curvature: Scalar,
    contacts: list[Rows],
    residuals: list[list[Scalar]],
    change: list[list[Scalar]],
    rounding: float,
    part: Part,
) -> Scalar:
    """Step length along the search direction that minimises the cost.

    Its derivative rises piecewise linearly: Newton steps inside a bracket end exactly at the root, most
    often after three steps. With an elliptic cone it bends, and more are needed. MuJoCo's C finds the same
    length if its `ls_iterations` suffice.
    """
    rows = [
        (residual, step, contact.weight * step, contact.weight * step * step)
        for contact, values, steps in zip(contacts, residuals, change, strict=True)
        if contact.cone is None
        for residual, step in zip(values, steps, strict=True)
    ]
    cones = [
        contact.cone.along(contact.weight, values, steps)
        for contact, values, steps in zip(contacts, residuals, change, strict=True)
        if contact.cone is not None
    ]

    def newton(values: list[Scalar]) -> tuple[list[Scalar], Scalar]:
        length, low, high = values
        first, second = part.share * (slope + length * curvature), part.share * curvature
        for residual, step, weighted, square in rows:
            value = residual + length * step
            first = first + weighted * minimum(value, 0.0)
            second = second + where(less(value, 0.0), square, 0.0)
        for derivatives in cones:
            cone_slope, cone_curvature = derivatives(length)
            first, second = first + cone_slope, second + cone_curvature
        first, second = part.total(first), part.total(second)
        is_below_root = less(first, 0.0)
        low, high = where(is_below_root, length, low), where(is_below_root, high, length)
        following = length - first / maximum(second, 1e-20)
        middle = 0.5 * (low + high)
        following = where(less(following, low), middle, where(less(high, following), middle, following))
        continues = less(rounding * absolute(following), absolute(following - length))
        return [following, low, high], continues

    steps = CONE_SEARCH_STEPS if cones else LINE_SEARCH_STEPS
    return slope.graph.repeat(steps, [0.0, 0.0, 1e10], newton)[0]
