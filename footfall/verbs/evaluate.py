"""`footfall evaluate`."""

from footfall.evaluation import NOMINAL, EvaluationOptions, arguments
from footfall.options import PolicyName


def evaluate(policy: PolicyName, /, *, options: EvaluationOptions = NOMINAL) -> None:
    """Put a policy through scenarios in lockstep, in parallel processes."""
    from footfall.evaluate.api import evaluate_policy

    evaluate_policy(policy, **arguments(options))
