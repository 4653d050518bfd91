"""The runtime's C: warnings, static analysis, strict C99, stack, and how thin the versions' layers are."""

import itertools
import re
import subprocess
import sys
from pathlib import Path

import pytest
from c_harness import VERSIONS, run

import cosim
from fmu.build.binaries import OWN_FOLDERS, fmi_headers, own_files, runtime_sources
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.objects import STRICT_FLAGS

linux = pytest.mark.skipif(sys.platform != "linux", reason="gcc and binutils on Linux")
SOURCES = [*own_files("*.c"), Path(cosim.__file__).with_name("rounds.c")]


def is_gcc():
    return "Free Software Foundation" in run(*find_compiler(), "--version")


def compile_all(sources, folder, *flags):
    """What the compiler says of sources, which must be nothing."""
    for source in sources:
        command = [*find_compiler(), *flags, *(f"-I{place}" for place in OWN_FOLDERS), "-isystem", str(fmi_headers())]
        done = subprocess.run(
            [*command, "-c", str(source), "-o", str(folder / f"{source.stem}.o")],
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, ""), f"{source.name}\n{done.stderr}"


@pytest.mark.faults
@linux
def test_strict_warnings_and_strict_c99(tmp_path):
    """With optimisation, since some warnings come from it; no language beyond C99."""
    strict = ["-std=c99", "-pedantic-errors", *STRICT_FLAGS, "-Werror", "-Wstrict-prototypes"]
    strict += ["-Wshadow", "-Wundef", "-Wvla", "-Wwrite-strings", "-Wmissing-prototypes", "-Wpointer-arith"]
    # The tables of one version's layer are functions that the header of the other does not declare.
    compile_all(SOURCES, tmp_path, *[flag for flag in strict if flag != "-Wmissing-prototypes"], "-O2")


@pytest.mark.faults
@linux
@pytest.mark.skipif(not is_gcc(), reason="-fanalyzer is gcc's")
def test_static_analysis(tmp_path):
    """Among what it looks for: allocations that are not checked, lost or used after their time."""
    compile_all(SOURCES, tmp_path, "-std=c99", "-O1", "-fanalyzer", "-Werror")


@pytest.mark.faults
@linux
@pytest.mark.skipif(not is_gcc(), reason="-fstack-usage is gcc's")
def test_no_function_needs_much_stack(tmp_path):
    """Each has a fixed need, and none a large one; there is no recursion that could multiply it."""
    for fmi in VERSIONS:
        folder = tmp_path / fmi
        folder.mkdir()
        compile_all(runtime_sources(fmi), folder, "-std=c99", "-O2", "-fstack-usage")
        for usage in folder.glob("*.su"):
            for line in usage.read_text().splitlines():
                where, size, kind = line.rsplit("\t", 2)
                assert kind in ("static", "dynamic,bounded"), line
                assert int(size) <= 4096, where


def lines_of(path):
    """Lines with something in them, without comments, includes and what is only punctuation."""
    text = re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)
    text = text.replace("fmi2", "fmi").replace("fmi3", "fmi")
    lines = (re.sub(r"\s+", " ", line).strip(" \\") for line in text.splitlines())
    return [line for line in lines if re.search(r"\w", line) and not line.startswith("#include")]


def test_the_layers_of_the_versions_share_little():
    """Even with the names of both versions made equal, under a fifth of either occurs in the other."""
    second = lines_of(*own_files("fmi2.c"))
    third = [*itertools.chain.from_iterable(map(lines_of, own_files("fmi3*.c")))]
    for one, other in ((second, third), (third, second)):
        known = set(other)
        shared = [line for line in one if line in known]
        assert len(shared) < len(one) / 5, f"{len(shared)} of {len(one)}: {shared}"


def test_layers_hold_no_logic_of_the_engine():
    """They translate: only what belongs to one version stands in its files, the engine's parts are out of reach."""
    for path in own_files("fmi*.c"):
        text = path.read_text()
        assert "parts.h" not in re.findall(r'#include "([^"]*)"', text), path.name
        assert "malloc" not in text
        assert len(text.splitlines()) < 350
