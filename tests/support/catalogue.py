"""Every model of the repository, with the run that the three executions must agree on."""

import functools
from dataclasses import dataclass, field
from types import MappingProxyType

import control
import numpy as np
from catalogue_triggers import trigger_cases
from catalogue_weights import weights_cases

import hybrid_model as hm
import hybrid_model.models
from hybrid_model import consensus
from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agents
from hybrid_model.consensus.scenario.definition import replace_trigger
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.linear import lti


@dataclass(frozen=True)
class Case:
    """A model, its run, and inputs as steps: input -> ((t, value), ...)."""

    automaton: hm.Automaton
    t_end: float
    steps: dict = field(default_factory=dict)


@functools.cache
def cases():
    """All cases by name; `test_catalogue_is_complete` sees to it that no model is missing."""
    paper = load_scenario("paper-a")
    found = {
        "bouncing_ball": Case(hm.models.BouncingBall(h=1.0), 2.4),
        "resting_ball": Case(hm.models.RestingBall(slowest=0.3), 3.0),
        "bouncing_ball_with_dwell": Case(hm.MinimumDwell(hm.models.BouncingBall(), 0.05), 3.0),
        "thermostat": Case(hm.models.Thermostat(), 150.0),
        # Not stiff, for the sake of the engine in Python.
        "stiff_thermostat": Case(hm.models.StiffThermostat(sensor_lag=0.5), 40.0),
        "van_der_pol": Case(hm.models.VanDerPol(damping=5.0), 30.0),
        "integrator": Case(
            consensus.Integrator(degree=2, x=1.0, weights=[1.0, 0.5]),
            4.0,
            {"broadcast": ((1.0, 2.0), (2.5, -1.0)), "neighbours[2]": ((2.0, 0.5),)},
        ),
        "static_trigger": Case(consensus.StaticTrigger(x=1.0), 4.0, {"x": ((1.0, 1.2), (2.0, 1.7), (3.0, -4.0))}),
        "dynamic_trigger": Case(
            consensus.DynamicTrigger(x=1.0, decay=0.5), 6.0, {"x": ((1.0, 1.2), (2.0, 1.4), (3.0, 1.3))}
        ),
        "constant_weights": Case(consensus.ConstantWeights(value=[1.0, 2.0]), 1.0),
        "gated_sine": Case(consensus.GatedSineWeights(duty_percent=[20.0, 35.0]), 5.0),
        "gated_absolute_sine": Case(consensus.GatedAbsoluteSineWeights(duty_percent=[60.0, 100.0], phase=0.3), 5.0),
        "switching": Case(
            consensus.PeriodicSwitching(dwell=0.7, active=[[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], raw=[2.0, 3.0]), 5.0
        ),
    }
    found |= process_cases()
    found |= mechanics_cases()
    found |= linear_cases()
    found |= trigger_cases(Case)
    found |= weights_cases(Case)
    for kind in ("static", "dynamic"):
        scenario = replace_trigger(paper, kind)
        found[f"paper_{kind}"] = Case(closed_loop(scenario), 8.03)
        found[f"agent2_{kind}"] = Case(
            scenario_agents(scenario)["agent2"],
            9.07,
            {"neighbours[1]": ((2.0, 1.3), (7.5, 0.9)), "neighbours[2]": ((3.0, 0.6), (6.0, 1.0))},
        )
    return MappingProxyType(found)


def process_cases():
    """Processes, power electronics, and examples of the HyEQ Toolbox; no event lies on one of the 41 output points."""
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
        "ball_and_platform": Case(models.BallAndPlatform(), 8.0),
    }


def mechanics_cases():
    """Impacts and pulses, many of them at one instant; no event lies on one of the 41 output points."""
    models = hm.models
    return {
        "sawtooth_timer": Case(models.SawtoothTimer(period=0.7), 4.97),
        "scheduled_sawtooth_timer": Case(models.ScheduledSawtoothTimer(period=0.7, elapsed=0.2), 4.97),
        "particle_in_box": Case(models.ParticleInBox(), 9.7),
        "particle_in_corners": Case(models.ParticleInBox(x=0.5, y=0.25, vx=0.3, vy=0.15), 23.7),
        "ball_on_moving_table": Case(
            models.BallOnMovingTable(),
            2.41,
            {"table": ((0.1, 0.2), (0.6, -0.3)), "table_velocity": ((0.2, 0.5), (0.7, 0.0), (1.3, -0.2))},
        ),
        "ball_on_oscillating_table": Case(
            models.BallOnOscillatingTable(table={"amplitude": 0.12753}, h=0.0, v=3.0, e=0.5), 5.93
        ),
        "newtons_cradle": Case(models.NewtonsCradle(x=[-0.05, -0.05, 0.0, 0.0, 0.0]), 2.0),
        "newtons_cradle_unequal": Case(models.NewtonsCradle(x=[-0.05, 0.0, 0.02]), 2.0),
        "fireflies": Case(models.Fireflies(phase=[0.13, 0.95, 0.62, 0.37]), 6.4),
        "firefly": Case(models.Firefly(others=2, phase=0.23), 4.0, {"received[2]": ((0.5, 1.0), (1.6, 3.0))}),
        "firefly_network": Case(models.FireflyNetwork([0.13, 0.95, 0.62]), 6.4),
    }


def linear_cases():
    """Linear plants under sampled and event-triggered feedback; no event lies on one of the output points."""
    models = hm.models
    return {
        "sampled_lti_loop": Case(models.SampledLtiLoop(), 7.03),
        "event_triggered_lti_loop": Case(models.EventTriggeredLtiLoop(), 5.0),
        "control_plant_event_triggered": Case(control_plant_under_triggers(), 6.0),
        "control_plant_digital_controller": Case(control_plant_under_digital_controller(), 7.01, {"r": ((2.3, 0.4),)}),
    }


def control_plant_under_triggers():
    """python-control's plant and gain as parts; each of the two sensors sends when its value has moved by 0.02."""
    plant = control.ss(
        [[0.0, 1.0], [-2.0, 3.0]], [[0.0], [1.0]], np.eye(2), 0.0, inputs=["u"], outputs=["position", "velocity"]
    )
    gain = control.ss([], [], [], [[1.0, -4.0]], inputs=["position", "velocity"], outputs=["u"])
    parts = {"plant": lti(plant, start=[0.8, -0.3]), "gain": lti(gain)}
    wires = {"plant.u": "gain.u"}
    for sensor in ("position", "velocity"):
        parts[sensor] = consensus.StaticTrigger(threshold=0.02)
        wires |= {f"{sensor}.x": f"plant.{sensor}", f"gain.{sensor}": f"{sensor}.broadcast"}
    return hm.Composition("control_plant_under_triggers", parts, wires)


def control_plant_under_digital_controller():
    """python-control's transfer functions in a loop: a plant in continuous time, a PI controller that samples."""
    plant = control.tf([2.0], [1.0, 1.2, 1.0], inputs=["u"], outputs=["y"])
    controller = control.ss([[1.0]], [[0.2, -0.2]], [[0.9]], [[0.6, -0.6]], 0.2, inputs=["r", "y"], outputs=["u"])
    parts = {"plant": lti(plant), "controller": lti(controller)}
    return hm.Composition(
        "control_plant_under_digital_controller",
        parts,
        {"plant.u": "controller.u", "controller.y": "plant.y"},
        {"controller.r": "r", "plant.y": "y", "controller.u": "u", "controller.x": "integral"},
    )
