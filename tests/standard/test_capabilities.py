"""The one table of capabilities says what the schemas and headers of the standard say."""

import re
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from fmu.build.binaries import fmi_headers
from fmu.standard.capabilities import Capability, declared
from fmu.standard.functions import required, spelled

SCHEMAS = Path(fmpy.__file__).parent / "schema"
VERSIONS = pytest.mark.parametrize("major", [2, 3])


def attributes(major):
    """Names of all attributes in the schemas of a version, of its descriptions' interface types among others."""
    files = (SCHEMAS / f"fmi{major}").glob("*.xsd")
    trees = [etree.parse(file).iter("{http://www.w3.org/2001/XMLSchema}attribute") for file in files]
    return {attribute.get("name") for tree in trees for attribute in tree}


def functions(major):
    header = (fmi_headers() / f"fmi{major}Functions.h").read_text()
    return set(re.findall(rf"\b(fmi{major}[A-Z]\w+);", header))


@VERSIONS
def test_names_of_capabilities_are_those_of_the_schema(major):
    names = {capability.attribute(major) for capability in Capability} - {""}
    assert len(names) > 9
    assert names <= attributes(major)


@VERSIONS
def test_functions_are_those_of_the_header(major):
    promised = {spelled(major, name) for c in Capability if c.attribute(major) for name in c.value.functions}
    kinds = ("CoSimulation", "ModelExchange", "ScheduledExecution")
    asked = {name for kind in kinds for name in required(major, kind)}
    assert len(promised) > 6
    assert promised <= asked == functions(major)


@VERSIONS
@pytest.mark.parametrize("kind", ["cs", "me"])
def test_our_fmus_claim_what_they_declare_and_nothing_else(kind, major):
    given = declared(major, kind)
    ours = {c for c in Capability if kind in c.value.ours and c.attribute(major)}
    assert set(given) == {c.attribute(major) for c in ours}
    # Only of Model Exchange is a completed step asked for.
    assert {c for c in Capability if c.claimed(given, major)} - {Capability.COMPLETED_STEP} == ours - {
        Capability.COMPLETED_STEP
    }


def test_what_an_absent_attribute_means_is_the_version_s():
    """FMI 2.0 asks for completedIntegratorStep unless it is said not to be needed; FMI 3.0 only if it is."""
    step = Capability.COMPLETED_STEP
    assert [step.claimed({}, major) for major in (2, 3)] == [True, False]
    assert not step.claimed({"completedIntegratorStepNotNeeded": "true"}, 2)
    assert step.claimed({"needsCompletedIntegratorStep": "1"}, 3)
    order = Capability.OUTPUT_DERIVATIVES
    assert [order.claimed({"maxOutputDerivativeOrder": text}, 3) for text in ("0", "2")] == [False, True]
    assert not Capability.EVENT_MODE.claimed({"hasEventMode": "true"}, 2)
