"""Types of options used by several verbs: parsing, checks and help."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, convert
from cyclopts.validators import Number

from footfall.common.engines import EngineName
from footfall.common.limits import MAX_COMMAND, MAX_DURATION_S

SIMULATED, VIRTUAL = "sim", "virtual"  # values of --bus with a simulated robot


def _vector(_: type, tokens: Any) -> tuple[float, ...]:
    """Parse '0.5,0,0' as three numbers."""
    text = tokens[0].value
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(abs(number) <= MAX_COMMAND for number in numbers):
        raise ValueError(
            f"expected three numbers such as 0.5,0,0, at most {MAX_COMMAND:g} each, found '{text}'"
        )
    return numbers


def _names(_: type, tokens: Any) -> tuple[str, ...]:
    """Parse 'nominal,push' as two names."""
    text = tokens[0].value
    names = tuple(part.strip() for part in text.split(","))
    if not all(names):
        raise ValueError(f"expected names separated by commas such as nominal,push, found '{text}'")
    return names


def _whole(_: type, tokens: Any) -> int:
    """Parse an integer; '1.5' is refused."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"expected a whole number, found '{tokens[0].value}'") from None


def _seconds(_: type, value: float | None) -> None:
    if value is not None and not 0.0 < value <= MAX_DURATION_S:
        raise ValueError(f"Must be a number above 0, and at most {MAX_DURATION_S:g}, a day.")


def _as_typed(kind: Any, tokens: Any) -> Any:
    """The value in its type. Otherwise cyclopts would treat 'none' as a missing option."""
    return convert(kind, tokens)


AS_TYPED = Parameter(converter=_as_typed)  # for optional options
OptionalPath = Annotated[Path | None, AS_TYPED]

PolicyName = Annotated[
    str,
    Parameter(
        help="A run folder, an .onnx file, a zoo policy, a controller of the robot (stand; with changed"
        " settings stand@mine.yaml, stand@kp=50), or MODULE:CLASS, a controller of your own."
    ),
]
ControllerSettings = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative=(),
        show_default=False,
        metavar="CONTROLLER.KEY=VALUE",
        help="Change of a setting in a named controller's controllers.yaml; may be repeated.",
    ),
]
PresetSettings = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative=(),
        show_default=False,
        metavar="KEY=VALUE",
        help="Change of a preset's setting, such as ppo.learning_rate=0.001 or env.episode_s=10;"
        " may be repeated.",
    ),
]
RobotName = Annotated[str, Parameter(help="Name of a robot, or a folder with its robot.yaml.")]
Seed = Annotated[
    int,
    Parameter(
        converter=_whole,
        validator=Number(gte=0, lt=2**31),
        help="The same seed gives the same result on the same machine.",
    ),
]
Plant = Annotated[
    OptionalPath,
    Parameter(help="MJCF for the simulated robot's body, matched by joint names (default: the robot's own)."),
]
Engine = Annotated[
    EngineName,
    Parameter(help="Physics engine of the simulated robot; drake and motrixsim need the extra of that name."),
]
ScenarioFile = Annotated[
    OptionalPath,
    Parameter(help="YAML file with further scenarios, in addition to evaluate/scenarios.yaml."),
]
JsonFile = Annotated[OptionalPath, Parameter(help="Write the figures to this file.")]
HtmlFile = Annotated[OptionalPath, Parameter(help="Write a self-contained report to this file.")]
Seconds = Annotated[float, Parameter(validator=_seconds)]
OptionalSeconds = Annotated[float | None, AS_TYPED, Parameter(validator=_seconds)]
Share = Annotated[float, Parameter(validator=Number(gte=0, lte=1))]
Count = Annotated[int, Parameter(converter=_whole, validator=Number(gte=1))]
Index = Annotated[int, Parameter(converter=_whole, validator=Number(gte=0))]
Port = Annotated[int, Parameter(converter=_whole, validator=Number(gte=1, lt=2**16))]
_VELOCITY = Parameter(
    converter=_vector,
    n_tokens=1,
    allow_leading_hyphen=True,
    metavar="X,Y,YAW",
    negative=(),
    help="Forward and leftward velocity, m/s, and yaw rate, rad/s.",
)
VelocityCommand = Annotated[tuple[float, float, float], _VELOCITY]
OptionalVelocity = Annotated[tuple[float, float, float] | None, _VELOCITY]
Names = Annotated[tuple[str, ...], Parameter(converter=_names, n_tokens=1, metavar="A,B", negative=())]
