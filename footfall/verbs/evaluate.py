"""`footfall evaluate`."""

from footfall.evaluation import NOMINAL, EvaluationOptions, arguments
from footfall.options import PolicyName
from footfall.outputs import check_outputs, write_json


def evaluate(policy: PolicyName, /, *, options: EvaluationOptions = NOMINAL) -> None:
    """Put a policy through scenarios in lockstep, in parallel processes."""
    check_outputs(options.json)
    from evaluate.api import evaluate_policy

    write_json(options.json, evaluate_policy(policy, **arguments(options)))
