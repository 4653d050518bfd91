"""What units measure, for type definitions, and other units that people read the same quantity in."""

from __future__ import annotations

from dataclasses import dataclass, field

from fmu.standard.units import base_unit


@dataclass(frozen=True)
class Quantity:
    """What a unit measures, for type definitions: a name, and the units that people read it in.

    Attributes
    ----------
    name : str
        Quantity in the sense of ISO 80000, one word.
    displays : tuple of str
        Other units for the same quantity.
    """

    name: str
    displays: tuple[str, ...] = field(default=())


_QUANTITIES = {
    "m": Quantity("Length"),
    "m2": Quantity("Area"),
    "m3": Quantity("Volume"),
    "s": Quantity("Time"),
    "m/s": Quantity("Velocity", ("km/h",)),
    "m/s2": Quantity("Acceleration"),
    "m3/s": Quantity("VolumeFlowRate"),
    "rad": Quantity("Angle", ("deg",)),
    "rad/s": Quantity("AngularVelocity", ("deg/s", "rpm")),
    "rad/s2": Quantity("AngularAcceleration"),
    "Hz": Quantity("Frequency"),
    "kg": Quantity("Mass"),
    "N": Quantity("Force"),
    "N.m": Quantity("Torque"),
    "Pa": Quantity("Pressure", ("bar",)),
    "J": Quantity("Energy"),
    "W": Quantity("Power"),
    "A": Quantity("ElectricCurrent"),
    "V": Quantity("ElectricPotential"),
    "C": Quantity("ElectricCharge"),
    "F": Quantity("Capacitance"),
    "H": Quantity("Inductance"),
    "Ohm": Quantity("Resistance"),
    "K": Quantity("ThermodynamicTemperature", ("degC",)),
    "degC": Quantity("CelsiusTemperature"),
    "mol": Quantity("AmountOfSubstance"),
    "cd": Quantity("LuminousIntensity"),
}


def quantity(text: str) -> Quantity | None:
    """Return what a unit measures, or None where the unit does not say: ``1/s`` is a rate or a frequency.

    Parameters
    ----------
    text : str
        Unit in FMI notation.
    """
    return _QUANTITIES.get(text)


def display_attributes(unit: str, display: str) -> dict[str, str]:
    """Return the attributes of a DisplayUnit: value in `display` = factor * value in `unit` + offset.

    Parameters
    ----------
    unit, display : str
        Two units of one quantity.

    Raises
    ------
    ValueError
        If they do not measure the same.
    """
    known, shown = base_unit(unit), base_unit(display)
    if known is None or shown is None or known.exponents != shown.exponents:
        raise ValueError(f"{display!r} does not measure what {unit!r} does: choose two units of one quantity.")
    attributes = {"name": display, "factor": repr(float(known.ratio / shown.ratio))}
    offset = (known.offset - shown.offset) / shown.factor
    return attributes | ({"offset": repr(offset)} if offset else {})
