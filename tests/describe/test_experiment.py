"""The step that a description proposes where its author gives none."""

import math
import xml.etree.ElementTree as ET

import pytest
from description_cases import described

import hybrid_model as hm
from fmu.describe.experiment import declared_times, proposed_step
from fmu.describe.model_description import model_description
from fmu.describe.variables import Fmi
from hybrid_model.models import BouncingBall


class Timed(hm.HybridAutomaton):
    """Declares times in several units."""

    x = hm.State(0.0)
    delay = hm.Parameter(0.0, unit="s")
    period = hm.Parameter(4.0, unit="min")
    lag = hm.Parameter(250.0, unit="ms")
    rate = hm.Parameter(-0.5, unit="1/s")
    spin = hm.Parameter(math.pi, unit="rad/s")
    tone = hm.Parameter(2.0, unit="kHz")
    speed = hm.Parameter(1e9, unit="m/s")
    number = hm.Parameter(1e9)

    def flow_map(self, s):
        return {"x": s.rate * s.x}


# By the definitions of the units: a rate is one over a time, an angular rate 2 pi over a period.
@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("delay", []),
        ("period", [240.0]),
        ("lag", [0.25]),
        ("rate", [2.0]),
        ("spin", [2.0]),
        ("tone", [0.0005]),
        ("speed", []),
        ("number", []),
    ],
)
def test_times_that_parameters_declare(name, times):
    variable = next(v for v in Timed().variables if v.name == name)
    assert declared_times(variable) == pytest.approx(times, rel=1e-15)


@pytest.mark.parametrize(
    ("automaton", "stop_time", "step"),
    [
        (Timed(), None, 5e-5),  # a tenth of 0.5 ms
        (Timed(tone=1e-3), None, 0.05),  # a tenth of 0.25 s, and the next round number
        (Timed(), 20.0, 0.05),
        (BouncingBall(), None, None),
        (BouncingBall(), 3.0, 0.01),
    ],
)
def test_proposed_step(automaton, stop_time, step):
    assert proposed_step(automaton, stop_time) == step


@pytest.mark.parametrize("fmi", list(Fmi))
@pytest.mark.parametrize(
    ("options", "written"),
    [({}, "5e-05"), ({"stop_time": 20.0}, "0.05"), ({"stop_time": 20.0, "step_size": 0.25}, "0.25")],
)
def test_the_description_says_it(fmi, options, written):
    root = ET.fromstring(model_description(described(Timed(), fmi, **options)))
    assert root.find("DefaultExperiment").get("stepSize") == written
