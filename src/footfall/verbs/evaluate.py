"""`footfall evaluate`."""

from typing import Annotated

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.evaluation_options import (
    DEFAULT_OPTIONS,
    EvaluationOptions,
    evaluation_config,
    report_failures,
    requirements_of,
)
from footfall.options import Names, PolicyName


def evaluate(
    policy: PolicyName,
    /,
    *,
    options: EvaluationOptions = DEFAULT_OPTIONS,
    weakest: Annotated[Names, Parameter(show_default=False)] = (),
) -> int:
    """Run a policy through scenarios in lockstep, in parallel processes; exit 1 if an episode fails to run.

    Args:
        weakest: Find the smallest disturbances that make it fall instead: push, latency, friction, strength.
    """
    from footfall.evaluate.api import evaluate_policy, weakest_of
    from footfall.policies.spec import add_settings

    (spec,) = add_settings([policy], options.settings)
    if weakest:
        _refuse_scenarios(options)
        weakest_of(spec, weakest, evaluation_config(options), json_path=options.json)
        return 0
    requirements = requirements_of(options)
    result = evaluate_policy(spec, evaluation_config(options), json_path=options.json)
    return report_failures({spec: result}, requirements, options.junit)


def _refuse_scenarios(options: EvaluationOptions) -> None:
    """Refuse options without meaning in a search for disturbances."""
    for name in ("scenarios", "metrics", "require", "junit", "ground_truth"):
        if getattr(options, name) != getattr(DEFAULT_OPTIONS, name):
            raise UserError(f"--weakest runs no scenario: leave --{name.replace('_', '-')} out")
