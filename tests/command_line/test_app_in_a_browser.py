"""The interactive page in a real browser: sliders move, numbers follow, the agents are downloaded as FMUs."""

import importlib.util
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
import zipfile

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
MISSING = [name for name in ("marimo", "playwright") if importlib.util.find_spec(name) is None]
pytestmark = pytest.mark.skipif(
    CHROMIUM is None or bool(MISSING), reason="apt-get install chromium; pip install hybrid-fmu[dev]: drives the page"
)


@pytest.fixture(scope="module")
def address():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    call = [sys.executable, "-m", "cosim.cli.main", "app", "--no-browser", "--port", str(port)]
    server = subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        for _ in range(300):
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=1).read()
                break
            except OSError:
                time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        import os

        os.killpg(server.pid, signal.SIGINT)
        try:
            server.wait(20)
        except subprocess.TimeoutExpired:
            os.killpg(server.pid, signal.SIGKILL)


def test_sliders_move_the_run(address, tmp_path):
    from playwright.sync_api import expect, sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1100, "height": 900}, accept_downloads=True)
        page.goto(address)
        expect(page.get_by_text("35 broadcasts (4, 10, 13, 8)")).to_be_visible(timeout=120_000)
        picture = page.get_by_role("img", name="states, broadcasts")
        before = picture.inner_html()
        page.screenshot(path=tmp_path / "before.png")
        slider = page.get_by_role("slider").first
        slider.focus()
        slider.press("ArrowRight")
        slider.press("ArrowRight")
        # c = 0.6: the run that the library gives.
        expect(page.get_by_text("28 broadcasts (6, 6, 13, 3)")).to_be_visible(timeout=60_000)
        assert picture.inner_html() != before
        page.screenshot(path=tmp_path / "after.png")
        with page.expect_download(timeout=120_000) as waiting:
            page.get_by_text("The agents as FMUs").click()
        waiting.value.save_as(tmp_path / "agents.zip")
        browser.close()
    with zipfile.ZipFile(tmp_path / "agents.zip") as archive:
        assert archive.namelist() == [f"agent{i}.fmu" for i in (1, 2, 3, 4)]
