"""Conversions of units: each factor and offset that cannot be undone is found."""

import pytest
from small_fmus import DESCRIPTIONS, members, write

from fmu.validate.check import check_fmu


@pytest.mark.parametrize("major", [2, 3])
@pytest.mark.parametrize(
    ("inner", "rules"),
    [
        ('<BaseUnit m="1" factor="1e-3" offset="2"/><DisplayUnit name="km" factor="-0.001" offset="-1"/>', set()),
        ('<BaseUnit m="1" factor="0"/>', {"unit.factor"}),
        ('<BaseUnit m="1" factor="-0.0"/>', {"unit.factor"}),
        ('<BaseUnit m="1" factor="INF"/>', {"unit.factor"}),
        ('<BaseUnit m="1" offset="NaN"/>', {"unit.offset"}),
        ('<DisplayUnit name="km" factor="0.0"/>', {"unit.factor"}),
        ('<DisplayUnit name="km" factor="NaN" offset="-INF"/>', {"unit.factor", "unit.offset"}),
        ('<DisplayUnit name="km"/>', set()),
    ],
)
def test_conversions_can_be_undone(inner, rules, major, tmp_path):
    text = DESCRIPTIONS[major].replace('<Unit name="m"/>', f'<Unit name="m">{inner}</Unit>')
    report = check_fmu(write(tmp_path / "a.fmu", members(major, description=text)), run=False)
    found = [finding for finding in report.findings if finding.group == "unit"]
    assert {finding.rule for finding in found} == rules
    assert report.ok == (not rules)
    assert all("'m'" in finding.message and "section 2.4.3" in finding.reference for finding in found)
