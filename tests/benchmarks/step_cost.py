"""What the calls of an FMU cost in a C driver: this project's ball and those of other tools, all in one run.

``PYTHONPATH=tests python -m benchmarks.step_cost`` prints the tables. The driver (``step_cost*.c``) is compiled first;
what it compares with is built by the packages pythonfmu and pythonfmu3 of the extra ``benchmark``. Its contenders take
turns, so that what disturbs one disturbs all. Times are in ns a call, the least and the median of the rounds; ratios
are those of the least, which other work on the machine changes little.
"""

import argparse
import ctypes.util
import os
import statistics
import subprocess
import sys
import sysconfig
import tempfile
from collections import defaultdict
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import fmpy
import numpy as np

from fmu.build.binaries import fmi_headers
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.objects import COMMON_FLAGS, STRICT_FLAGS

HERE = Path(__file__).parent
HEIGHT, GRAVITY, RESTITUTION = 1.0, 9.81, 0.7
STEP, STOP = 0.01, 2.0
FLIGHT = 0.4
"""A time in s before the first impact, which comes at 0.45 s."""
TIME_LIMIT = 600
READ = ("h", "v")
EULER = "forward Euler in C, stand-in"
REFERENCE = "FMI Reference FMU"
MEASURED = ("step", "flight", "step and read", "read", "save and restore", "events announced", "events by early return")


class DriverError(RuntimeError):
    """The driver or something that it needs could not be compiled, or a contender failed in it."""


@dataclass(frozen=True)
class Contender:
    """A binary, as the driver's command line names it.

    Attributes
    ----------
    references : tuple of int
        Value references of the height and the velocity.
    capabilities : str
        ``e`` event mode, ``s`` states can be saved, ``-`` neither.
    embeds : bool
        Whether it embeds an interpreter whose library it does not name.
    """

    name: str
    version: str
    binary: Path
    token: str
    resources: str
    references: tuple[int, ...]
    capabilities: str
    embeds: bool = False

    @property
    def arguments(self):
        references = ",".join(map(str, self.references))
        return [self.name, self.version, str(self.binary), self.token, self.resources, references, self.capabilities]


@dataclass
class Measured:
    """What the driver printed of one contender: ns of each round by what was timed, and values at the points."""

    times: dict = field(default_factory=lambda: defaultdict(list))
    counts: dict = field(default_factory=dict)
    values: list = field(default_factory=list)


# Building.


def compiled(command, task):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise DriverError(f"The compiler could not {task}. Remedy: correct what it reports:\n{done.stderr[-3000:]}")


def compile_driver(folder):
    """The driver's executable."""
    program = Path(folder) / "step_cost"
    flags = [flag for flag in COMMON_FLAGS if not flag.startswith(("-fPIC", "-fvisibility"))]
    sources = map(str, sorted(HERE.glob("step_cost*.c")))
    includes = ["-isystem", str(fmi_headers())]
    compiled(
        [*find_compiler(), *flags, *STRICT_FLAGS, *includes, *sources, "-ldl", "-o", str(program)],
        "compile the driver",
    )
    return program


def euler_ball(folder, optimisation="-O2"):
    """A ball in plain C, compiled as this project's FMUs are, or without optimisation as CMake does by default."""
    binary = Path(folder) / f"euler_ball{optimisation}.so"
    flags = [optimisation if flag == "-O2" else flag for flag in COMMON_FLAGS if "visibility" not in flag]
    command = [*find_compiler(), *flags, *STRICT_FLAGS, "-isystem", str(fmi_headers()), "-shared"]
    compiled([*command, str(HERE / "euler_ball.c"), "-lm", "-o", str(binary)], "compile the ball in C")
    return Contender(f"{EULER}, {optimisation}", "3.0", binary, "any", "/", (1, 2), "e")


def contender(name, path, folder, embeds=False, read=READ):
    """An FMU as the driver runs it: extracted, with what its description says."""
    description = fmpy.read_model_description(str(path), validate=False)
    place = Path(tempfile.mkdtemp(dir=folder))
    fmpy.extract(str(path), str(place))
    versions = {"2.0": fmpy.platform, "3.0": fmpy.platform_tuple}
    version = description.fmiVersion[:3]
    if version not in versions:
        raise DriverError(f"'{path}' is for FMI {description.fmiVersion}; the driver runs FMI 2.0 and 3.0.")
    kind = description.coSimulation
    binary = place / "binaries" / versions[version] / f"{kind.modelIdentifier}{fmpy.sharedLibraryExtension}"
    if not binary.is_file():
        raise DriverError(f"'{path}' has no binary for this platform. Remedy: build it from its sources first.")
    found = {variable.name: variable.valueReference for variable in description.modelVariables}
    capabilities = "e" if version == "3.0" and kind.hasEventMode else ""
    capabilities += "s" if kind.canGetAndSetFMUstate else ""
    resources = place / "resources"
    return Contender(
        name,
        version,
        binary,
        description.guid if version == "2.0" else description.instantiationToken,
        resources.as_uri() if version == "2.0" else f"{resources}/",
        tuple(found[variable] for variable in read),
        capabilities or "-",
        embeds,
    )


def own_ball(folder, version="3.0"):
    path = Path(folder) / f"own_ball_{version}.fmu"
    export_fmu(BouncingBall(h=HEIGHT, g=GRAVITY, e=RESTITUTION), path, fmi=version)
    return contender(f"hybrid-fmu, FMI {version}", path, folder)


def python_ball(folder, package):
    """A ball in Python, made an FMU by `package`: pythonfmu or pythonfmu3."""
    builder = __import__(f"{package}.builder", fromlist=["FmuBuilder"]).FmuBuilder
    path = builder.build_FMU(HERE / f"step_cost_{package}.py", dest=Path(folder) / package)
    version = "3.0" if package == "pythonfmu3" else "2.0"
    return contender(f"{package}, FMI {version}", path, folder, embeds=True)


def contenders(folder, reference=None):
    """All that can be had here: this project's ball, then what the others are compared with, then the rest."""
    base = [contender(REFERENCE, reference, folder)] if reference else []
    base += [euler_ball(folder, "-O2"), euler_ball(folder, "-O0")]
    packages = [package for package in ("pythonfmu3", "pythonfmu") if find_spec(package)]
    return [own_ball(folder), *base, own_ball(folder, "2.0"), *(python_ball(folder, package) for package in packages)]


def groups(balls):
    """The contenders that share a process: two interpreters in one would wait for each other.

    Each contender that embeds one has a process with it, this project's ball and the one that is compared with.
    """
    plain = [ball for ball in balls if not ball.embeds]
    return [plain, *([*plain[:2], ball] for ball in balls if ball.embeds)]


# Running.


def python_library():
    """The shared library of this interpreter, which FMUs of pythonfmu and pythonfmu3 need and do not name."""
    folder, name = sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME")
    path = Path(folder or "") / (name or "")
    if path.suffix != ".a" and path.is_file():
        return str(path)
    return ctypes.util.find_library(f"python{sys.version_info.major}.{sys.version_info.minor}")


def run(program, balls, *, rounds, step=STEP, stop=STOP):
    """What the driver measures, by contender."""
    steps, flight = (round(t / step) for t in (stop, min(FLIGHT, stop)))
    command = [str(program), "--step", str(step), "--steps", str(steps), "--flight", str(flight)]
    command += ["--rounds", str(rounds)]
    environment = dict(os.environ)
    if any(ball.embeds for ball in balls):
        library = python_library()
        if library is None:
            raise DriverError("There is no shared library of this Python. Remedy: use a Python built with one.")
        command += ["--preload", library]
        # An embedded interpreter looks for its modules beside the program that it finds itself in.
        environment |= {"PYTHONHOME": sys.base_prefix, "PYTHONPATH": sysconfig.get_path("purelib")}
    for ball in balls:
        command += ["--fmu", *ball.arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False, timeout=TIME_LIMIT)
    except subprocess.TimeoutExpired as error:
        raise DriverError(f"The driver did not end within {TIME_LIMIT} s. Remedy: ask for fewer rounds.") from error
    if done.returncode != 0:
        raise DriverError(f"The driver failed: {done.stderr[-3000:]}")
    return parsed(done.stdout, balls)


def parsed(text, balls):
    measured = {ball.name: Measured() for ball in balls}
    for line in text.splitlines():
        kind, *words = line.split("\t")
        if kind == "time":
            name, what, value = words
            measured[name].times[what].append(float(value))
        elif kind == "count":
            name, what, calls, events = words
            measured[name].counts[what] = (int(calls), int(events))
        elif kind == "value":
            name, *numbers = words
            measured[name].values.append(tuple(map(float, numbers)))
    return measured


# Judging what they computed.


def first_impact(values):
    """Time and height of the first impact, carried back from the first communication point after it.

    The velocity there tells when the impact was, since a flight is a parabola and the rebound is the restitution times
    the speed at the impact, which is gravity times its time; the height there then tells from what height it rose.
    """
    t, h, v = next(row for row in values if row[2] > 0.0)
    impact = (v / GRAVITY + t) / (1.0 + RESTITUTION)
    left = t - impact
    return impact, h - (v + 0.5 * GRAVITY * left) * left


def impact_errors(values):
    """Distances of the first impact's time and height from sqrt(2 h/g) and 0."""
    time, height = first_impact(values)
    return abs(time - np.sqrt(2.0 * HEIGHT / GRAVITY)), abs(height)


# Printing.


def ratio(measured, base, what):
    """Ratio of the least times: a round that is interrupted says more of the machine than of the contender."""
    return min(measured.times[what]) / min(base.times[what])


def cost(times):
    return f"{min(times):.0f} / {statistics.median(times):.0f}" if times else "-"


def row(*cells):
    return f"| {' | '.join(map(str, cells))} |"


def rows_of(runs):
    """Each contender once: its name, and what was measured of it, of this project's ball and of the base beside it."""
    for number, measured in enumerate(runs):
        names = list(measured)
        for name in names if number == 0 else names[2:]:
            yield name, measured[name], measured[names[0]], measured[names[1]]


def steps_table(runs):
    base = list(runs[0])[1]
    columns = (
        "contender",
        "step",
        "step without impact",
        "step / hybrid-fmu",
        f"step / {base}",
        "impact off by",
        "its height",
    )
    lines = [row(*columns), row(*["---"] * len(columns))]
    for name, ball, own, other in rows_of(runs):
        time, height = impact_errors(ball.values)
        ratios = [f"{ratio(ball, of, 'step'):.2f}" for of in (own, other)]
        costs = [cost(ball.times[what]) for what in ("step", "flight")]
        lines.append(row(name, *costs, *ratios, f"{time:.1e} s", f"{height:.1e} m"))
    return "\n".join(lines)


def calls_table(runs):
    columns = ("contender", *(what for what in MEASURED if what not in ("step", "flight")))
    lines = [row(*columns), row(*["---"] * len(columns))]
    lines += [row(name, *(cost(ball.times[what]) for what in columns[1:])) for name, ball, *_ in rows_of(runs)]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(prog="python -m benchmarks.step_cost", description=__doc__)
    parser.add_argument("--rounds", type=int, default=200, help="timed runs of each contender (default %(default)s)")
    parser.add_argument("--reference", type=Path, help="BouncingBall.fmu of the FMI Reference FMUs, if it is at hand")
    parser.add_argument("--step", type=float, default=STEP, help="communication step in s (default %(default)s)")
    parser.add_argument("--stop", type=float, default=STOP, help="end of each run in s (default %(default)s)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        program = compile_driver(folder)
        balls = contenders(folder, options.reference)
        runs = [
            run(program, group, rounds=options.rounds, step=options.step, stop=options.stop) for group in groups(balls)
        ]
    print(f"{steps_table(runs)}\n\n{calls_table(runs)}")


if __name__ == "__main__":
    main()
