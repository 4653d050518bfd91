"""Instances in the C harness: nothing is leaked, lost, shared or read after its time, whatever is asked of them."""

import itertools
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from c_harness import VERSIONS, Instance
from c_runs import MODES, agree, co_simulation, go_to_mode, has_mode, model_exchange, python_run
from c_witnesses import WITNESSES
from fmi_driver.binary import Binary
from fmi_driver.journey import instance
from fmi_driver.runs import advance

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(sys.platform != "linux", reason="the harness is built by gcc's linker options"),
]
versions = pytest.mark.parametrize("fmi", VERSIONS)
BALL = WITNESSES["ball"]
USES = [(kind, mode) for kind in ("cs", "me") for mode in MODES]
# What a string must survive: formats, quotes, characters of more than one byte, and more than a message holds.
NAMES = ["%s%n%d", "%", "näme ☂ \U0001f6f8", "a\"'\\<&>", "%n" * 2000, "☂" * 2000]


def living(harness):
    return int(harness.ask("memory")[0])


def cycles(harness, fmi, n):
    for kind, mode in USES:
        if has_mode(mode, fmi, kind):
            for _ in range(n):
                instance = Instance(harness, kind=kind)
                go_to_mode(instance, mode, fmi)
                instance.values()
                instance.free()
            assert living(harness) == 0, (kind, mode)


@versions
def test_freed_in_every_mode(fmi, started):
    """Fifty times each; the leak checker of the sanitizer has the last word when the process ends."""
    harness = started(BALL.automaton, fmi, "addresses")
    cycles(harness, fmi, 50)
    harness.ask("free", 3)  # nobody is there


@versions
def test_calls_with_nothing_in_every_mode(fmi, started):
    """Null pointers are refused, lengths of zero are fine, and the run that follows is the usual one."""
    harness = started(BALL.automaton, fmi, "addresses")
    for (kind, mode), listening in itertools.product(USES, (True, False)):
        if has_mode(mode, fmi, kind):
            instance = Instance(harness, kind=kind, listening=listening)
            go_to_mode(instance, mode, fmi)
            before = instance.values()
            _, [answers] = instance.call("nulls")
            # Nothing read is nothing wrong, and there is nothing to forget at a null pointer.
            assert answers[0] == "O"
            assert set(answers[1:3]) == {"E"}
            assert instance.values() == before
            instance.free()
    agree(BALL, python_run(BALL), co_simulation(harness, BALL, events=fmi == "3.0"))


@versions
def test_thousands_of_instances_leave_nothing_behind(fmi, started):
    """Flat memory, files and threads of the process."""
    harness = started(BALL.automaton, fmi)
    process = Path(f"/proc/{harness.process.pid}")

    def state():
        pages = int((process / "statm").read_text().split()[1])
        return pages, len(os.listdir(process / "fd")), len(os.listdir(process / "task"))

    def live(n):
        for k in range(n):
            instance = Instance(harness, kind=("cs", "me")[k % 2])
            instance.boot()
            instance.free()

    live(200)
    before = state()
    live(2000)
    after = state()
    assert after[1:] == before[1:]
    # Some pages for the buffers of the C library; a single leaked instance of 2000 bytes would be a thousand pages.
    assert after[0] - before[0] < 32


@versions
@pytest.mark.parametrize("kind", ["cs", "me"])
def test_memory_that_is_not_there(kind, fmi, started):
    """Each allocation fails once: no instance or an error, a message, and not a byte lost."""
    harness = started(BALL.automaton, fmi, "addresses")
    made = False
    for n in range(1, 20):
        harness.ask("fail", n)
        instance = Instance(harness, kind=kind)
        harness.ask("fail", 0)
        made = instance.status == 0
        if made:
            break
        assert "out of memory" in instance.log()[-1]
        assert living(harness) == 0
    assert made
    assert n > 4
    instance.boot()
    held, values = living(harness), instance.values()
    for call in (("save", 0), ("bytes", 0), ("parse", 1)):
        harness.ask("fail", 1)
        status, _ = instance.call(*call)
        harness.ask("fail", 0)
        if call[0] != "bytes":  # which allocates nothing
            assert status == 3
            assert "out of memory" in instance.log()[-1]
            assert living(harness) == held
        instance.do(*call)
        held = living(harness)
        assert instance.values() == values
    for slot in (0, 1, 0):
        instance.do("drop", slot)
    instance.free()
    assert living(harness) == 0


@versions
@pytest.mark.parametrize("name", NAMES)
def test_names_are_no_formats_and_are_copied(name, fmi, started):
    """The harness overwrites and frees name, token and callbacks right after instantiation; messages have the name."""
    harness = started(BALL.automaton, fmi, "addresses")
    instance = Instance(harness, name=name)
    instance.boot()
    status, _ = instance.call("plain", "end")
    assert status == 3
    [message] = instance.log()
    assert message.startswith(name[: len(message)][:300])
    status, _ = instance.call("debug", 1, name.encode().hex())
    assert status == 3
    [message] = instance.log()
    assert message.startswith(name[:300])
    instance.free()
    refused = Instance(harness, name=name, token="%s%n%n")
    assert refused.status == 3
    assert len(refused.log()) == 1


@versions
@pytest.mark.parametrize("logging", [True, False])
def test_errors_are_logged_and_events_where_wanted(logging, fmi, started):
    harness = started(BALL.automaton, fmi, "addresses")
    instance = Instance(harness, logging=logging, events=False, early=False)
    instance.boot()
    instance.step(0.0, 1.0)
    assert len(instance.log()) == (1 if logging else 0)
    assert instance.call("step", 0.0, 1.0)[0] == 3
    assert len(instance.log()) == 1
    instance.do("debug", 1, b"logStatusError".hex())
    instance.step(1.0, 0.5)
    assert instance.log() == []
    instance.do("debug", 1, "-")
    instance.step(1.5, 0.5)
    assert len(instance.log()) == 2
    instance.free()


@versions
@pytest.mark.parametrize("rounding", ["up", "down", "zero"])
def test_the_hosts_rounding_is_kept(rounding, fmi, started):
    """Any mode is the same to the FMU, and after each call it is as before: the harness looks."""
    harness = started(BALL.automaton, fmi)
    harness.ask("rounding", rounding)
    co_simulation(harness, BALL, events=fmi == "3.0")
    model_exchange(harness, BALL)


@versions
@pytest.mark.parametrize("name", ["ball", "mix", "timers"])
def test_under_valgrind(name, fmi, started):
    witness = WITNESSES[name]
    before = ["valgrind", "--quiet", "--leak-check=full", "--show-leak-kinds=all", "--error-exitcode=9"]
    harness = started(witness.automaton, fmi, "debug", before=before, time_limit=300.0)
    agree(witness, python_run(witness), co_simulation(harness, witness, events=fmi == "3.0"))
    cycles(harness, fmi, 3)
    instance = Instance(harness)
    instance.boot()
    for call in (("save", 0), ("bytes", 0), ("parse", 1), ("load", 1), ("nulls",), ("drop", 1), ("rates",)):
        instance.call(*call)
    instance.call("drop", 0)
    instance.free()
    assert harness.close() == ""


@versions
@pytest.mark.parametrize("name", ["ball", "mix"])
def test_threads_do_not_race(name, fmi, started):
    """Each instance on its own thread runs as if alone, and the sanitizer sees no access without order."""
    harness = started(WITNESSES[name].automaton, fmi, "races", environment={"TSAN_OPTIONS": "halt_on_error=1"})
    assert harness.ask("threads", 8, 20, 0.1) == ["0"]


@versions
@pytest.mark.parametrize("name", WITNESSES)
def test_threads_with_little_stack(name, fmi, started):
    """64 KiB are enough, for the harness's own buffers as well."""
    harness = started(WITNESSES[name].automaton, fmi)
    assert harness.ask("threads", 16, 20, 0.1) == ["0"]


@pytest.mark.parametrize("name", ["ball", "mix"])
def test_sixteen_threads_of_python(name, exported):
    """ctypes lets other threads run during a call: all of them are in the binary at once."""
    binary = Binary(exported(WITNESSES[name].automaton, f"threads_{name}"))
    points = [0.1 * k for k in range(21)]

    def run():
        component = instance(binary, "3.0 CS")
        component.initialize(0.0, points[-1])
        record = advance(component, points)
        component.free()
        return record

    alone, found, start = run(), [], threading.Barrier(16)

    def work():
        start.wait()
        found.append(run())

    threads = [threading.Thread(target=work) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [alone] * 16


@pytest.fixture(scope="module")
def german(tmp_path_factory):
    """A folder with a locale whose decimal sign is a comma."""
    folder = tmp_path_factory.mktemp("locales")
    done = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")], capture_output=True, check=False
    )
    if not (folder / "de_DE.UTF-8" / "LC_NUMERIC").exists():
        pytest.skip(f"no such locale can be made here: {done.stderr[-200:]!r}")
    return {"LOCPATH": str(folder)}


@versions
def test_the_locale_of_the_host_changes_nothing(fmi, german, started):
    """The same bits as without it, in values and in saved states."""
    seen = []
    for locale in ("C", "de_DE.UTF-8"):
        harness = started(WITNESSES["mix"].automaton, fmi, environment=german)
        assert harness.ask("locale", locale) == ["0", "1.5" if locale == "C" else "1,5"]
        instance = Instance(harness, events=False, early=False)
        instance.boot()
        instance.step(0.0, 1.7)
        instance.do("save", 0)
        instance.do("bytes", 0)
        seen.append((instance.values(), harness.ask("showbytes")))
        instance.do("drop", 0)
        instance.free()
    assert seen[0] == seen[1]


EXPORT = """
import locale, sys
if sys.argv[3] != "C":
    locale.setlocale(locale.LC_ALL, sys.argv[3])
    assert locale.str(1.5) == "1,5"
sys.path.insert(0, sys.argv[1])
from fmu.export import export_fmu
from witnesses import Mix
for fmi in ("2.0", "3.0"):
    export_fmu(Mix(), f"{sys.argv[2]}-{fmi}.fmu", fmi=fmi, stop_time=1.5)
"""


def test_the_locale_of_the_exporter_changes_no_byte(german, tmp_path):
    support = str(Path(__file__).parents[1] / "support")
    for locale in ("C", "de_DE.UTF-8"):
        command = [sys.executable, "-c", EXPORT, support, str(tmp_path / locale), locale]
        subprocess.run(command, check=True, env=os.environ | german, cwd=tmp_path)
    for fmi in VERSIONS:
        plain, other = (tmp_path / f"{locale}-{fmi}.fmu" for locale in ("C", "de_DE.UTF-8"))
        assert plain.read_bytes() == other.read_bytes()
