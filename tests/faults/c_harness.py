"""Builds the C harness of a model, whole or with other sources of the runtime, and talks to it.

Objects are kept by the hash of what they are made of: a test of fifty changed runtimes compiles one file for each.
"""

import functools
import hashlib
import math
import os
import select
import struct
import subprocess
import time
from pathlib import Path

from fmu.build.binaries import OWN_FOLDERS, fmi_headers, own_files, runtime_sources
from fmu.build.fmu_code import fmu_code
from fmu.describe.variable_table import fmu_variables
from fmu.describe.variables import Fmi
from hybrid_model import Automaton
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.networks.network import trace_any

HERE = Path(__file__).parent
TOKEN = "0123456789abcdef0123456789abcdef"
VERSIONS = ("2.0", "3.0")
FLAVOURS = {
    "plain": ("-O1",),
    "debug": ("-O1", "-g"),
    "addresses": ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    "races": ("-O1", "-g", "-fsanitize=thread"),
}
_BASE = ("-ffp-contract=off", "-fno-omit-frame-pointer")
_STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wformat=2", "-Werror")
_WRAP = ("-Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=free", "-lm", "-lpthread")
_HARNESS = ("harness.c", "importer.c", "shim.c", "threads.c")
TIME_LIMIT = 60.0  # s for one call, of which none takes a second: far beyond what a loaded machine needs


class Fallen(AssertionError):
    """The process ended, or does not answer: a promise was broken, a sanitizer spoke, or it hangs."""


@functools.lru_cache(maxsize=64)
def generated(automaton: Automaton, fmi: str) -> tuple[str, tuple]:
    """The model's C code, and its variables in the order of their references."""
    traced = trace_any(automaton)
    variables = fmu_variables(traced, Fmi(fmi))
    return fmu_code(traced, variables, TOKEN, ("cs", "me")), variables


class Builder:
    """Compiles into one folder, each source once.

    Parameters
    ----------
    folder : Path
        Where objects and programs go.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def build(self, automaton, fmi, flavour="plain", changed=None):
        """A program; `changed` holds other texts for files of the runtime."""
        code, _ = generated(automaton, fmi)
        flags = (*FLAVOURS[flavour], *_BASE, f"-DFMI_VERSION={fmi[0]}")
        objects = [self._object("model.c", code, ("-std=c99", *flags))]
        for source in runtime_sources(fmi):
            text = (changed or {}).get(source.name) or source.read_text()
            objects.append(self._object(source.name, text, ("-std=c99", *flags)))
        # The harness itself uses threads and lines of any length.
        for name in _HARNESS:
            objects.append(self._object(name, (HERE / name).read_text(), ("-std=gnu99", *_STRICT, *flags)))
        program = self.folder / hashlib.sha256(repr(objects).encode()).hexdigest()[:20]
        if not program.exists():
            made = program.with_suffix(f".{os.getpid()}")
            run(*find_compiler(), *flags, *map(str, objects), *_WRAP, "-o", str(made))
            os.replace(made, program)
        return program

    def _object(self, name, text, flags):
        headers = "".join(path.read_text() for path in sorted([*own_files("*.h"), *HERE.glob("*.h")]))
        key = hashlib.sha256(repr((name, text, flags, headers)).encode()).hexdigest()[:20]
        target = self.folder / f"{key}.o"
        if not target.exists():
            place = self.folder / f"{key}-{os.getpid()}"
            place.mkdir()
            (place / name).write_text(text)
            includes = [*(f"-I{folder}" for folder in (*OWN_FOLDERS, HERE)), "-isystem", str(fmi_headers())]
            run(*find_compiler(), *flags, *includes, "-c", str(place / name), "-o", str(place / "made.o"))
            os.replace(place / "made.o", target)
        return target


def run(*command, **options):
    """A command's output; a failure shows what it said."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
    return done.stdout


def digits(value):
    return struct.pack(">d", value).hex()


def number(word):
    return struct.unpack(">d", bytes.fromhex(word))[0]


class Harness:
    """A running harness: `ask` sends one call and returns the words of the answer.

    Parameters
    ----------
    program : Path
        As from `Builder.build`.
    variables : sequence of FmuVariable
        The model's.
    before : sequence of str
        What runs the program, as valgrind does.
    environment : dict, optional
        In addition to this process's.
    time_limit : float
        For one answer, in s.
    whole : float
        For all of them, in s.
    """

    def __init__(self, program, variables, before=(), environment=None, time_limit=TIME_LIMIT, whole=math.inf):
        self.variables = variables
        self.places = {variable.name: k for k, variable in enumerate(variables)}
        self.time_limit, self.deadline = time_limit, time.monotonic() + whole
        self.process = subprocess.Popen(
            [*before, str(program)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | (environment or {}),
            bufsize=0,
        )
        self.buffer = b""
        self.calls = []

    def ask(self, *words):
        line = " ".join(
            digits(word) if isinstance(word, float) else str(int(word) if isinstance(word, bool) else word)
            for word in words
        )
        self.calls.append(line)
        try:
            self.process.stdin.write(line.encode() + b"\n")
        except BrokenPipeError:
            self._fall("it ended")
        if time.monotonic() > self.deadline:
            self._fall("answers take too long")
        while b"\n" not in self.buffer:
            ready, _, _ = select.select([self.process.stdout], [], [], self.time_limit)
            if not ready:
                self._fall(f"no answer within {self.time_limit} s")
            some = os.read(self.process.stdout.fileno(), 1 << 16)
            if not some:
                self._fall("it ended")
            self.buffer += some
        answer, _, self.buffer = self.buffer.partition(b"\n")
        return answer.decode().split(" ")

    def _fall(self, reason):
        self.process.kill()
        _, errors = self.process.communicate()
        last = "\n".join(self.calls[-5:])
        raise Fallen(f"{reason}\nlast calls:\n{last}\n{errors.decode(errors='replace')[-4000:]}")

    def close(self):
        """End the process: what leak checkers say at its end counts."""
        self.process.stdin.close()
        self.process.stdin = None
        try:
            _, errors = self.process.communicate(timeout=self.time_limit)
        except subprocess.TimeoutExpired:
            self._fall("it does not end")
        if self.process.returncode != 0:
            raise Fallen(f"exit {self.process.returncode}\n{errors.decode(errors='replace')[-4000:]}")
        return errors.decode(errors="replace")

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is None:
            self.close()
        elif self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


NONE = math.nan


class Instance:
    """One instance in a harness; `call` returns the status and what else was said, `do` insists on OK.

    Parameters
    ----------
    harness : Harness
        Where it lives.
    slot : int
        Which of the harness's places it takes.
    kind : {"cs", "me"}
        Kind of FMU.
    events, early, logging, listening : bool
        As at instantiation; version 2 knows no event mode in Co-Simulation.
    update : int
        Intermediate update: 0 none, 1 looks, 2 asks for early returns.
    """

    def __init__(
        self,
        harness,
        slot=0,
        kind="cs",
        *,
        events=True,
        early=True,
        logging=True,
        listening=True,
        update=0,
        name="block",
        token="own",
    ):
        self.harness, self.slot, self.kind, self.events = harness, slot, kind, events
        text = "-" if name is None else name.encode().hex() or "."
        self.status = int(harness.ask("new", slot, kind, events, early, logging, listening, update, text, token)[0])

    def call(self, name, *words):
        status, *rest = self.harness.ask(name, self.slot, *words)
        return int(status), rest

    def do(self, name, *words):
        status, rest = self.call(name, *words)
        if status != 0:
            raise AssertionError(f"{name} {words}: status {status}, {self.log()}")
        return rest

    def begin(self, start=0.0, stop=NONE, tolerance=NONE):
        self.do("begin", float(start), float(stop), float(tolerance))

    def boot(self, start=0.0, stop=NONE, **given):
        """To the end of initialisation."""
        self.begin(start, stop)
        for name, value in given.items():
            self.set(name, value)
        self.do("plain", "end")

    def get(self, name):
        found = [number(word) for word in self.do("get", self.harness.places[name])]
        return found[0] if len(found) == 1 else found

    def set(self, name, value):
        values = [float(v) for v in (value if isinstance(value, (list, tuple)) else [value])]
        self.do("set", self.harness.places[name], *values)

    def values(self):
        """Everything that can be read, bit for bit."""
        return tuple(self.do("values"))

    def vector(self, what, n):
        return [number(word) for word in self.do("vector", what, n)]

    def step(self, t, h):
        """(event, terminate, early, time) of a step."""
        event, terminate, early, time = self.do("step", float(t), float(h))
        return event == "1", terminate == "1", early == "1", number(time)

    def update(self):
        """(again, terminate, changed, next time or None)."""
        again, terminate, changed, has_next, time = self.do("update")
        return again == "1", terminate == "1", changed == "1", number(time) if has_next == "1" else None

    def iterate(self, enter="step"):
        """Event Mode to its end; the number of updates, and the next event's time."""
        for n in range(1, 3000):
            again, terminate, _, time = self.update()
            if terminate:
                return n, None
            if not again:
                self.do("plain", enter)
                return n, time
        raise AssertionError("3000 event iterations")

    def log(self):
        """Messages since they were last asked for."""
        return " ".join(self.harness.ask("log")).split("|")[:-1]

    def free(self):
        self.harness.ask("free", self.slot)
