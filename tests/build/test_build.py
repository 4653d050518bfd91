"""Compiling and packaging: what is kept between builds, what is reproducible, and what an error leaves behind."""

import ctypes
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

import fmu.build.binaries
from fmu.archives.writing import check_target, package
from fmu.build.binaries import binaries, compile_fmu, fmi_headers, runtime_sources
from fmu.errors import BuildError
from hybrid_model.native.build import objects
from hybrid_model.native.build.compiler import find_compiler

# The smallest library with an FMI function, and what a model's generated code may hold.
VERSION = """
#include "fmi3Functions.h"
static double gamma(double x) { return 42.0 * x; }
double hidden(double x) { return gamma(x); }
const char *fmi3GetVersion(void) { return hidden(1.0) > 0.0 ? "3.0" : ""; }
"""

posix = pytest.mark.skipif(sys.platform == "win32", reason="a wrapper around the compiler is a shell script")


def build_version(folder: Path, **options: object) -> Path:
    source = folder / "model.c"
    source.write_text(VERSION)
    return compile_fmu([source], [fmi_headers()], folder / "Version.so", **options)


def leftovers(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, which must be empty in the end."""
    folder = tmp_path / "temporary files"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


@pytest.fixture
def logged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A compiler that writes down its arguments, a call a line."""
    script, log = tmp_path / "bin" / "logged-cc", tmp_path / "calls.txt"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\necho "$@" >> "{log}"\nexec {find_compiler()[0]} "$@"\n')
    script.chmod(0o755)
    log.write_text("")
    monkeypatch.setenv("CC", str(script))
    return log


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache in which nothing is yet."""
    monkeypatch.setenv("HYBRID_FMU_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def compiled(log: Path) -> list[str]:
    """The names of the files compiled so far."""
    calls = [line.split() for line in log.read_text().splitlines()]
    return [Path(call[call.index("-c") + 1]).name for call in calls if "-c" in call]


# ---- one compiler, many files ----


@posix
def test_the_runtime_is_compiled_once(logged, empty_cache, tmp_path):
    sources = runtime_sources()[:6]
    for k in range(3):
        source = tmp_path / str(k) / "model.c"
        source.parent.mkdir()
        # Without a model the runtime does not link: that comes after the compiling.
        source.write_text(f"int model_{k};\n")
        with pytest.raises(BuildError, match="link"):
            compile_fmu([source, *sources], [fmi_headers()], tmp_path / "Model.so")
    assert sorted(compiled(logged)) == sorted([source.name for source in sources] + 3 * ["model.c"])


@posix
@pytest.mark.parametrize("change", ["source", "header", "flags", "compiler", "nothing"])
def test_kept_objects_are_those_of_the_same_build(change, logged, empty_cache, tmp_path, monkeypatch):
    """Whatever changes an object makes a new one."""
    runtime = tmp_path / "runtime"
    runtime.mkdir()
    (runtime / "value.h").write_text("#define VALUE 1\n")
    (runtime / "version.c").write_text(
        '#include "fmi3Functions.h"\n#include "value.h"\nconst char *fmi3GetVersion(void) { return "v" + VALUE; }\n'
    )
    monkeypatch.setattr(fmu.build.binaries, "OWN_FOLDERS", (runtime,))
    monkeypatch.setattr(objects, "STRICT_FLAGS", ())
    compile_fmu([runtime / "version.c"], [fmi_headers()], tmp_path / "One.so")
    if change == "source":
        (runtime / "version.c").write_text(
            '#include "fmi3Functions.h"\nconst char *fmi3GetVersion(void) { return ""; }\n'
        )
    elif change == "header":
        (runtime / "value.h").write_text("#define VALUE 0\n")
    elif change == "flags":
        monkeypatch.setattr(objects, "COMMON_FLAGS", (*objects.COMMON_FLAGS, "-fno-builtin"))
    elif change == "compiler":
        script = Path(os.environ["CC"])
        script.write_text(script.read_text() + "# another version\n")
    compile_fmu([runtime / "version.c"], [fmi_headers()], tmp_path / "Two.so")
    assert len(compiled(logged)) == (1 if change == "nothing" else 2)


@posix
@pytest.mark.parametrize("beside", ["", '#include "value.h"\n', "#define NAME <math.h>\n#include NAME\n"])
def test_a_model_that_was_built_before_needs_no_compiler(beside, logged, empty_cache, tmp_path):
    """But one whose headers nobody has looked at is built anew."""
    (tmp_path / "value.h").write_text("#define VALUE 1\n")
    (tmp_path / "model.c").write_text(f"{beside}{VERSION}")
    first, second = (
        compile_fmu([tmp_path / "model.c"], [fmi_headers()], tmp_path / f"{name}.so").read_bytes() for name in "ab"
    )
    assert first == second
    assert len(compiled(logged)) == logged.read_text().count("-shared") == (2 if beside else 1)


def test_compiler_error_is_shown_and_leaves_nothing(tmp_path, temporary):
    source = tmp_path / "model.c"
    source.write_text("int broken(void) { return missing; }\n")
    with pytest.raises(BuildError, match=r"(?s)compile 'model.c'.*missing"):
        compile_fmu([source], [], tmp_path / "out" / "Model.so")
    assert leftovers(tmp_path) == {"model.c", temporary.name}
    assert leftovers(temporary) == set()


def test_long_reports_are_shortened_to_their_beginning(tmp_path):
    source = tmp_path / "model.c"
    source.write_text("".join(f"int f{k}(void) {{ return missing_{k}; }}\n" for k in range(1000)))
    with pytest.raises(BuildError) as caught:
        compile_fmu([source], [], tmp_path / "Model.so")
    assert "missing_0" in str(caught.value)
    assert "missing_999" not in str(caught.value)
    assert "more lines" in str(caught.value)
    assert len(str(caught.value)) < 15_000


def test_failed_link_keeps_the_old_library(tmp_path, temporary):
    (tmp_path / "model.c").write_text("int twice = 2;\n")
    (tmp_path / "other.c").write_text("int twice = 1;\n")
    target = tmp_path / "Model.so"
    target.write_bytes(b"old")
    with pytest.raises(BuildError, match=r"(?s)link the library.*twice"):
        compile_fmu([tmp_path / "model.c", tmp_path / "other.c"], [], target)
    assert target.read_bytes() == b"old"
    assert leftovers(tmp_path) == {"model.c", "other.c", "Model.so", temporary.name}
    assert leftovers(temporary) == set()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows links nothing that is missing anyway")
def test_functions_that_are_nowhere_are_found_when_linking_not_by_the_importer(tmp_path):
    (tmp_path / "model.c").write_text("int nowhere(void); int once(void) { return nowhere(); }\n")
    with pytest.raises(BuildError, match=r"(?s)link the library.*nowhere"):
        compile_fmu([tmp_path / "model.c"], [], tmp_path / "Model.so")


def test_missing_and_ambiguous_sources_are_named(tmp_path):
    with pytest.raises(BuildError, match=r"'absent.c' does not exist"):
        compile_fmu([tmp_path / "absent.c"], [], tmp_path / "Model.so")
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "model.c").write_text("int x;\n")
    with pytest.raises(BuildError, match=r"differ in name"):
        compile_fmu([tmp_path / "a" / "model.c", tmp_path / "b" / "model.c"], [], tmp_path / "Model.so")


@posix
def test_an_interrupt_stops_the_compilers_and_leaves_nothing(tmp_path):
    """The compiler here starts a program that would go on for a minute, as gcc starts cc1."""
    script = tmp_path / "slow-cc"
    script.write_text(
        f'#!/bin/sh\ncase "$*" in *--version*) exit 0;; esac\n'
        f'touch "$TMPDIR/cc1.s"\necho $$ >> "{tmp_path}/pids"\nsleep 60\n'
    )
    script.chmod(0o755)
    files = tmp_path / "temporary"
    files.mkdir()
    (tmp_path / "model.c").write_text("int x;\n")
    (tmp_path / "more.c").write_text("int y;\n")
    # Shells let programs in the background ignore interrupts, and their children inherit it: not so this one.
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from pathlib import Path; from fmu.build.binaries import compile_fmu; "
        "compile_fmu([Path('model.c'), Path('more.c')], [], Path('out/Model.so'))"
    )
    environment = {**os.environ, "CC": str(script), "TMPDIR": str(files)}
    child = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, env=environment, stderr=subprocess.PIPE)
    try:
        while not (tmp_path / "pids").exists():
            assert child.poll() is None
            time.sleep(0.01)
        assert leftovers(files) != set()
        child.send_signal(signal.SIGINT)
        # Far less than the minute that the compilers would take.
        _, errors = child.communicate(timeout=120)
    finally:
        child.kill()
    assert b"KeyboardInterrupt" in errors
    assert leftovers(files) == set()
    assert not (tmp_path / "out").exists()
    for pid in (tmp_path / "pids").read_text().split():
        with pytest.raises(ProcessLookupError):
            os.kill(int(pid), 0)


@posix
def test_the_first_error_stops_the_other_compilers(tmp_path, monkeypatch):
    script = tmp_path / "a compiler"
    script.write_text(
        f'#!/bin/sh\ncase "$*" in *--version*) exit 0;; *bad.c*) echo wrong; exit 1;; esac\n'
        f'sleep 20\ntouch "{tmp_path}/went-on"\n'
    )
    script.chmod(0o755)
    monkeypatch.setenv("CC", str(script))
    monkeypatch.setattr("hybrid_model.native.build.jobs._processors", lambda: 2)
    for name in ("slow.c", "bad.c"):
        (tmp_path / name).write_text("int x;\n")
    with pytest.raises(BuildError, match=r"(?s)compile 'bad.c'.*wrong"):
        compile_fmu([tmp_path / "slow.c", tmp_path / "bad.c"], [], tmp_path / "Model.so")
    assert not (tmp_path / "went-on").exists()


# ---- names and places ----


@pytest.mark.parametrize(
    "name", ["a $(touch owned) b", "100% #1", "größe 漢字", "; touch owned", "-o owned", "n" * 200 + "/" + "m" * 200]
)
def test_names_of_folders_are_only_names(name, tmp_path):
    folder = tmp_path / name
    folder.mkdir(parents=True)
    library = ctypes.CDLL(str(build_version(folder)))
    library.fmi3GetVersion.restype = ctypes.c_char_p
    assert library.fmi3GetVersion() == b"3.0"
    assert leftovers(folder) == {"model.c", "Version.so"}
    assert leftovers(tmp_path) == {Path(name).parts[0]}


def test_files_named_like_options_or_as_long_as_can_be(tmp_path):
    source = tmp_path / "-shared.c"
    source.write_text(VERSION)
    target = tmp_path / ("L" * 252 + ".so")
    compile_fmu([source], [fmi_headers()], target)
    assert leftovers(tmp_path) == {source.name, target.name}


def test_relative_paths_the_folder_and_the_environment(tmp_path, monkeypatch):
    """Paths count from the current folder, which stays, as the environment does, in success and failure."""
    monkeypatch.chdir(tmp_path)
    Path("model.c").write_text(VERSION)
    Path("bad.c").write_text("int broken(void) { return missing; }\n")
    before = os.getcwd(), dict(os.environ)
    compile_fmu([Path("model.c")], [fmi_headers()], Path("out/Version.so"))
    with pytest.raises(BuildError):
        compile_fmu([Path("bad.c")], [], Path("out/Bad.so"))
    assert (os.getcwd(), dict(os.environ)) == before
    assert leftovers(Path("out")) == {"Version.so"}


@posix
def test_a_compiler_given_by_a_relative_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("my-cc").symlink_to(shutil.which(find_compiler()[0]))
    monkeypatch.setenv("CC", "./my-cc")
    build_version(tmp_path)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder where nobody may write")
def test_a_folder_that_is_read_only_is_refused_before_the_build(tmp_path):
    for act in (check_target, lambda path: package({"modelDescription.xml": b"<x/>"}, path), build_beside(tmp_path)):
        with pytest.raises(BuildError, match=r"'/proc/self/out/M.fmu' cannot be written.*Remedy"):
            act(Path("/proc/self/out/M.fmu"))


def build_beside(folder: Path):
    source = folder / "model.c"
    source.write_text(VERSION)
    return lambda path: compile_fmu([source], [fmi_headers()], path)


def test_targets_are_checked_without_a_trace(tmp_path):
    check_target(tmp_path / "new" / "M.fmu")
    assert leftovers(tmp_path / "new") == set()
    with pytest.raises(BuildError, match="is a folder"):
        check_target(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(BuildError, match="cannot be written"):
        check_target(tmp_path / "file" / "M.fmu")


@posix
def test_permissions_are_those_the_user_gives_to_files(tmp_path):
    mask = os.umask(0o027)
    try:
        library = build_version(tmp_path)
        archive = package({"modelDescription.xml": b"<x/>"}, tmp_path / "M.fmu")
    finally:
        os.umask(mask)
    assert (library.stat().st_mode & 0o777, archive.stat().st_mode & 0o777) == (0o750, 0o640)


def test_same_sources_in_two_folders_give_the_same_bytes(tmp_path, forget_models):
    libraries = []
    for folder in (tmp_path / "one", tmp_path / "another-with-a-longer-name"):
        folder.mkdir()
        forget_models()
        libraries.append(build_version(folder).read_bytes())
    assert libraries[0] == libraries[1]
    assert str(tmp_path).encode() not in libraries[0]


# ---- which compiler ----


def test_other_platforms_need_ziglang(monkeypatch, tmp_path):
    real = fmu.build.binaries.importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "ziglang" else real(name))
    (tmp_path / "model.c").write_text(VERSION)
    platforms = ["x86_64-linux", "aarch64-linux"]
    with pytest.raises(BuildError, match=r"package ziglang, which is not installed. Remedy: pip install"):
        binaries([tmp_path / "model.c"], [fmi_headers()], "M", fmi="3.0", platforms=platforms)


@posix
def test_a_compiler_that_is_no_program_is_named(tmp_path, monkeypatch):
    script = tmp_path / "cc"
    script.write_bytes(b"\x00\x01")
    script.chmod(0o755)
    monkeypatch.setenv("CC", str(script))
    with pytest.raises(BuildError, match=r"could not be started: .*Remedy"):
        build_version(tmp_path)


# ---- archives ----


def test_archive_is_the_same_from_folder_and_mapping_in_any_order(tmp_path):
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
def test_members_stay_inside_the_archive(tmp_path, name):
    with pytest.raises(BuildError, match="plain relative path"):
        package({"modelDescription.xml": b"<x/>", name: b""}, tmp_path / "M.fmu")
    assert leftovers(tmp_path) == set()


def test_members_differ_on_systems_that_ignore_case(tmp_path):
    with pytest.raises(BuildError, match=r"'documentation/a.html' and 'Documentation/A.html' differ in case only"):
        package({"modelDescription.xml": b"", "documentation/a.html": b"", "Documentation/A.html": b""}, tmp_path / "M")


def test_description_is_required_and_the_old_archive_stays(tmp_path):
    target = tmp_path / "M.fmu"
    target.write_bytes(b"old")
    with pytest.raises(BuildError, match=r"no modelDescription\.xml"):
        package({"readme.txt": b""}, target)
    with pytest.raises(BuildError, match="cannot be read"):
        package({"modelDescription.xml": tmp_path / "absent.xml"}, target)
    assert target.read_bytes() == b"old"
    assert leftovers(tmp_path) == {"M.fmu"}


def test_interrupted_packaging_leaves_nothing(tmp_path, monkeypatch):
    def full(*arguments: object, **options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "writestr", full)
    with pytest.raises(BuildError, match=r"M\.fmu' cannot be written: No space"):
        package({"modelDescription.xml": b"<x/>"}, tmp_path / "M.fmu")
    assert leftovers(tmp_path) == set()
