"""Where compiled files are kept, and when they are not."""

import sys

import pytest

from hybrid_model.native.build.cache_folder import zig_folder


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the rule of other systems")
def test_the_cache_is_where_users_keep_caches(monkeypatch, tmp_path):
    for name in ("HYBRID_FMU_CACHE", "ZIG_GLOBAL_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert zig_folder() == tmp_path / ".cache" / "hybrid-fmu" / "zig"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    assert zig_folder() == tmp_path / "caches" / "hybrid-fmu" / "zig"
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(tmp_path / "zig"))
    assert zig_folder() == tmp_path / "zig"
