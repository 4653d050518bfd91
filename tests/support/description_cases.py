"""Automata for the tests of descriptions: drawn ones, and how a description is checked."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import fmpy
from fmpy import read_model_description
from fmpy.model_description import ValidationError
from hypothesis import strategies as st
from lxml import etree

import hybrid_model as hm
from fmu.describe.description import Description
from fmu.describe.variable_table import fmu_variables
from fmu.describe.variables import Fmi
from hybrid_model.native.trace import trace

SCHEMAS = Path(fmpy.__file__).parent / "schema"
BOTH = (Fmi.V2_0, Fmi.V3_0)

# fmpy counts a triggered output clock among the unknowns of the initialization; the standard does not (a clock has no
# `initial`, and is never active there).
FALSE_FINDING = re.compile(r"InitialUnknowns does not contain .* Expected \{(.*)\} but was \{(.*)\}")


def described(automaton, fmi, **options):
    """The description of an automaton, and its variables."""
    traced = trace(automaton)
    return Description(traced, fmu_variables(traced, fmi), "a token", fmi, **options)


def schema(fmi, name="ModelDescription"):
    folder = "fmi2" if fmi is Fmi.V2_0 else "fmi3"
    return etree.XMLSchema(etree.parse(SCHEMAS / folder / f"{folder}{name}.xsd"))


def findings(document, folder, clocks=(), *, names=True):
    """What fmpy says of a description, without its false finding on clocks; it takes its time with names."""
    (folder / "modelDescription.xml").write_bytes(document)
    try:
        read_model_description(str(folder), validate=True, validate_variable_names=names, validate_model_structure=True)
    except ValidationError as error:
        return [problem for problem in error.problems if not only_clocks(problem, clocks)]
    return []


def only_clocks(problem, clocks):
    """Whether a finding of fmpy is the false one."""
    match = FALSE_FINDING.search(problem)
    if match is None:
        return False
    expected, found = ({name for name in group.split(", ") if name} for group in match.groups())
    return expected - found <= set(clocks) and found <= expected


def elements(document, path):
    return ET.fromstring(document).findall(path)


NAMES = st.one_of(
    st.from_regex(r"[a-z_][a-z0-9_]{0,6}", fullmatch=True),
    st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="`"), min_size=1, max_size=8),
    st.sampled_from(["gamma", "int", "ω", "a b", "*/", '"', "<&>", "%s%n", "Length", "Time", "x" * 300]),
)
UNITS = st.sampled_from(["", "m", "m/s", "rad", "K", "degC", "1", "N.m", "furlong", "J/kg.K", "a<b"])


@st.composite
def drawn_automata(draw):
    """Automata with drawn names, kinds, sizes, units and start values; every state flows towards what comes in."""
    names = draw(st.lists(NAMES, min_size=1, max_size=7, unique=True))
    declared, sizes = {}, {}
    for name in names:
        shape = draw(st.sampled_from([(), ("first",), ("first", "second")]))
        options = {"unit": draw(UNITS), "description": draw(st.text(max_size=12)), "shape": shape}
        start = draw(st.floats(-1e6, 1e6))
        kind = draw(st.sampled_from(["state", "computed", "discrete", "parameter", "input", "output"]))
        flag = draw(st.booleans())
        declared[name] = {
            "state": lambda s=start, o=options, f=flag: hm.State(s, output=f, **o),
            "computed": lambda s=start, o=options, f=flag: hm.State(output=f, computed=True, **o),
            "discrete": lambda s=start, o=options, f=flag: hm.DiscreteState(round(s), output=f, integer=f, **o),
            "parameter": lambda s=start, o=options, f=flag: hm.Parameter(s, **o),
            "input": lambda s=start, o=options, f=flag: hm.Input(s, discrete=f, **o),
            "output": lambda s=start, o=options, f=flag: hm.Output(discrete=f, **o),
        }[kind]()
    if any("first" in declaration.shape for declaration in declared.values()):
        sizes["first"] = draw(st.integers(1, 3))
    if any("second" in declaration.shape for declaration in declared.values()):
        sizes["second"] = draw(st.integers(1, 2))
    dimensions = {name: hm.Dimension() for name in sizes}
    of = {kind: [n for n, d in declared.items() if isinstance(d, kind)] for kind in (hm.State, hm.Output, hm.Input)}
    knowns = [n for n, d in declared.items() if isinstance(d, (hm.Input, hm.Parameter))]

    def total(s):
        return s.t + sum(_sum(s[name]) for name in knowns)

    body = {
        **declared,
        **dimensions,
        "__doc__": draw(st.text(max_size=30)),
        "flow_map": lambda self, s: {name: total(s) - 2.0 * s[name] for name in of[hm.State]},
        "start_map": lambda self, s: {n: total(s) for n, d in declared.items() if d.traits.get("computed")},
        "outputs": lambda self, s: {n: 3.0 * total(s) for n in of[hm.Output]},
    }
    if draw(st.booleans()):
        body["jump_set"] = lambda self, s: total(s) - 1.0
        body["jump_map"] = lambda self, s: {name: 0.0 for name in of[hm.State]}
        body["tick of the jump"] = hm.Clock("jump")
    try:
        return type("Drawn", (hm.HybridAutomaton,), body)(name=draw(st.text(min_size=1, max_size=10)), **sizes)
    except hm.DeclarationError:  # a name of the framework
        return hm.models.BouncingBall()


def _sum(value):
    return value if getattr(value, "shape", ()) == () else value.sum()
