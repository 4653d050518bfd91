"""Descriptions that lie about the binary: capability flags, start values, dependencies."""

import re
import xml.etree.ElementTree as ET
import zipfile

import pytest
from small_fmus import DESCRIPTIONS, SCHEDULED, members, only, write

import hybrid_model as hm
from fmu.export import export_fmu
from fmu.validate.check import check_fmu
from fmu.validate.findings import Severity

SOUND, DISCARDS = "-DCLAIMED=0", "-DCLAIMED=2"


def edited(text, *edits):
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    return text


def with_input(major):
    """Return a description with an input u that drives x."""
    if major == 3:
        return edited(
            DESCRIPTIONS[3],
            (
                "  </ModelVariables>",
                '<Float64 name="u" valueReference="7" causality="input" start="0"/></ModelVariables>',
            ),
            ('valueReference="2" dependencies="1 3"', 'valueReference="2" dependencies="1 3 7"'),
        )
    return edited(
        DESCRIPTIONS[2],
        (
            "  </ModelVariables>",
            '<ScalarVariable name="u" valueReference="7" causality="input"><Real start="0"/></ScalarVariable>'
            "</ModelVariables>",
        ),
        ('index="3" dependencies="2"', 'index="3" dependencies="2 7"'),
        ('index="3" dependencies="2 4"', 'index="3" dependencies="2 4 7"'),
    )


def claiming(text, flags, kind="CoSimulation"):
    return only(kind, text).replace(f"<{kind} ", f"<{kind} {flags} ")


def check(tmp_path, major, text, *faults):
    return check_fmu(write(tmp_path / "a.fmu", members(major, *faults, description=text)))


def found(report, *words):
    """Return the rules of errors and warnings; each message holds the words."""
    bad = [finding for finding in report.findings if finding.severity is not Severity.NOTE]
    assert all(word in finding.message for finding in bad for word in words), bad
    return [finding.rule for finding in bad]


CLAIMS = [
    (2, 'canInterpolateInputs="true"', "CoSimulation", ("canInterpolateInputs", "fmi2SetRealInputDerivatives(u)")),
    (2, 'maxOutputDerivativeOrder="3"', "CoSimulation", ("maxOutputDerivativeOrder is 3", "order 2 of 'y'")),
    (3, 'maxOutputDerivativeOrder="2"', "CoSimulation", ("maxOutputDerivativeOrder is 2", "order 2 of 'y'")),
    (3, 'providesEvaluateDiscreteStates="true"', "CoSimulation", ("fmi3EvaluateDiscreteStates()",)),
    (3, 'providesEvaluateDiscreteStates="true"', "ModelExchange", ("fmi3EvaluateDiscreteStates()",)),
    (3, 'providesPerElementDependencies="true"', "CoSimulation", ("fmi3GetNumberOfVariableDependencies(y)",)),
    (3, 'providesPerElementDependencies="true"', "ModelExchange", ("fmi3GetNumberOfVariableDependencies(y)",)),
]


@pytest.mark.parametrize(("major", "flags", "kind", "words"), CLAIMS)
def test_a_claim_that_is_refused(major, flags, kind, words, tmp_path):
    report = check(tmp_path, major, claiming(with_input(major), flags, kind))
    assert found(report, *words, "Error") == ["run.claim"]
    [finding] = [finding for finding in report.findings if finding.rule == "run.claim"]
    assert "section" in finding.reference


@pytest.mark.parametrize("status", [SOUND, DISCARDS])
@pytest.mark.parametrize(("major", "flags", "kind", "words"), CLAIMS)
def test_a_claim_that_is_kept_or_discarded_once(major, flags, kind, words, status, tmp_path):
    assert found(check(tmp_path, major, claiming(with_input(major), flags, kind), status)) == []


def test_the_number_of_orders_that_are_asked_for_is_bounded(tmp_path):
    text = claiming(DESCRIPTIONS[3], 'maxOutputDerivativeOrder="2000000000"')
    assert found(check(tmp_path, 3, text, SOUND)) == []


def test_dependencies_that_are_counted_and_not_listed(tmp_path):
    text = claiming(DESCRIPTIONS[3], 'providesPerElementDependencies="true"')
    report = check(tmp_path, 3, text, SOUND, "DEPENDENCIES")
    assert found(report, "fmi3GetVariableDependencies(y)") == ["run.claim"]


def test_claims_without_anything_to_ask_for(tmp_path):
    """No input, no event mode: nothing can be called."""
    assert found(check(tmp_path, 2, claiming(DESCRIPTIONS[2], 'canInterpolateInputs="true"'))) == []
    text = claiming(DESCRIPTIONS[3], 'providesEvaluateDiscreteStates="true"').replace('hasEventMode="true"', "")
    assert found(check(tmp_path, 3, text)) == []


@pytest.mark.parametrize(
    ("flags", "fault", "rules"),
    [
        ('providesAdjointDerivatives="true"', "ADJOINT_REFUSED", ["run.refused"]),
        ('providesAdjointDerivatives="true"', "NONE", []),
        ('providesDirectionalDerivatives="true"', "DERIVATIVE_REFUSED", ["run.refused"]),
    ],
)
def test_derivatives_are_asked_for_without_dependencies_too(flags, fault, rules, tmp_path):
    """Without the attribute an unknown depends on all knowns."""
    text = claiming(DESCRIPTIONS[3], flags, "ModelExchange")
    text = text.replace(' dependencies="1" dependenciesKind="dependent"', "").replace(' dependencies="1 3"', "", 1)
    assert found(check(tmp_path, 3, text, fault)) == rules


STARTS = [
    (3, 'variability="fixed" start="1"', 'variability="fixed" start="2"', "'rate' is 2.0", "holds 1.0"),
    (3, 'initial="exact" start="1"', 'initial="exact" start="1.0000001"', "'x' is 1.0000001", "holds 1.0"),
    (2, 'variability="fixed"><Real start="1"', 'variability="fixed"><Real start="2"', "'rate' is 2.0", "holds 1.0"),
    (2, 'initial="exact"><Real start="1"', 'initial="exact"><Real start="3"', "'x' is 3.0", "holds 1.0"),
]


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize(("major", "old", "new", "said", "held"), STARTS)
def test_a_start_value_that_the_binary_does_not_hold(major, old, new, said, held, kind, tmp_path):
    report = check(tmp_path, major, edited(only(kind, DESCRIPTIONS[major]), (old, new)))
    assert found(report, said, held) == ["run.start"]


def test_scheduled_execution_holds_its_start_values(tmp_path):
    text = edited(SCHEDULED, ('variability="fixed" start="1"', 'variability="fixed" start="2"'))
    assert found(check(tmp_path, 3, text), "'rate'") == ["run.start"]


@pytest.mark.parametrize(
    ("major", "old", "new"),
    [
        (3, 'initial="exact" start="1"', 'initial="approx" start="2"'),
        (3, 'initial="exact" start="1"', 'initial="exact" start="1.00000000000001"'),
        (2, 'initial="exact"><Real start="1"', 'initial="approx"><Real start="2"'),
        (3, 'causality="input" start="0"', 'causality="input" start="4"'),
    ],
)
def test_start_values_that_may_differ(major, old, new, tmp_path):
    report = check(tmp_path, major, edited(with_input(major), (old, new)))
    assert "run.start" not in found(report)


@pytest.mark.parametrize("major", [2, 3])
def test_an_fmu_that_gives_no_values_in_initialization_mode(major, tmp_path):
    """Its states are not compared, its parameters are, later."""
    text = only("CoSimulation", DESCRIPTIONS[major])
    assert found(check(tmp_path, major, text, "NO_VALUES_IN_INITIALIZATION")) == []
    old, new = next((old, new) for number, old, new, *_ in STARTS if number == major)
    report = check(tmp_path, major, edited(text, (old, new)), "NO_VALUES_IN_INITIALIZATION")
    assert found(report, "'rate'") == ["run.start"]


class Counter(hm.HybridAutomaton):
    """An integer parameter, an array, a discrete state, and x that grows by u."""

    degree = hm.Dimension()
    limit = hm.Parameter(7, integer=True)
    weights = hm.Parameter(1.0, shape="degree")
    u = hm.Input(0.0)
    x = hm.State(0.5, output=True)
    count = hm.DiscreteState(3, integer=True)
    y = hm.Output()

    def flow_map(self, s):
        return {"x": s.u + s.weights[0] - s.x}

    def jump_set(self, s):
        return s.x - s.limit

    def jump_map(self, s):
        return {"x": 0.0, "count": s.count + 1}

    def outputs(self, s):
        return {"y": 2.0 * s.u}


@pytest.fixture(scope="module")
def counters(tmp_path_factory):
    """Return the members of the exported counter, by version."""
    found = {}
    for fmi in ("2.0", "3.0"):
        path = export_fmu(
            Counter(weights=[1.0, 0.25]), tmp_path_factory.mktemp("counter") / "counter.fmu", fmi=fmi, stop_time=1.0
        )
        with zipfile.ZipFile(path) as archive:
            found[fmi] = {name: archive.read(name) for name in archive.namelist()}
    return found


def altered(members, tmp_path, pattern, new):
    """Check an export with one place of its description altered."""
    text, count = re.subn(pattern, new, members["modelDescription.xml"].decode())
    assert count == 1, text
    return check_fmu(write(tmp_path / "counter.fmu", {**members, "modelDescription.xml": text}))


def numbers(members, *names):
    """Return what the model structure calls variables."""
    root = ET.fromstring(members["modelDescription.xml"])
    variables = list(root.find("ModelVariables"))
    if root.get("fmiVersion") == "2.0":
        return [str(k) for name in names for k, v in enumerate(variables, 1) if v.get("name") == name]
    return [v.get("valueReference") for name in names for v in variables if v.get("name") == name]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(
    ("name", "start", "held"),
    [
        ("limit", "8", 7),
        ("count", "2", 3),
        ("x", "0.25", 0.5),
        ("weights", "1 0.5", 0.25),
        ("stop_at_events", "true", 0),
    ],
)
def test_start_values_of_each_type_are_compared(name, start, held, fmi, counters, tmp_path):
    name, start = ("weights[2]", "0.5") if fmi == "2.0" and name == "weights" else (name, start)
    if fmi == "3.0" and name == "stop_at_events":
        pytest.skip("FMI 3.0 needs no such parameter")
    inner = r"[^>]*>\s*<\w+" if fmi == "2.0" else ""
    pattern = rf'(name="{re.escape(name)}"{inner}[^>]*? start=")[^"]*"'
    report = altered(counters[fmi], tmp_path, pattern, rf'\g<1>{start}"')
    shown = bool(held) if name == "stop_at_events" else held
    assert found(report, f"holds {shown!r}", name) == ["run.start"] * 2  # Co-Simulation and Model Exchange


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(("unknown", "known"), [("der(x)", "u"), ("der(x)", "x"), ("y", "u")])
def test_dependencies_that_leave_out_a_known(unknown, known, fmi, counters, tmp_path):
    members = counters[fmi]
    row, left = numbers(members, unknown, known)
    tag = {"2.0": "Unknown index"}.get(
        fmi, f"{'Output' if unknown == 'y' else 'ContinuousStateDerivative'} valueReference"
    )
    text = members["modelDescription.xml"].decode()
    place = re.search(rf'<{tag}="{row}" dependencies="([^"]*)"( dependenciesKind="[^"]*")?', text)
    kept = " ".join(number for number in place[1].split() if number != left)
    lie = text[: place.start()] + f'<{tag}="{row}" dependencies="{kept}"' + text[place.end() :]
    report = check_fmu(write(tmp_path / "counter.fmu", {**members, "modelDescription.xml": lie}))
    assert set(found(report, f"{unknown!r} leave out {known!r}")) == {"run.dependency"}
    kinds = {finding.message.partition(",")[0] for finding in report.findings}
    assert kinds == {"CoSimulation", "ModelExchange"}


@pytest.mark.parametrize("fault", ["NOISE", "ZERO_REFUSED", "ZERO_NAN"])
def test_noise_and_refusals_are_no_dependencies(fault, tmp_path):
    """Differences of what a solver iterates to are noise; nobody needs to ask for a derivative that is zero."""
    text = claiming(with_input(3), 'providesDirectionalDerivatives="true"', "ModelExchange")
    assert found(check(tmp_path, 3, text, fault)) == []


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_own_exports_keep_what_they_claim(fmi, counters, tmp_path):
    assert found(check_fmu(write(tmp_path / "counter.fmu", counters[fmi]))) == []
