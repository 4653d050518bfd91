"""Everything beside the binary: it is complete, valid, the same every time, and enough to build the binary from."""

import csv
import hashlib
import io
import shutil
import subprocess
import xml.etree.ElementTree as ET

import fmpy
import numpy as np
import pytest
from catalogue import cases
from description_cases import BOTH, findings, schema
from lxml import etree

import hybrid_model as hm
from fmu.archives.writing import package
from fmu.build.archive_members import archive_members
from fmu.build.fmu_code import fmu_code
from fmu.build.source_files import source_names
from fmu.describe.description import Description
from fmu.describe.experiment import round_step
from fmu.describe.reference_results import FOLDER
from fmu.describe.variable_table import fmu_variables
from fmu.describe.variables import Fmi
from hybrid_model.models import BouncingBall
from hybrid_model.native.networks.network import trace_any

TOKEN = "0123456789abcdef0123456789abcdef"
KINDS = ("cs", "me")


def content(automaton, fmi, *, sources=True, kinds=KINDS, **options):
    traced = trace_any(automaton)
    variables = fmu_variables(traced, fmi)
    listed = tuple(source_names(fmi)) if sources else ()
    description = Description(traced, variables, TOKEN, fmi, kinds, sources=listed, **options)
    return archive_members(description, fmu_code(traced, variables, TOKEN, kinds))


@pytest.fixture(scope="module", params=BOTH, ids=lambda fmi: fmi.value)
def ball(request):
    """The archive of a ball dropped from 1 m, without binaries."""
    return request.param, content(BouncingBall(), request.param, stop_time=1.0, step_size=0.01)


def test_members(ball):
    fmi, members = ball
    assert {
        "modelDescription.xml",
        "model.png",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "terminalsAndIcons/terminalsAndIcons.xml",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/icon.svg",
        "sources/model.c",
        "sources/engine.c",
        f"{FOLDER}/fmi-ls-manifest.xml",
        f"{FOLDER}/experiments.xml",
        f"{FOLDER}/results.csv",
        "documentation/fmi-ls-ref.txt",
    } <= set(members)
    assert ("sources/buildDescription.xml" in members) == (fmi is Fmi.V3_0)
    other = "fmi2" if fmi is Fmi.V3_0 else "fmi3"
    assert not [name for name in members if other in name]
    assert all(members[name].startswith(b"\x89PNG") for name in members if name.endswith(".png"))


def test_what_is_not_asked_for_is_left_out():
    members = content(BouncingBall(), Fmi.V2_0, sources=False, kinds=("me",))
    assert not [name for name in members if name.startswith(("sources/", "extra/"))]
    description = ET.fromstring(members["modelDescription.xml"])
    assert description.find("CoSimulation") is None
    assert description.find("ModelExchange/SourceFiles") is None
    # Without a stop time there is no experiment to run.
    assert not [name for name in content(BouncingBall(), Fmi.V3_0) if name.startswith("extra/")]


def test_every_description_is_valid(ball, tmp_path):
    _, members = ball
    assert findings(members["modelDescription.xml"], tmp_path, ["impact"]) == []
    for name, kind in (
        ("terminalsAndIcons/terminalsAndIcons.xml", "TerminalsAndIcons"),
        ("sources/buildDescription.xml", "BuildDescription"),
    ):
        if name in members:
            validator = schema(Fmi.V3_0, kind)
            assert validator.validate(etree.fromstring(members[name])), validator.error_log


def test_equal_bytes_every_time(ball):
    fmi, members = ball
    assert content(BouncingBall(), fmi, stop_time=1.0, step_size=0.01) == members


def test_the_licence_is_the_projects():
    text = content(BouncingBall(), Fmi.V3_0)["documentation/licenses/license.txt"].decode()
    assert "BSD 3-Clause License" in text
    assert "THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS" in text


def build(members, fmi, folder):
    """Compile the sources as the archive says, with gcc and with nothing from outside the archive."""
    for name, data in members.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    if fmi is Fmi.V3_0:
        root = ET.parse(folder / "sources/buildDescription.xml").getroot()
        [chosen] = [c for c in root if c.get("platform") == "x86_64-linux"]
        identifier = chosen.get("modelIdentifier")
        files = [item.get("name") for item in chosen.iter("SourceFile")]
        options = chosen.find("SourceFileSet").get("compilerOptions").split()
        options += [f"-I{item.get('name')}" for item in chosen.iter("IncludeDirectory")]
        libraries = [f"-l{item.get('name')}" for item in chosen.iter("Library")]
    else:
        element = ET.parse(folder / "modelDescription.xml").getroot().find("CoSimulation")
        identifier, options, libraries = element.get("modelIdentifier"), ["-fPIC", "-fvisibility=hidden"], ["-lm"]
        files = [item.get("name") for item in element.iter("File")]
    target = folder / "binaries" / fmpy.platform_tuple if fmi is Fmi.V3_0 else folder / "binaries" / fmpy.platform
    target.mkdir(parents=True)
    library = target / f"{identifier}{fmpy.sharedLibraryExtension}"
    command = ["gcc", "-std=c99", *options, "-shared", *files, "-o", str(library), *libraries]
    subprocess.run(command, cwd=folder / "sources", check=True, capture_output=True, env={"PATH": "/usr/bin:/bin"})
    return package(folder, folder.parent / f"{identifier}.fmu")


@pytest.mark.skipif(shutil.which("gcc") is None, reason="the sources are compiled by gcc")
def test_the_sources_are_enough_to_build_the_binary(ball, tmp_path):
    fmi, members = ball
    path = build(members, fmi, tmp_path / "content")
    result = fmpy.simulate_fmu(str(path), stop_time=1.0, output_interval=0.25, fmi_type="CoSimulation")
    impact = np.sqrt(2 / 9.81)
    after = 0.75 - impact
    height = result["h"][np.isclose(result["time"], 0.75)]
    # Newton's law of impact, then free flight from the floor upwards.
    assert height == pytest.approx(0.7 * 9.81 * impact * after - 4.905 * after**2, abs=1e-8)
    _, table = rows(members)
    for time, h in zip(result["time"], result["h"], strict=True):
        reference = table[np.isclose(table[:, 0], time), 1]
        # The limit that the issue sets for states.
        assert np.abs(reference - h).min() < 1e-8


def rows(members):
    lines = list(csv.reader(io.StringIO(members[f"{FOLDER}/results.csv"].decode())))
    return lines[0], np.array(lines[1:], dtype=float)


def test_reference_results_are_those_of_the_ball(ball):
    _, members = ball
    header, table = rows(members)
    assert header == ["time", "h", "v"]
    impact = np.sqrt(2 / 9.81)
    falling = table[:, 0] < impact - 1e-6
    # Twelve digits of values up to 1.
    assert np.abs(table[falling, 1] - (1 - 4.905 * table[falling, 0] ** 2)).max() < 1e-10
    at = table[np.abs(table[:, 0] - impact) < 1e-9]
    assert at.shape == (2, 3)
    assert at[1, 2] == pytest.approx(-0.7 * at[0, 2], rel=1e-10)
    # 0.00, 0.01 ... 1.00, and the two rows of the one impact.
    assert len(table) == 101 + 2
    assert table[-1, 0] == 1.0


def test_results_of_a_run_that_stops_early_end_there():
    members = content(BouncingBall(), Fmi.V3_0, stop_time=10.0)
    _, table = rows(members)
    experiment = ET.fromstring(members[f"{FOLDER}/experiments.xml"]).find("Experiment/TransientSimulation")
    end = float(experiment.get("stopTime"))
    # Impacts accumulate at sqrt(2 h/g) (1 + e)/(1 - e); the run ends when they are closer than a run can tell.
    assert end == table[-1, 0] == pytest.approx(np.sqrt(2 / 9.81) * 1.7 / 0.3, abs=1e-4)
    assert ET.fromstring(members["modelDescription.xml"]).find("DefaultExperiment").get("stopTime") == "10"


def test_the_manifest_tells_the_related_files_by_role_and_checksum(ball):
    _, members = ball
    root = ET.fromstring(members[f"{FOLDER}/fmi-ls-manifest.xml"])
    space = "{http://fmi-standard.org/fmi-ls-manifest}"
    assert root.tag == "fmiReferences"
    assert root.get(f"{space}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    assert {item.get("source"): item.get("role") for item in root} == {
        "experiments.xml": "experiment/smoke-test",
        "results.csv": "result",
    }
    for item in root:
        data = members[f"{FOLDER}/{item.get('source')}"]
        assert item.get("checksum") == hashlib.sha3_256(data).hexdigest()


class Saw(hm.HybridAutomaton):
    """Rises, and falls to zero at one."""

    rate = hm.Parameter(1.0)
    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": s.rate}

    transitions = (hm.Jump("fall", lambda self, s: s.x - 1.0, lambda self, s: {"x": 0.0}),)


def test_reference_results_of_a_network_are_those_of_its_parts():
    rates = np.linspace(0.83, 1.37, 15)
    saws = hm.product("saws", *(Saw(f"saw{k}", rate=rate) for k, rate in enumerate(rates)))
    members = content(saws, Fmi.V3_0, stop_time=3.0, step_size=0.01)
    assert '#include "assembly.h"' in members["sources/model.c"].decode()
    header, table = rows(members)
    assert header == ["time", *(f"saw{k}.x" for k in range(15))]
    turns = table[:, :1] * rates
    apart = np.abs(turns - np.round(turns)) > 1e-6
    # Twelve digits of values up to 1, and of 41 falls each some 1e-13 late.
    assert np.abs(table[:, 1:] - turns % 1.0)[apart].max() < 1e-10
    assert len(table) == 301 + 2 * int(np.sum(np.floor(3.0 * rates)))


def test_large_networks_have_no_reference_results():
    saws = hm.product("saws", *(Saw(f"saw{k}") for k in range(101)))
    assert not [name for name in content(saws, Fmi.V3_0, stop_time=0.5) if name.startswith("extra/")]


def test_an_automaton_that_cannot_run_has_no_reference_results():
    class Growing(hm.HybridAutomaton):
        x = hm.State(1.0, output=True)

        def flow_map(self, s):
            return {"x": s.x**3}

    # x = (1 - 2 t)^(-1/2) ends at 0.5 s.
    members = content(Growing(), Fmi.V3_0, stop_time=2.0)
    assert not [name for name in members if name.startswith("extra/")]


@pytest.mark.parametrize(("stop_time", "step"), [(1.0, 0.002), (3.0, 0.01), (20.0, 0.05), (1e-3, 2e-6), (500.0, 1.0)])
def test_round_steps(stop_time, step):
    assert round_step(stop_time) == step
    assert 200 <= stop_time / step <= 500 * (1 + 1e-12)


class Hostile(hm.HybridAutomaton):
    """A model with <b>markup</b> & "quotes" in its docstring.

    And a second paragraph: </pre><script>alert(1)</script>
    """

    x = hm.State(1.0, output=True, unit="<m>", description="</td><script>")

    def flow_map(self, s):
        return {"x": -s.x}


def test_the_page_is_well_formed_and_escaped():
    page = content(Hostile(name="</title><script>&"), Fmi.V3_0)["documentation/index.html"].decode()
    assert page.startswith("<!DOCTYPE html>")
    root = ET.fromstring(page)
    assert root.find("head/title").text == "</title><script>&"
    assert not list(root.iter("script"))
    assert "And a second paragraph: </pre><script>alert(1)</script>" in [item.text for item in root.iter("pre")]


@pytest.mark.parametrize("fmi", BOTH)
def test_the_page_lists_variables_jumps_and_clocks(fmi):
    members = content(cases()["agent2_dynamic"].automaton, fmi, stop_time=1.0)
    root = ET.fromstring(members["documentation/index.html"])
    cells = [[cell.text or "" for cell in row] for row in root.iter("tr")]
    assert any(row[0] == "neighbours[2]" and row[1] == "discrete input" for row in cells)
    assert any(row[0] == "x" and row[1] == "continuous output" for row in cells)
    assert ["trigger.broadcast", "its margin is zero or above"] in cells
    assert (["broadcast_clock", "trigger.broadcast", "ticks with each broadcast"] in cells) == (fmi is Fmi.V3_0)
    names = [item.get("name") for item in ET.fromstring(members["modelDescription.xml"]).find("ModelVariables")]
    assert set(names) <= {row[0] for row in cells}
    for link in root.iter("a"):
        assert link.get("href").removeprefix("../") in members
