"""What is in an FMU's binary: FMI functions and nothing else, no Python, the same bytes every time."""

import ctypes.util
import os
import re
import shutil
import subprocess
import sys
import zipfile

import pytest
from catalogue import cases

from fmu.build.binaries import fmi_headers, own_files
from fmu.describe.variables import Fmi
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall
from hybrid_model.native.build.compiler import find_compiler

linux = pytest.mark.skipif(sys.platform != "linux", reason="reads ELF files by the tools of binutils")
needs_tools = pytest.mark.skipif(not (shutil.which("nm") and shutil.which("readelf")), reason="needs nm and readelf")
versions = pytest.mark.parametrize("fmi", [version.value for version in Fmi])


@pytest.fixture(scope="module")
def binary(tmp_path_factory):
    """The binary of one model by version, with its archive extracted."""

    def extracted(fmi):
        folder = tmp_path_factory.getbasetemp() / f"binary-{fmi}"
        if not folder.exists():
            path = export_fmu(cases()["agent2_dynamic"].automaton, folder / "agent.fmu", fmi=fmi)
            with zipfile.ZipFile(path) as archive:
                archive.extractall(folder)
        [found] = (folder / "binaries").glob("*/*.*")
        return found

    return extracted


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def functions(fmi):
    """The functions that the standard's header declares for export."""
    major = fmi[0]
    header = (fmi_headers() / f"fmi{major}Functions.h").read_text()
    found = set(re.findall(rf"^\s*FMI{major}_Export\s+fmi{major}\w+TYPE\s+(fmi{major}\w+);", header, re.MULTILINE))
    assert len(found) > 40
    return found


@linux
@needs_tools
@versions
def test_all_functions_of_the_standard_and_nothing_else_are_exported(fmi, binary):
    names = re.findall(r" [A-Z] (\S+)$", run("nm", "-D", "--defined-only", binary(fmi)), flags=re.MULTILINE)
    assert sorted(names) == sorted(functions(fmi))


@linux
@needs_tools
@versions
def test_needs_the_c_library_only(fmi, binary):
    dynamic = run("readelf", "-dW", binary(fmi))
    assert {name.split(".")[0] for name in re.findall(r"Shared library: \[(.*)\]", dynamic)} <= {"libc", "libm"}
    # Of another library or of nothing: what is left without a version of the C library.
    undefined = [line.split()[-1] for line in run("nm", "-D", "--undefined-only", binary(fmi)).splitlines()]
    weak = {"__cxa_finalize", "__gmon_start__", "_ITM_deregisterTMCloneTable", "_ITM_registerTMCloneTable"}
    assert {name for name in undefined if "@GLIBC" not in name} <= weak


@linux
@needs_tools
@versions
def test_is_as_hardened_systems_want_it(fmi, binary):
    """No search path, no patching of code, no executable stack, relocated data read-only before it is used."""
    assert not re.search("RPATH|RUNPATH|TEXTREL", run("readelf", "-dW", binary(fmi)))
    segments = run("readelf", "-lW", binary(fmi))
    assert re.search(r"GNU_STACK .* RW +0x", segments)
    assert "GNU_RELRO" in segments
    assert not re.search(r"LOAD .* RWE ", segments)
    assert re.search(r"BIND_NOW|\bNOW\b", run("readelf", "-dW", binary(fmi)))


@linux
@versions
def test_functions_of_the_host_do_not_replace_its_own(fmi, binary, tmp_path):
    """A host that exports functions named as those of the runtime, and as the C library's, changes no result.

    Names are looked up in the process first, unless they are hidden.
    """
    names = sorted({"gamma", "j1", "y0", *_internal_names()})
    (tmp_path / "host.c").write_text("".join(f"int {name}(void) {{ __builtin_trap(); }}\n" for name in names))
    host = tmp_path / "host.so"
    subprocess.run([*find_compiler(), "-shared", "-fPIC", "-w", str(tmp_path / "host.c"), "-o", str(host)], check=True)
    code = (
        "import ctypes, sys; ctypes.CDLL(sys.argv[1], ctypes.RTLD_GLOBAL); "
        "from fmpy import simulate_fmu; r = simulate_fmu(sys.argv[2], stop_time=1.0, output_interval=0.1); print(r[-1])"
    )
    fmu_path = binary(fmi).parents[2] / "agent.fmu"
    results = [run(sys.executable, "-c", code, host_or_none, str(fmu_path)) for host_or_none in (str(host), _libm())]
    assert results[0] == results[1] != ""


def _internal_names():
    """Functions that one file of the runtime calls in another."""
    text = "".join(source.read_text() for source in own_files("*.c"))
    return set(re.findall(r"^(?:\w+ )+\*?(\w+)\([^;]*\)\n\{", text, re.MULTILINE)) - set(re.findall(r"fmi\w+", text))


def _libm():
    return ctypes.util.find_library("m")


def test_two_exports_give_the_same_bytes_whoever_makes_them(tmp_path, forget_models):
    """In other folders, under another locale, another mask for permissions and other settings of the linker."""
    code = (
        "import sys; from fmu.export import export_fmu; from hybrid_model.models import BouncingBall; "
        "[export_fmu(BouncingBall(), f'out/{fmi}.fmu', fmi=fmi) for fmi in sys.argv[1:]]"
    )
    contents = []
    for name, locale, mask in (("one", "C", 0o022), ("a second, longer name", "C.UTF-8", 0o077)):
        folder = tmp_path / name
        (folder / "tmp").mkdir(parents=True)
        settings = {
            "LC_ALL": locale,
            "TMPDIR": str(folder / "tmp"),
            "LD_RUN_PATH": f"/{name}",
            "PYTHONHASHSEED": str(mask),
        }
        command = [sys.executable, "-c", code, *(fmi.value for fmi in Fmi)]
        forget_models()
        subprocess.run(command, cwd=folder, env={**os.environ, **settings}, umask=mask, check=True)
        contents.append([(folder / "out" / f"{fmi.value}.fmu").read_bytes() for fmi in Fmi])
        assert list((folder / "tmp").iterdir()) == []
    assert contents[0] == contents[1]


def test_the_token_changes_with_the_model(tmp_path):
    def token(ball):
        with zipfile.ZipFile(export_fmu(ball, tmp_path / "ball.fmu")) as archive:
            return re.search(rb'instantiationToken="(\w+)"', archive.read("modelDescription.xml"))[1]

    assert token(BouncingBall()) == token(BouncingBall()) != token(BouncingBall(e=0.8))
