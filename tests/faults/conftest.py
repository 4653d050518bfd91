import os

import pytest
from c_harness import Builder, Harness, generated


@pytest.fixture(scope="session")
def builder(tmp_path_factory):
    """Compiles harnesses; what several test processes need is made by the first that needs it."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    folder = folder / "harnesses"
    folder.mkdir(exist_ok=True)
    return Builder(folder)


@pytest.fixture
def started(builder):
    """Start a harness; at the end of the test each of them must end without a word."""
    running = []

    def start(automaton, fmi, flavour="plain", **options):
        program = builder.build(automaton, fmi, flavour)
        running.append(Harness(program, generated(automaton, fmi)[1], **options))
        return running[-1]

    yield start
    for harness in running:
        if harness.process.stdin is not None and harness.process.poll() is None:
            harness.close()
