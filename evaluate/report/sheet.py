"""Renders self-contained pages from templates, which extend templates/sheet.html."""

from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


def rendered(template: str, *functions: Callable[..., Any], **values: Any) -> str:
    """The page from a template and values; `version` and `date` have defaults.

    Args:
        template: name of a file in templates/.
        functions: functions that the template and its macros call by name.
        values: variables of the template.
    """
    environment = Environment(
        loader=PackageLoader("footfall.evaluate.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {function.__name__: function for function in functions}
    defaults = {"version": version("footfall"), "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")}
    return environment.get_template(template).render(defaults | values)
