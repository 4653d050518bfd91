"""`hybrid-fmu cosim` on FMUs of other tools: times, steps, names and files as they come."""

import shutil

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.errors import CosimError, MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System

EXPERIMENT = 'startTime="5" stopTime="8" stepSize="0.1"'


def cosim(path, *options, status=0):
    assert main(["cosim", str(path), *options]) == status


@pytest.mark.parametrize("events", [True, False])
def test_the_proposed_times_and_step_are_taken(events, stranger, tmp_path, capsys):
    table = tmp_path / "run.csv"
    cosim(stranger(events=events, experiment=EXPERIMENT), "--start-value", "rate=0", "--output-file", str(table))
    out = capsys.readouterr().out
    assert "reached t = 8 s in 30 steps" in out
    assert "stranger.steps = 30" in out
    times = np.loadtxt(table, delimiter=",", skiprows=1, usecols=0)
    np.testing.assert_allclose(times, 5.0 + 0.1 * np.arange(31), rtol=1e-15)


def test_what_is_given_goes_before_what_is_proposed(stranger, capsys):
    given = ["--start-time", "6", "--stop-time", "7.5", "--step-size", "0.5"]
    cosim(stranger(events=False, experiment=EXPERIMENT), *given)
    out = capsys.readouterr().out
    assert "reached t = 7.5 s in 3 steps" in out
    # It rises by 1 a second from the start on, and begins anew after 1 s.
    assert "stranger.x = 0.5" in out


def test_without_a_proposal_the_steps_divide_the_run(stranger, capsys):
    cosim(stranger(events=False, experiment='stopTime="3.5e-3"'))
    assert "in 10 steps" in capsys.readouterr().out


def test_the_fixed_step_master_keeps_outputs_at_the_output_interval(stranger, tmp_path, capsys):
    table, path = tmp_path / "run.csv", stranger(events=False, experiment='stopTime="2" stepSize="0.1"')
    cosim(path, "--output-interval", "0.3", "--output-file", str(table))
    times, steps = np.loadtxt(table, delimiter=",", skiprows=1, usecols=(0, 4), unpack=True)
    np.testing.assert_allclose(times, [0.0, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 2.0], rtol=1e-15)
    assert steps[-1] == 20
    cosim(path, "--output-interval", "0.25", status=2)
    assert (
        "--output-interval: the output interval is 0.25 s, which is no multiple of the communication step, 0.1 s"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("option", "value", "sentence"),
    [
        ("--step-size", "1e-18", "is 1e-18 s, but floating-point numbers lie 4.44e-16 s apart at t = 2 s"),
        ("--step-size", "1e-320", "but floating-point numbers lie"),
        ("--step-size", "1e-9", "makes 2e+09 steps from 0 to 2 s, and at most 100000000 are made"),
        ("--step-size", "0", "give a positive, finite number"),
        ("--output-interval", "1e-18", "the output interval is 1e-18 s, but floating-point numbers lie"),
    ],
)
@pytest.mark.parametrize("events", [True, False])
def test_steps_that_make_no_sense_are_refused_at_once(option, value, sentence, events, stranger, capsys):
    if events and option == "--step-size":
        option = "--output-interval"
    cosim(stranger(events=events), option, value, status=2)
    error = capsys.readouterr().err
    assert error.startswith(f"hybrid-fmu: {option}")
    assert sentence in error


def test_times_that_an_fmu_proposes_are_its_own_matter(stranger, capsys):
    path = stranger(experiment='startTime="3" stopTime="2"')
    cosim(path, status=1)
    assert "the run goes from 3.0 to 2.0 s: give finite times, the stop after the start" in capsys.readouterr().err
    cosim(stranger(), "--start-time", "2.5", status=2)
    assert capsys.readouterr().err.startswith("hybrid-fmu: --start-time: the run goes from 2.5 to 2.0 s")


def test_an_fmu_of_one_step_length_gets_steps_of_that_length(stranger, capsys):
    path = stranger(variable=False, experiment='stopTime="2" stepSize="0.1"')
    cosim(path)  # its event mode is left off: events come at any distance
    assert "reached t = 2 s in 20 steps" in capsys.readouterr().out
    cosim(path, "--stop-time", "1.95", status=2)
    error = capsys.readouterr().err
    assert "stranger takes steps of one length only" in error
    assert "a run of 1.95 s is no multiple of 0.1 s: end it 1.9 or 2 s after its start" in error
    with pytest.raises(MisfitError, match=r"stranger takes steps of one length only .* use the fixed-step master"):
        run_event_exact(System([FmuSlave("stranger", path)], {}), 2.0)


def test_steps_of_one_length_do_not_differ_by_rounding(stranger):
    slave, sizes = FmuSlave("stranger", stranger(variable=False, events=False)), set()
    made = slave.load().stepper

    def watched():
        step = made()
        return lambda t, size: sizes.add(size) or step(t, size)

    slave.load().stepper = watched
    run_fixed_step(System([slave], {}), 2.0, 0.1)
    assert sizes == {0.1}


def test_an_array_is_given_whole(stranger, capsys):
    cosim(stranger(), "--start-value", "weights=1 2 4", "--start-value", "size=3")
    assert "stranger.total = 7\n" in capsys.readouterr().out
    cosim(stranger(), "--start-value", "stranger.weights=1", "--start-value", "size=3", status=2)
    assert "weights has 3 elements, weights[1] to weights[3], but is given a list of 1" in capsys.readouterr().err


def test_a_variable_whose_name_begins_as_the_fmu_is_called_is_set(stranger, capsys):
    cosim(stranger(), "--start-value", "stranger.h=2.5", "--start-value", "stranger.rate=0.5")
    assert "stranger: 1 event at 2 s" in capsys.readouterr().out
    cosim(stranger(), "--start-value", "stranger.stranger.h=2.5")
    cosim(stranger(), "--start-value", "nobody.h=2.5", status=2)
    assert "stranger has no variable 'nobody.h'" in capsys.readouterr().err


def test_the_suffix_may_be_written_large(stranger, tmp_path, capsys):
    shutil.copy(stranger(), tmp_path / "STRANGER.FMU")
    cosim(tmp_path / "STRANGER.FMU")
    assert "reached t = 2 s" in capsys.readouterr().out


def test_a_description_that_does_not_fit_the_schema_is_run_if_that_is_wished(stranger, capsys):
    path = stranger(experiment='stopTime="2" author="nobody"')
    cosim(path, status=1)
    assert "--no-validate" in capsys.readouterr().err
    cosim(path, "--no-validate")
    assert "reached t = 2 s" in capsys.readouterr().out


def test_an_interface_that_no_master_runs_is_named(stranger, capsys):
    cosim(stranger(kind="ScheduledExecution"), status=1)
    assert "it says FMI 3.0, Scheduled Execution): export it as one" in capsys.readouterr().err


def test_a_step_size_that_is_not_used_is_said(stranger, capsys):
    cosim(stranger(), "--step-size", "0.5")
    assert "--step-size is for the fixed-step master; this run is event-exact" in capsys.readouterr().err


def test_only_what_the_flags_allow_is_asked_for(stranger):
    slave = FmuSlave("stranger", stranger(states=False))
    slave.start(0.0, 1.0, events=False)
    with pytest.raises(CosimError, match="stranger cannot save its state: its canGetAndSetFMUState is false"):
        slave.save()
    slave.close()
