"""Descriptions of drawn automata: valid by the schema and by fmpy, whatever names, sizes and units there are."""

import pytest
from description_cases import BOTH, described, drawn_automata, elements, findings, schema
from drawing import examples
from hypothesis import given
from lxml import etree

from fmu.describe.model_description import model_description
from fmu.describe.terminals import terminals_and_icons
from fmu.describe.variables import Fmi
from fmu.errors import ExportError

SCHEMAS = {fmi: schema(fmi) for fmi in BOTH}
TERMINALS = schema(Fmi.V3_0, "TerminalsAndIcons")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("description")


@given(drawn_automata())
@examples(6, 20)
def test_drawn_automata(folder, automaton):
    for fmi in BOTH:
        try:
            description = described(automaton, fmi)
            names = description.names
        except ExportError as error:
            # The only reasons: names that come twice, or that no convention takes.
            if "rename" not in str(error).lower():
                raise
            continue
        document = model_description(description)
        _valid(SCHEMAS[fmi], document)
        _valid(TERMINALS, terminals_and_icons(description))
        clocks = [names[k] for k, v in enumerate(description.variables) if v.type.name == "CLOCK"]
        # Both versions have the same names by the same convention.
        assert findings(document, folder, clocks, names=fmi is Fmi.V3_0) == []
        listed = elements(document, "ModelVariables/*")
        assert [item.get("name") for item in listed] == names


def _valid(validator, document):
    assert validator.validate(etree.fromstring(document)), validator.error_log
