"""Every model of the repository, with the run that the three executions must agree on."""

from dataclasses import dataclass, field

import hybrid_model as hm
import hybrid_model.models
from hybrid_model.consensus import agents, edges
from hybrid_model.consensus.network import closed_loop, scenario_agents
from hybrid_model.consensus.scenario import load_scenario, replace_trigger


@dataclass(frozen=True)
class Case:
    """A model, its run, and inputs as steps: input -> ((t, value), ...)."""

    automaton: hm.Automaton
    t_end: float
    steps: dict = field(default_factory=dict)


def cases():
    """All cases by name; `test_catalogue_is_complete` sees to it that no model is missing."""
    paper = load_scenario("paper-a")
    found = {
        "bouncing_ball": Case(hm.models.BouncingBall(h=1.0), 2.4),
        "thermostat": Case(hm.models.Thermostat(), 150.0),
        "integrator": Case(
            agents.Integrator(degree=2, x=1.0, weights=[1.0, 0.5]),
            4.0,
            {"broadcast": ((1.0, 2.0), (2.5, -1.0)), "neighbours[2]": ((2.0, 0.5),)},
        ),
        "static_trigger": Case(agents.StaticTrigger(x=1.0), 4.0, {"x": ((1.0, 1.2), (2.0, 1.7), (3.0, -4.0))}),
        "dynamic_trigger": Case(
            agents.DynamicTrigger(x=1.0, decay=0.5), 6.0, {"x": ((1.0, 1.2), (2.0, 1.4), (3.0, 1.3))}
        ),
        "constant_weights": Case(edges.ConstantWeights(value=[1.0, 2.0]), 1.0),
        "gated_sine": Case(edges.GatedSineWeights(duty_percent=[20.0, 35.0]), 5.0),
        "gated_absolute_sine": Case(edges.GatedAbsoluteSineWeights(duty_percent=[60.0, 100.0], phase=0.3), 5.0),
        "switching": Case(
            edges.PeriodicSwitching(dwell=0.7, active=[[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], raw=[2.0, 3.0]), 5.0
        ),
    }
    found |= process_cases()
    for kind in ("static", "dynamic"):
        scenario = replace_trigger(paper, kind)
        found[f"paper_{kind}"] = Case(closed_loop(scenario), 20.0)
        found[f"agent2_{kind}"] = Case(
            scenario_agents(scenario)["agent2"],
            20.0,
            {"neighbours[1]": ((2.0, 1.3), (7.5, 0.9)), "neighbours[2]": ((3.0, 0.6), (11.0, 1.0))},
        )
    return found


def process_cases():
    """Processes, power electronics, and the examples of the HyEQ Toolbox; no event lies on one of the 41 output points."""
    models = hm.models
    return {
        "two_tank": Case(models.TwoTank(), 3.99),
        "relay_hysteresis": Case(models.RelayHysteresis(x=0.3, v=-0.2), 15.0),
        "boost_converter": Case(models.BoostConverter(), 1.03e-3),
        "boost_converter_discontinuous": Case(models.BoostConverter(load=500.0, voltage=70.0), 1.03e-3),
        "vehicle_on_path": Case(models.VehicleOnPath(), 15.0, {"speed": ((2.0, 1.5), (7.3, 0.8))}),
        "two_gene_network": Case(models.TwoGeneNetwork(), 10.0),
        "analog_digital_loop": Case(models.AnalogDigitalLoop(low=0.37, high=0.61, period=0.13, latency=0.05), 4.0),
        "finite_state_machine": Case(
            models.FiniteStateMachine(table=[[1, 0, 2], [1, 2, 2], [0, 0, 2]], symbol=1.0),
            6.0,
            {"symbol": ((1.0, 0.0), (2.0, 1.0), (3.0, 0.0), (4.0, 2.0), (5.0, 1.0))},
        ),
        "network_estimation": Case(models.NetworkEstimation(), 10.0),
        "switched_feedback": Case(models.SwitchedFeedback(), 20.0),
        "juggled_ball": Case(models.JuggledBall(), 12.0),
    }
