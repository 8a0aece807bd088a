"""`footfall evaluate`."""

from footfall.evaluation import NOMINAL, EvaluationOptions
from footfall.options import PolicyName
from footfall.outputs import check_outputs


def evaluate(policy: PolicyName, /, *, options: EvaluationOptions = NOMINAL) -> None:
    """Put a policy through scenarios in lockstep, in parallel processes."""
    check_outputs(options.json)
