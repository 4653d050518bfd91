"""Compiling and packaging: what is exported, what is reproducible, and what an error leaves behind."""

import ctypes
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from fmu.build import BuildError, compile_fmu, find_compiler, fmi_headers, package, runtime_sources

# A model without states, jumps or outputs: enough to link the runtime, nothing that a trace would produce otherwise.
EMPTY_MODEL = """
#include "model.h"
static int nothing(const double **arg, double **res, long long *iw, double *w, int mem)
{
    (void)arg, (void)res, (void)iw, (void)w, (void)mem;
    return 0;
}
static const ModelVariable variables[] = {{"time", TYPE_FLOAT64, BANK_TIME, 0, false, false}};
const Model model = {
    .name = "Empty", .token = "token", .n_variables = 1, .n_arg = 5, .n_res = 2, .predictable = true,
    .start = nothing, .flow = nothing, .margins = nothing, .times = nothing, .outputs = nothing,
    .variables = variables,
};
"""

needs_nm = pytest.mark.skipif(shutil.which("nm") is None, reason="nm is not installed")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The runtime linked with an empty model."""
    return build_empty(tmp_path_factory.mktemp("build"))


def build_empty(folder: Path) -> Path:
    source = folder / "model.c"
    source.write_text(EMPTY_MODEL)
    return compile_fmu([source, *runtime_sources()], [fmi_headers()], folder / "Empty.so")


def leftovers(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def symbols(library: Path) -> set[str]:
    listing = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True)
    return {line.split()[-1] for line in listing.stdout.splitlines()}


@needs_nm
def test_exports_all_fmi_functions_and_nothing_else(library: Path) -> None:
    header = (fmi_headers() / "fmi3Functions.h").read_text()
    declared = set(re.findall(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", header, re.MULTILINE))
    assert len(declared) > 70
    assert symbols(library) == declared


@needs_nm
def test_needs_only_the_c_library(library: Path) -> None:
    listing = subprocess.run(["nm", "-D", "--undefined-only", library], capture_output=True, text=True, check=True)
    needed = {line.split()[-1] for line in listing.stdout.splitlines() if "@GLIBC" in line}
    foreign = {line.split()[-1] for line in listing.stdout.splitlines()} - needed
    assert foreign <= {"__cxa_finalize", "__gmon_start__", "_ITM_deregisterTMCloneTable", "_ITM_registerTMCloneTable"}


@needs_nm
def test_runtime_has_no_writable_globals(tmp_path: Path) -> None:
    """Two instances share nothing: no object file of the runtime has data that can be written."""
    for source in runtime_sources():
        target = tmp_path / f"{source.stem}.o"
        # Without position independence, tables of pointers are constants for nm as well.
        flags = ["-std=c99", "-O2", "-fno-pic", "-fno-pie", "-c", f"-I{fmi_headers()}", str(source), "-o", str(target)]
        subprocess.run([*find_compiler(), *flags], check=True)
        listing = subprocess.run(["nm", target], capture_output=True, text=True, check=True)
        writable = [line for line in listing.stdout.splitlines() if re.search(r" [bBdDcCsSgG] ", line)]
        assert writable == [], source.name


def test_library_loads_and_tells_its_version(library: Path) -> None:
    loaded = ctypes.CDLL(str(library))
    loaded.fmi3GetVersion.restype = ctypes.c_char_p
    assert loaded.fmi3GetVersion() == b"3.0"


def test_same_sources_in_two_folders_give_the_same_bytes(tmp_path: Path) -> None:
    folders = [tmp_path / "one", tmp_path / "another-with-a-longer-name"]
    for folder in folders:
        folder.mkdir()
    first, second = (build_empty(folder).read_bytes() for folder in folders)
    assert first == second
    assert str(tmp_path).encode() not in first


def test_compiler_error_is_shown_and_leaves_nothing(tmp_path: Path) -> None:
    source = tmp_path / "model.c"
    source.write_text("int broken(void) { return missing; }\n")
    with pytest.raises(BuildError, match=r"(?s)compile 'model.c'.*missing"):
        compile_fmu([source], [], tmp_path / "out" / "Model.so")
    assert leftovers(tmp_path) == {"model.c"}


def test_failed_link_keeps_the_old_library(tmp_path: Path) -> None:
    source = tmp_path / "model.c"
    source.write_text("int twice;\n")
    (tmp_path / "other.c").write_text("int twice = 1; int again(void); int once(void) { return again(); }\n")
    source.write_text("int twice = 2;\n")
    target = tmp_path / "Model.so"
    target.write_bytes(b"old")
    with pytest.raises(BuildError, match=r"(?s)link the library.*twice"):
        compile_fmu([source, tmp_path / "other.c"], [], target)
    assert target.read_bytes() == b"old"
    assert leftovers(tmp_path) == {"model.c", "other.c", "Model.so"}


def test_missing_and_ambiguous_sources_are_named(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=r"'absent.c' does not exist"):
        compile_fmu([tmp_path / "absent.c"], [], tmp_path / "Model.so")
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "model.c").write_text("int x;\n")
    with pytest.raises(BuildError, match=r"differ in name"):
        compile_fmu([tmp_path / "a" / "model.c", tmp_path / "b" / "model.c"], [], tmp_path / "Model.so")


def test_names_with_spaces_and_shell_characters_are_only_names(tmp_path: Path) -> None:
    folder = tmp_path / "a $(touch owned) b"
    folder.mkdir()
    build_empty(folder)
    assert leftovers(folder) == {"model.c", "Empty.so"}


def test_compiler_is_taken_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"{find_compiler()[0]} -pipe")
    assert find_compiler()[1:] == ["-pipe"]
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(BuildError, match=r"CC is 'no-such-compiler'.*Remedy"):
        find_compiler()


def test_no_compiler_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(BuildError, match=r"Remedy: install a C compiler"):
        find_compiler()


def test_ziglang_is_the_last_resort(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: object() if name == "ziglang" else None)
    assert find_compiler()[1:] == ["-m", "ziglang", "cc"]


def test_archive_is_the_same_from_folder_and_mapping_in_any_order(tmp_path: Path) -> None:
    content = {
        "modelDescription.xml": b"<x/>",
        "binaries/x86_64-linux/M.so": b"\x7fELF",
        "documentation/index.html": b"<p>",
    }
    folder = tmp_path / "content"
    for name, data in content.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    backwards = dict(reversed(content.items()))
    one = package(folder, tmp_path / "one.fmu").read_bytes()
    two = package(backwards, tmp_path / "two.fmu").read_bytes()
    assert one == two
    with zipfile.ZipFile(tmp_path / "one.fmu") as archive:
        assert archive.namelist() == sorted(content)
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert archive.read("modelDescription.xml") == b"<x/>"


@pytest.mark.parametrize("name", ["../outside", "/absolute", "a//b", "a\\b", "c:x", "", "a/./b"])
def test_members_stay_inside_the_archive(tmp_path: Path, name: str) -> None:
    with pytest.raises(BuildError, match="plain relative path"):
        package({"modelDescription.xml": b"<x/>", name: b""}, tmp_path / "M.fmu")
    assert leftovers(tmp_path) == set()


def test_description_is_required_and_the_old_archive_stays(tmp_path: Path) -> None:
    target = tmp_path / "M.fmu"
    target.write_bytes(b"old")
    with pytest.raises(BuildError, match=r"no modelDescription\.xml"):
        package({"readme.txt": b""}, target)
    with pytest.raises(BuildError, match="cannot be read"):
        package({"modelDescription.xml": tmp_path / "absent.xml"}, target)
    assert target.read_bytes() == b"old"
    assert leftovers(tmp_path) == {"M.fmu"}


def test_interrupted_packaging_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "writestr", full)
    with pytest.raises(OSError, match="No space"):
        package({"modelDescription.xml": b"<x/>"}, tmp_path / "M.fmu")
    assert leftovers(tmp_path) == set()
