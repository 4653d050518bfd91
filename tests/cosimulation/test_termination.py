"""The end of a run: an FMU is terminated before it is freed, and one that then fails costs no result."""

import pytest
from small_fmus import members, write

from cosim.cli.main import main
from cosim.exchange_slave import ExchangeSlave
from cosim.fmu_slave import FmuSlave
from cosim.isolation.isolated_slave import IsolatedSlave
from cosim.masters import run_fixed_step
from cosim.system import System


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The small FMU of a version; it says in its Terminate when that comes, and that it fails."""
    folder = tmp_path_factory.mktemp("small")
    return {fmi: write(folder / f"small{fmi}.fmu", members(fmi, "LAST_WORDS")) for fmi in (2, 3)}


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", [FmuSlave, ExchangeSlave, IsolatedSlave])
def test_an_fmu_is_terminated_at_the_end_of_its_run(kind, fmi, small, capfd):
    slave = kind("last", small[fmi])
    result = run_fixed_step(System([slave], {}), 0.5, 0.1)
    assert result.t == 0.5
    said = capfd.readouterr().err
    assert said.count("terminated") == 1
    # Of Model Exchange its time is the importer's, which this FMU does not keep in Terminate's words.
    assert kind is ExchangeSlave or "terminated at 0.5\n" in said
    assert "last: fmi" in slave.failed_at_end
    assert "Terminate failed" in slave.failed_at_end


def test_one_that_has_failed_is_freed_only(tmp_path, capfd):
    """After an error an FMU may be freed or reset, and nothing else (FMI 3.0.2, status fmi3Error)."""
    path = write(tmp_path / "small.fmu", members(3, "LAST_WORDS", "UNREADABLE"))
    assert main(["cosim", str(path), "--stop-time", "0.5", "--output-interval", "0.1"]) == 1
    said = capfd.readouterr().err
    assert "Float64 failed" in said
    assert "terminated" not in said


def test_a_failure_at_the_end_is_told_and_costs_no_result(small, tmp_path, capfd):
    table = tmp_path / "run.csv"
    assert (
        main(["cosim", str(small[3]), "--stop-time", "0.5", "--output-interval", "0.1", "--output-file", str(table)])
        == 0
    )
    assert len(table.read_text(encoding="utf-8").splitlines()) == 1 + 6
    assert "Terminate failed: the FMU logged no message. The run was over, and its results are whole." in (
        capfd.readouterr().err
    )
