"""Units: parsed to base units as independent definitions say, and written for time derivatives."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu.describe.quantities import display_attributes, quantity
from fmu.standard.units import BASE_UNITS, base_unit, nearest_unit, unit_per_second


def in_base_units(**exponents):
    return tuple(exponents.get(name, 0) for name in BASE_UNITS)


# Definitions of the SI brochure, 9th edition, tables 2, 4 and 8.
DEFINITIONS = {
    "1": (in_base_units(), 1.0, 0.0),
    "m": (in_base_units(m=1), 1.0, 0.0),
    "kg": (in_base_units(kg=1), 1.0, 0.0),
    "g": (in_base_units(kg=1), 1e-3, 0.0),
    "mg": (in_base_units(kg=1), 1e-6, 0.0),
    "ms": (in_base_units(s=1), 1e-3, 0.0),
    "km/h": (in_base_units(m=1, s=-1), 1 / 3.6, 0.0),
    "m/s2": (in_base_units(m=1, s=-2), 1.0, 0.0),
    "1/s": (in_base_units(s=-1), 1.0, 0.0),
    "s-1": (in_base_units(s=-1), 1.0, 0.0),
    "Hz": (in_base_units(s=-1), 1.0, 0.0),
    "N": (in_base_units(kg=1, m=1, s=-2), 1.0, 0.0),
    "N.m": (in_base_units(kg=1, m=2, s=-2), 1.0, 0.0),
    "V": (in_base_units(kg=1, m=2, s=-3, A=-1), 1.0, 0.0),
    "Ohm": (in_base_units(kg=1, m=2, s=-3, A=-2), 1.0, 0.0),
    "F": (in_base_units(kg=-1, m=-2, s=4, A=2), 1.0, 0.0),
    "H": (in_base_units(kg=1, m=2, s=-2, A=-2), 1.0, 0.0),
    "mol": (in_base_units(mol=1), 1.0, 0.0),
    "cd": (in_base_units(cd=1), 1.0, 0.0),
    "rad/s": (in_base_units(rad=1, s=-1), 1.0, 0.0),
    "deg": (in_base_units(rad=1), math.pi / 180, 0.0),
    "degC": (in_base_units(K=1), 1.0, 273.15),
    "J/(kg.K)": (in_base_units(m=2, s=-2, K=-1), 1.0, 0.0),
    "W/(m2.K)": (in_base_units(kg=1, s=-3, K=-1), 1.0, 0.0),
    "hPa": (in_base_units(kg=1, m=-1, s=-2), 100.0, 0.0),
    "m3/s": (in_base_units(m=3, s=-1), 1.0, 0.0),
    "ml": (in_base_units(m=3), 1e-6, 0.0),
    "min": (in_base_units(s=1), 60.0, 0.0),
    "dam": (in_base_units(m=1), 10.0, 0.0),
}


@pytest.mark.parametrize("text", DEFINITIONS)
def test_units_are_what_the_si_brochure_says(text):
    exponents, factor, offset = DEFINITIONS[text]
    known = base_unit(text)
    assert known.exponents == exponents
    # Factors are products of at most three rounded numbers.
    assert known.factor == pytest.approx(factor, rel=4e-16)
    assert known.offset == offset


@pytest.mark.parametrize(
    "text",
    ["", "furlong", "J/kg.K", "m/s/s", "m//s", "m.", ".m", "2m", "m^2", "m s", "1.m", "m.degC", "1/degC", "κ", "m/"],
)
def test_what_is_not_known_or_not_in_the_notation_has_no_base_unit(text):
    assert base_unit(text) is None


def test_fahrenheit_has_factor_and_offset():
    known = base_unit("degF")
    # Boiling water: 212 degF = 373.15 K.
    assert known.factor * 212.0 + known.offset == pytest.approx(373.15, abs=1e-12)


def test_only_what_differs_from_the_defaults_is_written():
    assert base_unit("m/s2").attributes() == {"m": "1", "s": "-2"}
    assert base_unit("1").attributes() == {}
    assert base_unit("degC").attributes() == {"K": "1", "offset": "273.15"}


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("m", "m/s"),
        ("m/s", "m/s2"),
        ("1", "1/s"),
        ("1/s", "1/s2"),
        ("s", "1"),
        ("s2", "s"),
        ("N.m", "N.m/s"),
        ("J/(kg.K)", "J/(kg.K.s)"),
        ("1/m", "1/(m.s)"),
        ("degC", "K/s"),
        ("degF", ""),
        ("", ""),
        ("apples per hour", ""),
        ("m3/s", "m3/s2"),
        ("m.s-1", "m.s-2"),
    ],
)
def test_unit_of_a_time_derivative(unit, expected):
    assert unit_per_second(unit) == expected


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        *(
            ("meter", "m"),
            ("Metres", "m"),
            ("seconds", "s"),
            ("Hertz", "Hz"),
            ("ohm", "Ohm"),
            ("KG", "kg"),
            ("°C", "degC"),
        ),
        *(("m/s^2", "m/s2"), ("m/s**2", "m/s2"), ("m/s/s", "m/s2"), ("m s-1", "m.s-1"), ("kg*m/s^2", "kg.m/s2")),
        *(("m·s⁻²", "m.s-2"), ("meters per second", "m/s"), ("rad/sec", "rad/s"), ("W/m2/K", "W/(m2.K)")),
    ],
)
def test_what_people_write_has_a_name_in_the_notation(written, meant):
    assert nearest_unit(written) == meant
    assert base_unit(meant) is not None


@pytest.mark.parametrize(
    "text", [*DEFINITIONS, "", "furlong", "EUR", "1/veh", "apples per hour", "J/kg.K", "<m>", "2m"]
)
def test_what_is_right_or_unheard_of_is_left_alone(text):
    assert nearest_unit(text) is None


factors = st.lists(
    st.tuples(st.sampled_from(["m", "kg", "s", "A", "rad", "km", "N", "ms"]), st.integers(-3, 3).filter(bool)),
    min_size=1,
    max_size=3,
)


def written(parts):
    return ".".join(symbol if power == 1 else f"{symbol}{power}" for symbol, power in parts)


@given(factors, factors)
def test_a_quotient_has_the_exponents_of_its_parts(above, below):
    """A unit is a product: exponents add, factors multiply; and a derivative's unit is the unit by a second."""
    text = f"{written(above)}/{written(below) if len(below) == 1 else f'({written(below)})'}"
    top, bottom, whole = base_unit(written(above)), base_unit(written(below)), base_unit(text)
    assert whole.exponents == tuple(a - b for a, b in zip(top.exponents, bottom.exponents, strict=True))
    # At most six rounded factors with powers up to 3.
    assert whole.factor == pytest.approx(top.factor / bottom.factor, rel=1e-13)
    rate = base_unit(unit_per_second(text))
    assert rate.factor == pytest.approx(whole.factor, rel=1e-13)
    assert [a - b for a, b in zip(rate.exponents, whole.exponents, strict=True)] == list(in_base_units(s=-1))


@given(st.text(max_size=12))
def test_any_text_is_answered(text):
    known = base_unit(text)
    assert known is None or len(known.exponents) == len(BASE_UNITS)
    assert base_unit(unit_per_second(text)) is None or known is not None or text == ""


def test_display_units_convert():
    """100 degC = 373.15 K, 180 deg = pi rad."""
    celsius = {key: float(value) for key, value in display_attributes("K", "degC").items() if key != "name"}
    assert celsius["factor"] * 373.15 + celsius["offset"] == pytest.approx(100.0, abs=1e-12)
    assert float(display_attributes("rad", "deg")["factor"]) * math.pi == pytest.approx(180.0, rel=1e-15)
    with pytest.raises(ValueError, match="does not measure"):
        display_attributes("m", "s")


@pytest.mark.parametrize(
    ("unit", "display", "factor"),
    [
        ("m/s", "km/h", 3.6),
        ("km/h", "m/s", 1 / 3.6),
        ("Pa", "bar", 1e-5),
        ("rad", "deg", 180 / math.pi),
        ("rad/s", "rpm", 30 / math.pi),
        ("m", "mm", 1000.0),
        ("kg/m3", "g/l", 1.0),
    ],
)
def test_factors_of_display_units_are_rounded_once(unit, display, factor):
    """3600/1000 is 3.6, and not the 3.5999999999999996 of three rounded numbers."""
    assert float(display_attributes(unit, display)["factor"]) == factor


@pytest.mark.parametrize("text", ["Qm999", "ym-999", "1/Qm99", "Qm99.ym99.Qm99"])
def test_units_beyond_the_range_of_numbers_have_no_base_unit(text):
    assert base_unit(text) is None


def test_display_units_of_the_known_quantities_measure_the_same():
    for unit in ("m/s", "rad", "rad/s", "Pa", "K"):
        for display in quantity(unit).displays:
            assert display_attributes(unit, display)["name"] == display
