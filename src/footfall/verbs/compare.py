"""`footfall compare`."""

from footfall.evaluation_options import (
    DEFAULT_OPTIONS,
    EvaluationOptions,
    evaluation_config,
    report_failures,
    requirements_of,
)
from footfall.options import HtmlFile, PolicyName


def compare(
    *policies: PolicyName, options: EvaluationOptions = DEFAULT_OPTIONS, html: HtmlFile = None
) -> int:
    """Run policies through the same scenarios: table, JSON, HTML report; exit 1 if an episode fails to
    run."""
    from footfall.evaluate.api import compare_policies
    from footfall.policies.spec import add_settings

    specs = add_settings(policies, options.settings)
    config, requirements = evaluation_config(options), requirements_of(options)
    results = compare_policies(specs, config, json_path=options.json, html_path=html)
    return report_failures(results, requirements, options.junit)
