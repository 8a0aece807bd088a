"""Results of a fit as lines of text and as figures."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from footfall.identify.fit import MISFIT_RATIO, TORQUE_SHARE, LegFit


def verdicts(fit: LegFit) -> list[str]:
    """One line for each joint, wrong torque readings, and the effect that best explains a misfit."""
    lines = []
    for index, joint in enumerate(fit.leg.joint_names):
        ratio = fit.misfit[index]
        verdict = f"MISFIT: residual {ratio:.1f} times the noise" if ratio > MISFIT_RATIO else "fits"
        lines.append(
            f"{joint}: held out {1e3 * fit.held_out_rad[index]:.2f} mrad rms,"
            f" nominal {1e3 * fit.nominal_rad[index]:.2f}: {verdict}"
        )
    lines += [
        f"{joint}: torque readings differ by {100 * share:.0f} % from the fitted torque:"
        " check their scale and sign"
        for joint, share in zip(fit.leg.joint_names, fit.torque_error, strict=True)
        if share > TORQUE_SHARE
    ]
    explanation = fit.explanation
    if explanation is not None and explanation.best is not None:
        residual = explanation.with_effect[explanation.best]
        lines.append(
            f"{explanation.best} explains the misfit best: residual {explanation.without:.1f} ->"
            f" {residual:.1f} times the noise; fit again with --effects {explanation.best}"
        )
    elif explanation is not None:
        lines.append(
            "no known effect explains the misfit: check for a moving base, loose parts, a weight, a cable"
        )
    return lines


def undetermined(fit: LegFit) -> list[tuple[str, str]]:
    """Parameters that the motion does not determine, each with the parameters it is coupled to."""
    return [
        (
            parameter.label,
            "coupled to " + ", ".join(name for name in direction.parts if name != parameter.label),
        )
        if len(direction.parts) > 1
        else (parameter.label, "no effect on the motion")
        for parameter, direction in fit.frozen.items()
    ]


def figures(fits: Sequence[LegFit]) -> dict[str, Any]:
    """All figures, for JSON."""
    return {"legs": [_leg_figures(fit) for fit in fits]}


def _leg_figures(fit: LegFit) -> dict[str, Any]:
    explanation = fit.explanation
    return {
        "leg": fit.leg.name,
        "joints": list(fit.leg.joint_names),
        "estimates": [
            {
                "quantity": each.parameter.quantity,
                "of": each.parameter.owner,
                "value": each.value,
                "low": each.low,
                "high": each.high,
                "unit": each.parameter.declaration.unit,
            }
            for each in fit.estimates
        ],
        "undetermined": dict(undetermined(fit)),
        "noise_rad": fit.noise_rad.tolist(),
        "residual_rad": fit.residual_rad.tolist(),
        "held_out_rad": fit.held_out_rad.tolist(),
        "nominal_rad": fit.nominal_rad.tolist(),
        "torque_error": [None if np.isnan(each) else float(each) for each in fit.torque_error],
        "effects": None
        if explanation is None
        else {"without": explanation.without, **explanation.with_effect},
        "delay_profile": None if fit.profile is None else fit.profile._asdict() | {"numbers": None},
    }
