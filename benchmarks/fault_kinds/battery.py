"""Batteries that run empty, and voltages that contradict charge and current."""

from fault_kinds.kind import FaultKind
from footfall.plant.injection import FaultInjector, Injection

CELLS = 8
EMPTY_AFTER_S = 12.0  # time until the pack of these rows is empty
LOWERS = "speed and torque are limited while the pack is low; the robot lies down when it is empty"
SMOOTHED = "both voltages are smoothed over 1 s, because a peak of current at a step is not a fault"
VOLTAGE_ERROR_S = 2.0


def _nothing(injector: FaultInjector) -> None:
    """Injects nothing: the small pack runs empty by itself."""


def _voltage_error(cell_v: float) -> Injection:
    """Motors report a wrong voltage."""

    def inject(injector: FaultInjector) -> None:
        assert injector.body.battery is not None
        injector.body.battery.voltage_error_v = CELLS * cell_v

    return inject


BATTERY = (
    FaultKind(
        "battery runs empty",
        _nothing,
        EMPTY_AFTER_S,
        LOWERS,
        main=True,
        starting=True,
        observed_s=EMPTY_AFTER_S,
        powered=True,
    ),
    *(
        FaultKind(
            f"battery's voltage reads {abs(volts):g} V a cell too {'high' if volts > 0 else 'low'}",
            _voltage_error(volts),
            VOLTAGE_ERROR_S,
            SMOOTHED,
            main=True,
            observed_s=3.0,
            powered=True,
        )
        for volts in (0.5, -0.5)
    ),
)
