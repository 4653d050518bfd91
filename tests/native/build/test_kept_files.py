"""What is kept between processes, and that nothing that happens to the cache harms."""

import errno
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from hybrid_model.native.build import kept_files
from hybrid_model.native.build.kept_files import kept, kept_content

posix = pytest.mark.skipif(sys.platform == "win32", reason="the rights of files are those of POSIX")


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """A cache that does not exist yet."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("HYBRID_FMU_CACHE", str(folder))
    return folder


class Maker:
    """Counts what it makes."""

    def __init__(self, content=b"content"):
        self.content, self.made = content, 0

    def __call__(self, path):
        self.made += 1
        path.write_bytes(self.content)


def files(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


def python(program, **options):
    """Start a process that keeps files in the same cache."""
    start = "import os, signal, sys, time\nfrom pathlib import Path\nfrom hybrid_model.native.build import kept_files\n"
    return subprocess.Popen([sys.executable, "-c", start + program], stdout=subprocess.PIPE, text=True, **options)


def stays_with_the_process(cache):
    """Whether files are found again in this process, and nothing of them is in the cache."""
    make = Maker()
    first, second = kept("a.so", "key", make), kept("a.so", "key", make)
    alone = cache not in first.parents and (not cache.is_dir() or files(cache) == [])
    return alone and first == second and make.made == 1 and first.read_bytes() == b"content"


@pytest.fixture
def fresh_process(monkeypatch):
    """As in a process that has kept nothing by itself."""
    monkeypatch.setattr(kept_files._Own, "_folder", None)


def test_a_file_is_made_once(cache):
    make = Maker()
    paths = {kept("a.so", "key", make) for _ in range(3)}
    assert make.made == 1
    assert [*paths] == files(cache)
    assert [path.read_bytes() for path in paths] == [b"content"]
    assert all(path.name.endswith("-a.so") for path in paths)


def test_another_key_or_name_is_another_file(cache):
    make = Maker()
    assert len({kept(name, key, make) for name in ("a.so", "b.so") for key in ("one", "two")}) == 4
    assert make.made == len(files(cache)) == 4


def test_a_second_process_finds_it():
    kept("a.so", "key", Maker())
    found, _ = python("print(kept_files.kept_content('a.so', 'key'))").communicate()
    assert found.strip() == "b'content'"


def test_what_was_not_kept_is_not_found():
    assert kept_content("a.so", "key") is None


@pytest.mark.parametrize("damage", [b"", b"con", b"kontent", b"content and more"])
def test_a_damaged_file_is_made_again(damage, cache):
    path = kept("a.so", "key", Maker())
    path.write_bytes(damage)
    again = Maker()
    assert kept("a.so", "key", again).read_bytes() == b"content"
    assert again.made == 1
    assert len(files(cache)) == 1


def test_what_making_raises_is_passed_on_and_nothing_is_kept(cache):
    def fail(path):
        path.write_bytes(b"half")
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        kept("a.so", "key", fail)
    assert files(cache) == []
    assert kept("a.so", "key", Maker()).read_bytes() == b"content"


# ---- several processes ----


def test_processes_that_make_the_same_file_at_once_all_get_it(tmp_path, cache):
    """All of them have looked before any has made it."""
    program = f"""
    place = Path({str(tmp_path)!r})
    def make(path):
        (place / f'{{os.getpid()}}.ready').touch()
        while len(list(place.glob('*.ready'))) < 4:
            time.sleep(0.001)
        path.write_bytes(b'content')
    print(kept_files.kept('a.so', 'key', make).read_bytes())
    """
    running = [python(program.replace("\n    ", "\n")) for _ in range(4)]
    assert [process.communicate()[0].strip() for process in running] == ["b'content'"] * 4
    [file] = files(cache)
    assert file.read_bytes() == b"content"


@posix
@pytest.mark.parametrize("where", ["making", "storing"])
def test_a_process_that_is_killed_leaves_nothing_that_anybody_finds(where, cache):
    die = "lambda *paths: os.kill(os.getpid(), signal.SIGKILL)"
    if where == "making":
        program = f"die = {die}\nkept_files.kept('a.so', 'key', lambda path: (path.write_bytes(b'half'), die()))"
    else:
        program = f"kept_files.os.replace = {die}\nkept_files.keep('a.so', 'key', b'content')"
    process = python(program)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert kept_content("a.so", "key") is None
    again = Maker()
    assert kept("a.so", "key", again).read_bytes() == b"content"
    assert again.made == 1


def test_what_a_killed_process_left_is_deleted_when_nobody_can_be_writing_it(cache):
    folder = kept("a.so", "key", Maker()).parent
    old, new = folder / ".old", folder / ".new"
    for path in (old, new):
        path.write_bytes(b"half")
    os.utime(old, (0.0, 0.0))
    kept_files._stored(b"x", folder, "another")
    assert new.exists()
    assert not old.exists()


@posix
def test_a_forked_process_leaves_the_files_of_its_parent(fresh_process, monkeypatch):
    monkeypatch.setenv("HYBRID_FMU_CACHE", os.devnull)
    program = """
    path = kept_files.kept('a.so', 'key', lambda path: path.write_bytes(b'content'))
    child = os.fork()
    if child == 0:
        sys.exit(kept_files.kept('b.so', 'key', lambda path: path.write_bytes(b'other')).parent == path.parent)
    assert os.waitpid(child, 0)[1] == 0
    print(path.read_bytes(), path.parent)
    """
    found, _ = python(program.replace("\n    ", "\n")).communicate()
    content, folder = found.split()
    assert content == "b'content'"
    assert not Path(folder).exists()


# ---- without a cache ----


def test_without_a_cache_files_live_as_long_as_the_process(fresh_process, monkeypatch):
    """The cache's place is a file."""
    monkeypatch.setenv("HYBRID_FMU_CACHE", os.devnull)
    assert stays_with_the_process(Path(os.devnull))
    found, _ = python("print(kept_files.kept('a.so', 'key', lambda path: path.write_bytes(b'x')))").communicate()
    assert found.strip().endswith("-a.so")
    assert not Path(found.strip()).parent.exists()


def test_without_a_home_files_live_as_long_as_the_process(fresh_process, monkeypatch, cache):
    monkeypatch.delenv("HYBRID_FMU_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr("pathlib.Path.home", homeless)
    assert stays_with_the_process(cache)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES])
@pytest.mark.parametrize("at", ["pathlib.Path.write_bytes", "os.replace"])
def test_a_cache_that_takes_no_more_files_is_done_without(at, number, fresh_process, monkeypatch, cache):
    """A full disk, one that became read-only, a file that another program holds."""
    module, _, name = at.rpartition(".")
    real = {"pathlib.Path": Path, "os": os}[module].__dict__[name]

    def refuse(path, *rest):
        if cache in Path(path).parents:
            raise OSError(number, os.strerror(number), str(path))
        return real(path, *rest)

    monkeypatch.setattr(at, refuse)
    assert stays_with_the_process(cache)


@pytest.fixture
def mortal(monkeypatch):
    """A folder of a user to whom rights apply, and this process that user's: those of root do not hold root back."""
    folder = Path(tempfile.mkdtemp(dir="/tmp"))
    monkeypatch.setattr("tempfile.tempdir", "/tmp")
    monkeypatch.setenv("HYBRID_FMU_CACHE", str(folder / "cache"))
    before = os.geteuid()
    if before == 0:
        os.chown(folder, 65534, 65534)
        os.seteuid(65534)
    yield folder
    os.seteuid(before)
    subprocess.run(["chmod", "-R", "u+rwx", str(folder)], check=True)
    subprocess.run(["rm", "-rf", str(folder)], check=True)


@posix
def test_a_read_only_cache_is_read(fresh_process, mortal):
    path = kept("a.so", "key", Maker())
    assert mortal in path.parents
    for folder in (path.parent, path.parent.parent, path.parent.parent.parent, mortal):
        folder.chmod(0o500)
    make = Maker()
    assert kept("a.so", "key", make) == path
    assert make.made == 0
    own = [kept(f"{k}.so", "key", make) for k in range(32)]
    assert not any(mortal in file.parents for file in own)
    assert make.made == 32


@posix
@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
@pytest.mark.parametrize("which", ["folder", "share", "file"])
def test_what_others_can_write_is_not_loaded(which, mode, fresh_process, cache):
    path = kept("a.so", "key", Maker())
    {"folder": path.parent.parent, "share": path.parent, "file": path}[which].chmod(mode)
    path.write_bytes(b"content")
    again = Maker()
    assert kept("a.so", "key", again).read_bytes() == b"content"
    assert again.made == 1


@posix
def test_a_cache_that_others_can_replace_is_not_used(fresh_process, tmp_path, cache):
    tmp_path.chmod(0o777)
    assert stays_with_the_process(cache)


@posix
def test_a_cache_among_those_of_others_is_used_where_each_keeps_their_own(fresh_process, tmp_path, cache):
    tmp_path.chmod(0o1777)
    assert cache in kept("a.so", "key", Maker()).parents


@posix
@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root can give files to others")
def test_a_cache_of_somebody_else_is_not_used(fresh_process, cache):
    kept("a.so", "key", Maker())
    os.chown(cache / "built", 65534, 65534)
    again = Maker()
    assert cache not in kept("a.so", "key", again).parents
    assert again.made == 1


@posix
def test_nobody_else_sees_the_cache(cache):
    path = kept("a.so", "key", Maker())
    assert [place.stat().st_mode & 0o777 for place in (path.parent.parent, path.parent, path)] == [0o700] * 3


# ---- size ----


def test_what_was_not_used_for_longest_goes(monkeypatch, cache):
    """Each of sixteen folders has a sixteenth of the room."""
    monkeypatch.setattr(kept_files, "LIMIT", 16 * 100)
    folder = cache / "share"
    folder.mkdir(parents=True)
    for k in range(9):
        kept_files._stored(bytes(20), folder, f"file-{k}")
        os.utime(folder / f"file-{k}", (1000.0 + k, 1000.0 + k))
    # Since four older ones leave the newest its room, whatever the clock.
    assert sorted(path.name for path in folder.iterdir()) == [f"file-{k}" for k in range(4, 9)]


def test_use_keeps_a_file(monkeypatch, cache):
    path = kept("a.so", "key", Maker())
    os.utime(path, (0.0, 0.0))
    kept("a.so", "key", Maker())
    assert path.stat().st_mtime > 0.0


def test_a_file_larger_than_the_cache_is_kept_alone(monkeypatch, cache):
    monkeypatch.setattr(kept_files, "LIMIT", 16 * 100)
    small = kept("a.so", "key", Maker())
    kept_files._stored(bytes(1000), small.parent, "large")
    assert [path.name for path in small.parent.iterdir()] == ["large"]
