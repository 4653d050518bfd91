"""The line on a terminal that says how far a command is."""

import io

import pytest

from cosim.cli.progress import Work, told_duration


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def told(monkeypatch):
    """Work on a terminal whose clock is set by hand; what was shown, line by line."""
    clock = [0.0]
    monkeypatch.setattr("cosim.cli.progress.time.monotonic", lambda: clock[0])
    stream = Terminal()

    def at(t):
        clock[0] = t

    return stream, at, lambda: [text.rstrip() for text in stream.getvalue().split("\r") if text.strip()]


def test_the_time_that_is_left_of_what_is_counted(told):
    stream, at, lines = told
    work = Work(1.0, stream)
    work.begin("runs")
    for t, done in ((0.1, 100), (0.15, 120), (10.1, 300), (20.1, 400)):
        at(t)
        work(done, 400)
    # The second change comes too soon; the hundred that were there before are no pace.
    assert lines() == ["  runs ...", "  runs, 300/400, about 5 s left ...", "  runs, 400/400, 20 s ..."]


def test_the_time_that_is_left_of_stages(told):
    stream, at, lines = told
    with Work(4.0, stream) as work:
        work.begin("first", 1.0)
        at(3.0)
        work.begin("second", 3.0)
        at(6.0)
        work.part(1.0 / 3.0)
    # A quarter took 3 s; then a half of all is done after 6 s.
    assert lines() == ["  first ...", "  second, about 9 s left ...", "  second, about 6 s left ..."]
    assert stream.getvalue().endswith("\r")


def test_nothing_is_told_elsewhere():
    stream = io.StringIO()
    with Work(1.0, stream) as work:
        work.begin("first")
        work(1, 2)
    assert stream.getvalue() == ""


def test_durations_in_words():
    assert [told_duration(seconds) for seconds in (0.2, 80, 600, 7200)] == ["1 s", "80 s", "10 min", "2.0 h"]
