"""`footfall evaluate`."""

from footfall.evaluation_options import (
    NOMINAL,
    EvaluationOptions,
    evaluation_config,
    exit_status,
    requirements_of,
)
from footfall.options import PolicyName


def evaluate(policy: PolicyName, /, *, options: EvaluationOptions = NOMINAL) -> int:
    """Put a policy through scenarios in lockstep, in parallel processes; exit 1 if one cannot be run."""
    from footfall.evaluate.api import evaluate_policy
    from footfall.policies.spec import add_settings

    (spec,) = add_settings([policy], options.settings)
    requirements = requirements_of(options)
    result = evaluate_policy(spec, evaluation_config(options), json_path=options.json)
    return exit_status({spec: result}, requirements, options.junit)
