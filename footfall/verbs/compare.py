"""`footfall compare`."""

from footfall.evaluation import NOMINAL, EvaluationOptions, arguments, exit_status
from footfall.options import HtmlFile, PolicyName


def compare(*policies: PolicyName, options: EvaluationOptions = NOMINAL, html: HtmlFile = None) -> int:
    """Put policies through the same scenarios: table, JSON, HTML report; exit 1 if an episode failed."""
    from footfall.evaluate.api import compare_policies
    from footfall.policies.spec import add_settings

    specs = add_settings(policies, options.settings)
    return exit_status(compare_policies(specs, **arguments(options), html_path=html).values())
