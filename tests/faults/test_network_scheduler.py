"""The scheduler of networks in C under sanitizers and valgrind: random wires, pieces and threads."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.engine_files import ENGINE_FOLDERS
from hybrid_model.native.model_code import run_code
from hybrid_model.native.trace import trace

pytestmark = pytest.mark.faults

FOLDERS = ENGINE_FOLDERS
SANITIZERS = {
    "address": ("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    "threads": ("-fsanitize=thread",),
    "plain": (),
}
SEEDS = range(1, 21)


class Agent(hm.HybridAutomaton):
    """Drifts to what it hears, at a rate that is on and off; sends its state where that has moved by a threshold."""

    threshold = hm.Parameter(0.2)
    rate = hm.Parameter(1.0)
    heard = hm.Input(0.0, shape=3, discrete=True)
    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True, computed=True)
    phase = hm.DiscreteState(0, integer=True)

    def start_map(self, s):
        return {"sent": s.x}

    def flow_map(self, s):
        on = 0.5 + 0.5 * np.cos(np.pi * s.phase)
        return {"x": on * s.rate * np.sum(s.heard - s.sent)}

    transitions = (
        hm.TimeEvent(
            "turn", lambda self, s: 0.25 * (s.phase + 1.0), lambda self, s: {"phase": s.phase + 1}, internal=True
        ),
        hm.Jump("send", lambda self, s: abs(s.x - s.sent) - s.threshold, lambda self, s: {"sent": s.x}),
    )


@pytest.fixture(scope="module")
def code(tmp_path_factory):
    file = tmp_path_factory.mktemp("network") / "model.c"
    file.write_text(run_code(trace(Agent())))
    return file


@pytest.fixture(scope="module", params=sorted(SANITIZERS))
def harness(request, code):
    """The harness, built with a sanitizer."""
    program = code.parent / request.param
    sources = [file for folder in FOLDERS for file in sorted(folder.glob("*.c"))]
    includes = [f"-I{folder}" for folder in FOLDERS]
    own = [code, Path(__file__).with_name("network_harness.c"), *sources]
    command = [*find_compiler(), "-std=gnu99", "-g", "-O1", *SANITIZERS[request.param], *includes, *map(str, own)]
    subprocess.run([*command, "-lm", "-lpthread", "-o", str(program)], check=True, capture_output=True)
    return request.param, program


def test_random_networks_in_threads(harness):
    name, program = harness
    events = 0
    for seed in SEEDS if name != "threads" else SEEDS[:5]:
        run = subprocess.run([str(program), str(seed)], capture_output=True, text=True, timeout=300)
        assert run.returncode == 0, f"seed {seed}: {run.stdout}{run.stderr}"
        events += sum(map(int, run.stdout.split()))
    # Of each seed some eighty.
    assert events > 300
    if name == "plain":
        assert shutil.which("valgrind"), "make faults needs valgrind"
        command = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", str(program), "3"]
        run = subprocess.run(command, capture_output=True, text=True, timeout=600)
        assert run.returncode == 0, run.stderr
