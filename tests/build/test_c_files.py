"""The C files of every FMU, by what their objects define and ask for: no circles, and names with an owner."""

import re
import shutil
import subprocess
from graphlib import CycleError, TopologicalSorter

import pytest

from fmu.build.binaries import OWN_FOLDERS, fmi_headers, own_files
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.objects import COMMON_FLAGS, STRICT_FLAGS

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


def symbols(source, folder):
    """Names that the object of a C file defines for others, and those that it asks for."""
    target = folder / f"{source.stem}.o"
    includes = [*(f"-I{place}" for place in OWN_FOLDERS), "-isystem", str(fmi_headers())]
    # Users' compilers may warn of more than ours, which has to be content.
    flags = [*COMMON_FLAGS, *STRICT_FLAGS, "-Werror"]
    subprocess.run([*find_compiler(), *flags, "-c", source, *includes, "-o", target], check=True)
    lines = subprocess.run(["nm", "-g", target], capture_output=True, text=True, check=True).stdout.splitlines()
    found = [line.split()[-2:] for line in lines]
    return {name for kind, name in found if kind != "U"}, {name for kind, name in found if kind == "U"}


@pytest.fixture(scope="module")
def objects(tmp_path_factory):
    folder = tmp_path_factory.mktemp("objects")
    return {source: symbols(source, folder) for source in own_files("*.c")}


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
