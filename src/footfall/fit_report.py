"""HTML page with the results of a fit."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from footfall.fit_findings import undetermined, verdicts
from footfall.identify.fit import MISFIT_RATIO, LegFit
from footfall.robots.description import Robot

if TYPE_CHECKING:
    from footfall.evaluate.report.fit_page import LegPart


def page(robot: Robot, fits: Sequence[LegFit], logs: Sequence[Path], held_out: Path | None) -> str:
    """HTML page of a fit; requires the extra `report`."""
    from footfall.evaluate.report.fit_page import render

    misfitting = [fit.leg.name for fit in fits if (fit.misfit > MISFIT_RATIO).any()]
    worst = max(float(fit.held_out_rad.max()) for fit in fits)
    gain = min(float((fit.nominal_rad / fit.held_out_rad).min()) for fit in fits)
    headline = (
        f"The model does not fit {', '.join(misfitting)}: figures and intervals are not valid."
        if misfitting
        else f"Held out: within {1e3 * worst:.2f} mrad rms, at least {gain:.1f} times better than nominal."
    )
    validation = "every fourth second of the recordings" if held_out is None else str(held_out)
    facts = [
        ("nominal robot", f"{robot.name}, digest {robot.digest}"),
        ("recordings", ", ".join(str(log) for log in logs)),
        ("held out", validation),
        ("intervals", "95 %, by bootstrap over windows with refits; valid only if the model is right"),
        ("misfit", f"a residual of more than {MISFIT_RATIO:g} times the noise of the readings"),
    ]
    return render(f"{robot.name}: identified", headline, [_part(fit) for fit in fits], facts)


def _part(fit: LegFit) -> "LegPart":
    from footfall.evaluate.report.fit_page import EstimateRow, JointTrack, LegPart

    track = fit.held_out
    joints = [
        JointTrack(
            name,
            track.time_s[:, :, index],
            track.measured_rad[:, :, index],
            track.fitted_rad[:, :, index],
            track.nominal_rad[:, :, index],
            float(fit.noise_rad[index]),
            float(fit.misfit[index]),
        )
        for index, name in enumerate(fit.leg.joint_names)
    ]
    rows = [
        EstimateRow(
            each.parameter.owner,
            each.parameter.quantity,
            each.value,
            each.low,
            each.high,
            each.parameter.declaration.nominal,
            each.parameter.declaration.unit or "x nominal",
        )
        for each in fit.estimates
    ]
    effects = (
        [] if fit.explanation is None else sorted(fit.explanation.with_effect.items(), key=lambda e: e[1])
    )
    profile = None if fit.profile is None else (fit.profile.values, fit.profile.misfit)
    return LegPart(
        name=fit.leg.name,
        verdicts=verdicts(fit),
        good=not (fit.misfit > MISFIT_RATIO).any(),
        estimates=rows,
        undetermined=undetermined(fit),
        joints=joints,
        effects=effects,
        profile=profile,
    )
