"""MuJoCo's elliptic friction cone: cost of a contact, and its derivatives.

MuJoCo: its documentation, chapter Computation, section Friction cones, and `mj_constraintUpdate` in
`engine_core_constraint.c`. The residual r of normal and tangents is scaled to N = mu r_0 and U_j = f_j r_j,
with mu = f_1 / sqrt(impratio) and T = |U|. The cost is 0 where N >= mu T, the sum of D_j r_j^2 / 2 where
mu N + T <= 0, and D (N - mu T)^2 / (2 mu^2 (1 + mu^2)) between.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from footfall.envs.physics.generated.algebra import dot
from footfall.envs.physics.generated.expression import Scalar, less, maximum, sqrt, where

MIN_SQUARE = 1e-15  # lower limit of T^2, since T is a divisor


class Cone(NamedTuple):
    """Friction of a contact whose cone is elliptic."""

    friction: tuple[Scalar, ...]  # along each tangent
    impratio: float  # how much stiffer friction is than the normal force

    @property
    def mu(self) -> Scalar:
        """Friction coefficient of the regularised cone."""
        return self.friction[0] * self.impratio**-0.5

    def weights(self, weight: Scalar) -> list[Scalar]:
        """D of the normal and of each tangent, from D of the normal."""
        first = self.friction[0]
        shares = [self.impratio * (f * f) / (first * first) for f in self.friction]
        return [weight, *(weight * share for share in shares)]

    def scaled(self, residual: list[Scalar]) -> tuple[Scalar, list[Scalar]]:
        """N and U of a residual."""
        normal, *rest = residual
        return self.mu * normal, [f * r for f, r in zip(self.friction, rest, strict=True)]

    def cost(self, weight: Scalar, residual: list[Scalar]) -> Scalar:
        """Cost of a residual.

        Args:
            weight: D of the normal.
            residual: of normal and tangents.
        """
        mu, (n, u) = self.mu, self.scaled(residual)
        t = _length(u)
        inside = 0.5 * dot([d * r for d, r in zip(self.weights(weight), residual, strict=True)], residual)
        return _by_zone(mu, n, t, inside, 0.5 * self._between_weight(weight) * (n - mu * t) * (n - mu * t))

    def derivatives(
        self, weight: Scalar, residual: list[Scalar]
    ) -> tuple[list[Scalar], dict[tuple[int, int], Scalar]]:
        """Gradient and Hessian of the cost with respect to the residual, for the same arguments."""
        mu, (n, u), weights = self.mu, self.scaled(residual), self.weights(weight)
        t, between_weight = _length(u), self._between_weight(weight)
        outward, scales = [-mu * each / t for each in u], (mu, *self.friction)
        pull = between_weight * (n - mu * t)

        def by_zone(inside: Scalar, between: Scalar) -> Scalar:
            return _by_zone(mu, n, t, inside, between)

        directions = [1.0, *outward]
        gradient = [
            by_zone(d * r, pull * direction * scale)
            for d, r, direction, scale in zip(weights, residual, directions, scales, strict=True)
        ]
        bend = n / (mu * t)
        hessian = {(0, 0): by_zone(weights[0], between_weight * (mu * mu))}
        for j, out in enumerate(outward):
            hessian[0, j + 1] = hessian[j + 1, 0] = by_zone(0.0, between_weight * mu * scales[j + 1] * out)
            for k, out_k in enumerate(outward):
                between = bend * out * out_k + (mu * mu * (1.0 - bend) if j == k else 0.0)
                inside = weights[j + 1] if j == k else 0.0
                hessian[j + 1, k + 1] = by_zone(
                    inside, between_weight * scales[j + 1] * scales[k + 1] * between
                )
        return gradient, hessian

    def along(
        self, weight: Scalar, residual: list[Scalar], change: list[Scalar]
    ) -> Callable[[Scalar], tuple[Scalar, Scalar]]:
        """First and second derivative of the cost of residual + length * change, by the length."""
        mu, weights, between_weight = self.mu, self.weights(weight), self._between_weight(weight)
        (n, u), (dn, du) = self.scaled(residual), self.scaled(change)

        def derivatives(length: Scalar) -> tuple[Scalar, Scalar]:
            moved: list[Any] = [r + length * c for r, c in zip(residual, change, strict=True)]
            n_moved, u_moved = n + length * dn, [a + length * b for a, b in zip(u, du, strict=True)]
            t = _length(u_moved)
            dt = dot(u_moved, du) / t
            ddt = (dot(du, du) - dt * dt) / t
            first_inside: Scalar = 0.0
            second_inside: Scalar = 0.0
            for d, r, c in zip(weights, moved, change, strict=True):
                first_inside = first_inside + d * r * c
                second_inside = second_inside + d * c * c
            gap, slope = n_moved - mu * t, dn - mu * dt
            first = _by_zone(mu, n_moved, t, first_inside, between_weight * gap * slope)
            second = _by_zone(
                mu, n_moved, t, second_inside, between_weight * (slope * slope - gap * mu * ddt)
            )
            return first, second

        return derivatives

    def _between_weight(self, weight: Scalar) -> Scalar:
        square = self.mu * self.mu
        return weight / (square * (1.0 + square))


def _length(values: list[Scalar]) -> Scalar:
    return sqrt(maximum(dot(values, values), MIN_SQUARE))


def _by_zone(mu: Scalar, n: Scalar, t: Scalar, inside: Scalar, between: Scalar) -> Scalar:
    """0 where N >= mu T, `inside` where mu N + T <= 0, `between` elsewhere."""
    return where(less(n, mu * t), where(less(0.0, mu * n + t), between, inside), 0.0)
