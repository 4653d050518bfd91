"""What is kept between processes, and that nothing that happens to the cache harms."""

import subprocess
import sys

import pytest

from hybrid_model.native.build.kept_files import kept

posix = pytest.mark.skipif(sys.platform == "win32", reason="the rights of files are those of POSIX")


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """An empty cache."""
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


def test_a_second_process_finds_it(cache):
    path = kept("a.so", "key", Maker())
    program = "from hybrid_model.native.build.kept_files import find; print(find('a.so', 'key'))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(path)


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
