"""The recording of runs in C: under sanitizers, and each of several faults in it is seen."""

import ctypes
import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from test_sanitized_host import library

import hybrid_model as hm
from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import Kind
from hybrid_model.models import BouncingBall, SampledLtiLoop, VanDerPol
from hybrid_model.native import run
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.engine_files import ENGINE_FOLDERS, RUNS_FOLDERS
from hybrid_model.native.kept_models import made_model, traced_maps


class Saw(hm.HybridAutomaton):
    """Starts anew a thousand times a second."""

    x = hm.State(0.0)
    v = hm.State(1.0)

    def flow_map(self, s):
        return {"x": s.v, "v": 0.0}

    def jump_set(self, s):
        return s.x - 1e-3

    def jump_map(self, s):
        return {"x": 0.0}


FOLDERS = (*ENGINE_FOLDERS, *RUNS_FOLDERS)
SOURCES = {file.name: file for folder in FOLDERS for file in sorted(folder.glob("*.c"))}
FAULTS = {
    "a step that was cut is kept whole": ("recorder.c", "row[2] = end;", "row[2] = t1;"),
    "the start of a step is lost": ("recorder.c", "row[0] = engine->step.t0;", "row[0] = *engine->live.time + 1e-3;"),
    "states at the end are those at the start": ("locate.c", "t, engine->probe_x))", "t, point->x))"),
    "the interpolation is another step's": (
        "recorder.c",
        "engine_copy(row + BEFORE_STATES + n, engine_step_vectors(engine), engine->method->n_vectors * n);",
        "engine_copy(row + BEFORE_STATES + n, engine->step.vectors, engine->method->n_vectors * n);",
    ),
    "both sides of a jump are one": (
        "recorder.c",
        "engine_copy(row + BEFORE_STATES + size, engine->reset.x, size);",
        "engine_copy(row + BEFORE_STATES + size, engine->live.x, size);",
    ),
    "a jump is one step early": (
        "recorder.c",
        "row[0] = (double)engine->rows[ROWS_OF_STEPS].count;",
        "row[0] = (double)engine->rows[ROWS_OF_STEPS].count - 1.0;",
    ),
    "steps are kept once only": (
        "flow.c",
        "if (point == &engine->live && !engine_record_step(",
        "if (0 && !engine_record_step(",
    ),
    "jumps are not counted": ("jumps.c", "engine->statistics.jumps++;", ""),
    "rows do not grow": ("recorder.c", "rows->count == rows->capacity", "rows->capacity == 0"),
    "a run does not come back": ("engine.c", "return ADVANCE_PAUSED;", "return ADVANCE_REACHED;"),
}


def built(folder, name, changed=None, flags=("-O1",)):
    """The engine's library, with a file changed."""
    target = folder / f"{name}.so"
    own = folder / name
    own.mkdir()
    files = dict(SOURCES)
    if changed is not None:
        file, old, new = changed
        text = SOURCES[file].read_text()
        assert text.count(old) == 1, f"{file}: {text.count(old)} places have {old!r}"
        files[file] = own / file
        files[file].write_text(text.replace(old, new))
    includes = [f"-I{place}" for place in FOLDERS]
    command = [*find_compiler(), "-std=c99", "-shared", "-fPIC", "-fvisibility=hidden", *flags, *includes]
    subprocess.run([*command, *map(str, files.values()), "-lm", "-o", str(target)], check=True, capture_output=True)
    return target


def recorded_runs_are_right():
    """Raise if a recorded run is another one than that of the Python engine."""
    # The last one leaves some 25 times as many rows as there is room for at first.
    for automaton, end in ((BouncingBall(), 2.4), (SampledLtiLoop(), 4.0), (Saw(), 1.6)):
        plain = hm.simulate(automaton, end, engine="python")
        for record in ("all", "events"):
            arc = hm.simulate(automaton, end, engine="native", record=record)
            assert arc.stop is plain.stop
            assert arc.statistics.jumps == len(plain.jumps) == len(arc.jumps)
            assert np.all(np.diff(arc.t) >= 0.0)
            for one, other in zip(arc.jumps, plain.jumps, strict=True):
                for side in ("x_before", "z_before", "x_after", "z_after"):
                    np.testing.assert_allclose(getattr(one, side), getattr(other, side), atol=1e-10)
        arc = hm.simulate(automaton, end, engine="native")
        times = np.linspace(0.0, end, 57)
        events = np.array([jump.t for jump in plain.jumps])
        apart = times[np.abs(times[:, None] - events).min(axis=1) > 1e-9]
        for name in [variable.name for variable in automaton.variables]:
            np.testing.assert_allclose(arc.at(name, apart), plain.at(name, apart), atol=1e-10)
            # Where a step was cut at an event, its interpolation leads there as well.
            np.testing.assert_allclose(arc[name], arc.at(name, arc.t, j=arc.j), atol=1e-10)
            nearly = np.nextafter(arc.t[1:], 0.0)[np.diff(arc.t) > 0.0]
            np.testing.assert_allclose(arc.at(name, nearly), arc[name][1:][np.diff(arc.t) > 0.0], atol=1e-10)


@pytest.fixture
def with_engine(monkeypatch):
    def use(path):
        run._engine.cache_clear()
        monkeypatch.setattr(run, "engine_library", lambda: path)
        monkeypatch.setattr("hybrid_model.native.simulation.STEPS_AT_ONCE", 7)
        return recorded_runs_are_right

    yield use
    run._engine.cache_clear()


@pytest.mark.faults
def test_the_recording_as_it_is_survives(with_engine, tmp_path):
    with_engine(built(tmp_path, "whole"))()


@pytest.mark.parametrize("fault", FAULTS)
def test_its_place_is_there(fault):
    file, old, _ = FAULTS[fault]
    assert SOURCES[file].read_text().count(old) == 1


SCRIPT = """
import sys
sys.path[:] = sys.argv[2:]
import test_recorded_runs as here
from hybrid_model.native import run, simulation
run.engine_library = lambda: sys.argv[1]
simulation.STEPS_AT_ONCE = 7
print("begins", flush=True)
here.recorded_runs_are_right()
"""


def in_its_own_process(path, **environment):
    """A fault may end the process."""
    command = ["env", *(f"{key}={value}" for key, value in environment.items()), sys.executable, "-c", SCRIPT]
    done = subprocess.run([*command, str(path), *sys.path], capture_output=True, text=True, timeout=300, check=False)
    assert done.stdout == "begins\n", done.stderr
    return done


@pytest.mark.faults
@pytest.mark.parametrize("fault", FAULTS)
def test_killed(fault, tmp_path):
    assert in_its_own_process(built(tmp_path, "changed", FAULTS[fault])).returncode != 0


@pytest.mark.faults
@pytest.mark.skipif(sys.platform != "linux", reason="LD_PRELOAD")
def test_under_sanitizers(tmp_path):
    path = built(
        tmp_path, "sanitized", None, ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    )
    preload = ":".join(map(library, ("libasan.so", "libubsan.so")))
    done = in_its_own_process(path, LD_PRELOAD=preload, ASAN_OPTIONS="detect_leaks=0")
    assert (done.returncode, done.stderr) == (0, "")


COUNTER = """
#include <stdlib.h>
void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *memory, size_t size);
__attribute__((visibility("default"))) long asked;
void *__wrap_malloc(size_t size) { asked++; return __real_malloc(size); }
void *__wrap_calloc(size_t n, size_t size) { asked++; return __real_calloc(n, size); }
void *__wrap_realloc(void *memory, size_t size) { asked++; return __real_realloc(memory, size); }
"""


@pytest.mark.faults
@pytest.mark.skipif(sys.platform != "linux", reason="the linker's --wrap")
def test_nothing_is_allocated_but_for_a_new_engine_and_for_rows(monkeypatch, tmp_path):
    """With all three methods, looks ahead, jumps, saved and restored states; rows double from 64 on."""
    counter = tmp_path / "counter.c"
    counter.write_text(COUNTER)
    monkeypatch.setitem(SOURCES, counter.name, counter)
    path = built(tmp_path, "counting", None, ("-O1", "-Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc"))
    asked = ctypes.c_long.in_dll(ctypes.CDLL(str(path)), "asked")
    run._engine.cache_clear()
    monkeypatch.setattr(run, "engine_library", lambda: path)

    def growths(rows):
        return 0 if rows == 0 else 1 + max(0, math.ceil(math.log2(rows / 64)))

    try:
        for automaton, end in (
            (BouncingBall(), 2.4),
            (SampledLtiLoop(), 4.0),
            (Saw(), 1.6),
            (VanDerPol(damping=50.0), 200),
        ):
            inputs = Inputs(layout_of(automaton))
            model = made_model(automaton, traced_maps(automaton), stiff=isinstance(automaton, VanDerPol))
            start = [inputs.start(Kind.STATE), inputs.start(Kind.DISCRETE), inputs.held, inputs.parameters_at(0.0)]
            for record in run.Record:
                before = asked.value
                engine = run.NativeRun(model)
                assert asked.value > before
                before = asked.value
                assert engine.start(start, 0.0, end, record)
                engine.restore(engine.save())
                assert engine.advance(end) is run.Advance.REACHED
                counts = engine.statistics
                kept = (counts.steps * (record is run.Record.ALL), counts.jumps * (record is not run.Record.NOTHING))
                assert asked.value - before == sum(map(growths, kept)), (automaton.name, record, counts)
                assert (counts.jacobians > 0) is isinstance(automaton, VanDerPol)
    finally:
        run._engine.cache_clear()


def test_runs_on_threads_do_not_meet():
    balls = [BouncingBall(e=0.5 + 0.01 * k) for k in range(8)]
    alone = [hm.simulate(ball, 2.0, engine="native").event_times("jump") for ball in balls]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda ball: hm.simulate(ball, 2.0, engine="native").event_times("jump"), balls * 5))
    for times, again in zip(alone * 5, together, strict=True):
        np.testing.assert_array_equal(times, again)
