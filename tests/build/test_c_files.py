"""The C files of every FMU, by what their objects define and ask for: no circles, names with an owner, no state."""

import re
import shutil
import subprocess
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from witnesses import Mix

import cosim
from fmu.build.binaries import OWN_FOLDERS, fmi_headers, own_files
from fmu.build.fmu_code import fmu_code
from fmu.build.libraries import _units
from fmu.describe.variable_table import fmu_variables
from fmu.describe.variables import Fmi
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.libraries import _toolchain
from hybrid_model.native.build.objects import COMMON_FLAGS, GENERATED_FLAGS, STRICT_FLAGS, compile_units
from hybrid_model.native.networks.network import trace_any

ROUNDS = Path(cosim.__file__).with_name("rounds.c")
pytestmark = pytest.mark.skipif(not shutil.which("nm"), reason="needs nm")
PREFIXES = {
    "engine": "engine_",
    "networks": "network_",
    "interface": "instance_",
    "schedule": "(schedule|assembled|queue|pending|log)_",
}


def room_of(source):
    """The folder of a C file; locating events and the methods of integration are parts of the engine."""
    return "engine" if source.parent.name in ("location", "methods") else source.parent.name


INCLUDES = [*(f"-I{place}" for place in OWN_FOLDERS), "-isystem", str(fmi_headers())]


def compiled(source, folder, flags):
    target = folder / f"{source.stem}.o"
    subprocess.run([*find_compiler(), *flags, "-c", source, *INCLUDES, "-o", target], check=True)
    return target


# Users' compilers may warn of more than ours, which has to be content.
SPOTLESS = [*find_compiler(), *COMMON_FLAGS, *STRICT_FLAGS, "-Werror", *INCLUDES]


def test_the_compiler_does_not_warn_of_what_it_reads():
    subprocess.run([*SPOTLESS, "-fsyntax-only", *own_files("*.c"), ROUNDS], check=True)


@pytest.mark.long
def test_the_compiler_does_not_warn_of_what_it_optimises(tmp_path):
    """Such as a variable that is not set on some way through a function."""
    subprocess.run([*SPOTLESS, "-c", *own_files("*.c"), ROUNDS], cwd=tmp_path, check=True)


def names_in(target, *options):
    """What nm says of an object file, line by line."""
    return subprocess.run(["nm", *options, target], capture_output=True, text=True, check=True).stdout.splitlines()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The object of each C file as FMUs have it, and a master's own one."""
    folder = tmp_path_factory.mktemp("objects")
    units = _units(own_files("*.c"), OWN_FOLDERS, [fmi_headers()], _toolchain(), folder)
    compile_units(units, folder)
    return {unit.source: unit.file for unit in units} | {ROUNDS: compiled(ROUNDS, folder, COMMON_FLAGS)}


@pytest.fixture(scope="module")
def symbols(files):
    """Names that the object of a C file defines for others, and those that it asks for."""
    lines = {source: [line.split()[-2:] for line in names_in(target, "-g")] for source, target in files.items()}
    return {
        source: ({name for kind, name in found if kind != "U"}, {name for kind, name in found if kind == "U"})
        for source, found in lines.items()
    }


@pytest.fixture(scope="module")
def objects(symbols):
    """The same of the C files of FMUs."""
    return {source: both for source, both in symbols.items() if source != ROUNDS}


def calls(objects, room):
    """Which files of a room each of them calls functions of."""
    own = {source: both for source, both in objects.items() if room_of(source) == room}
    owner = {name: source.name for source, (defined, _) in own.items() for name in defined}
    return {source.name: {owner[name] for name in wanted & owner.keys()} for source, (_, wanted) in own.items()}


@pytest.mark.parametrize("room", ["engine", "networks", "schedule"])
def test_no_circle(room, objects):
    TopologicalSorter(calls(objects, room)).prepare()


def test_a_circle_is_seen(objects):
    graph = calls(objects, "engine")
    assert len(graph) > 15
    graph["message.c"].add("engine.c")
    with pytest.raises(CycleError):
        TopologicalSorter(graph).prepare()


def test_the_order_that_the_headers_tell_is_that_of_the_calls(objects):
    """Each section of parts.h and search.h is a file, which calls those of the sections before it only."""
    graph = calls(objects, "engine")
    for header in ("parts.h", "search.h"):
        sections = re.findall(r"^/\* (\w+\.c) \*/$", own_files(header)[0].read_text(), re.MULTILINE)
        assert len(sections) >= 3
        for k, name in enumerate(sections):
            assert graph[name].isdisjoint(sections[k + 1 :]), name


def test_the_engine_asks_nothing_of_the_interface(objects):
    known = {name for source, (defined, _) in objects.items() if source.parent.name == "interface" for name in defined}
    for source, (_, wanted) in objects.items():
        if source.parent.name != "interface":
            assert wanted.isdisjoint(known | {"model", "description"}), source.name


def test_lines_fit():
    for source in own_files("*.[ch]"):
        assert max(map(len, source.read_text().splitlines())) <= 120, source.name


def test_names_that_leave_a_file_tell_whose_they_are(objects):
    for source, (defined, _) in objects.items():
        prefix = PREFIXES[room_of(source)]
        strange = {name for name in defined if not re.match(rf"_?({prefix}|fmi[23])", name)}
        assert not strange, source.name


# Functions of the C library that the runtime may call: they keep no state that instances could share, but for the
# memory functions, which are safe on threads.
ALLOWED = {"calloc", "malloc", "realloc", "free", "memchr", "memcmp", "memcpy", "memmove", "memset"}
ALLOWED |= {"snprintf", "vsnprintf"}
ALLOWED |= {
    "strcmp",
    "strlen",
    "strspn",
    "floor",
    "fmax",
    "fmin",
    "ldexp",
    "nextafter",
    "pow",
    "sqrt",
    "__stack_chk_fail",
}


def test_what_they_ask_of_the_c_library(symbols):
    """No output, no files, no environment, no locale, no exit, no signal: nothing that is the host's."""
    wanted = {name for _, names in symbols.values() for name in names}
    defined = {name for names, _ in symbols.values() for name in names}
    assert wanted - defined - {"model", "description", "_GLOBAL_OFFSET_TABLE_"} <= ALLOWED


def writable(target):
    """What an object file holds that a program can change: tables of pointers are read-only once they are relocated."""
    rows = [[cell.strip() for cell in line.split("|")] for line in names_in(target, "--format=sysv")]
    places = [(row[0], row[-1]) for row in rows if len(row) == 7]
    return [
        name
        for name, place in places
        if place.startswith((".data", ".bss", ".tdata", ".tbss", "*COM*")) and not place.startswith(".data.rel.ro")
    ]


def test_nothing_written_is_shared_by_instances(files):
    for source, target in files.items():
        assert writable(target) == [], source.name


@pytest.mark.parametrize("fmi", [version.value for version in Fmi])
def test_nothing_written_is_shared_by_instances_of_a_model(fmi, tmp_path):
    traced = trace_any(Mix())
    model = tmp_path / "model.c"
    model.write_text(fmu_code(traced, fmu_variables(traced, Fmi(fmi)), "token", ("cs", "me")))
    assert writable(compiled(model, tmp_path, (*COMMON_FLAGS, *GENERATED_FLAGS))) == []


def test_what_can_be_written_is_seen(tmp_path):
    source = tmp_path / "state.c"
    source.write_text(
        "static int a = 1; int b, *c = &b; const int d = 2; const int *const e = &d; int *f(void) { return &a; }"
    )
    assert sorted(writable(compiled(source, tmp_path, COMMON_FLAGS))) == ["a", "b", "c"]
