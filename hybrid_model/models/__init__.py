"""Model library: small automata with known answers. It imports what its users import: `hybrid_model`."""

from hybrid_model.models.analog_digital import (
    AnalogDigitalConverter,
    AnalogDigitalLoop,
    FiniteStateMachine,
    FirstOrderPlant,
    ZeroOrderHold,
)
from hybrid_model.models.ball_and_platform import BallAndPlatform, BallOverPlatform, SpringPlatform
from hybrid_model.models.ball_on_moving_table import BallOnMovingTable, BallOnOscillatingTable, OscillatingTable
from hybrid_model.models.boost_converter import BoostConverter
from hybrid_model.models.bouncing_ball import BouncingBall
from hybrid_model.models.event_triggered_lti_loop import EventTriggeredFeedback, EventTriggeredLtiLoop
from hybrid_model.models.fireflies import Fireflies, Firefly, FireflyNetwork
from hybrid_model.models.juggled_ball import JuggledBall, PeriodController, PushedBall
from hybrid_model.models.network_estimation import (
    LinearProcess,
    NetworkEstimation,
    SineSource,
    SporadicEstimator,
    SporadicNetwork,
)
from hybrid_model.models.newtons_cradle import NewtonsCradle
from hybrid_model.models.particle_in_box import ParticleInBox
from hybrid_model.models.relay_hysteresis import RelayHysteresis
from hybrid_model.models.resting_ball import RestingBall
from hybrid_model.models.sampled_lti_loop import LtiPlant, SampledFeedback, SampledLtiLoop
from hybrid_model.models.sawtooth_timer import SawtoothTimer, ScheduledSawtoothTimer
from hybrid_model.models.stiff_thermostat import StiffThermostat
from hybrid_model.models.switched_feedback import NormSwitch, StaticFeedback, SwitchedFeedback
from hybrid_model.models.thermostat import Thermostat
from hybrid_model.models.two_gene_network import TwoGeneNetwork
from hybrid_model.models.two_tank import TwoTank
from hybrid_model.models.van_der_pol import VanDerPol
from hybrid_model.models.vehicle_on_path import VehicleOnPath

__all__ = [
    "AnalogDigitalConverter",
    "AnalogDigitalLoop",
    "BallAndPlatform",
    "BallOnMovingTable",
    "BallOnOscillatingTable",
    "BallOverPlatform",
    "BoostConverter",
    "BouncingBall",
    "EventTriggeredFeedback",
    "EventTriggeredLtiLoop",
    "FiniteStateMachine",
    "Fireflies",
    "Firefly",
    "FireflyNetwork",
    "FirstOrderPlant",
    "JuggledBall",
    "LinearProcess",
    "LtiPlant",
    "NetworkEstimation",
    "NewtonsCradle",
    "NormSwitch",
    "OscillatingTable",
    "ParticleInBox",
    "PeriodController",
    "PushedBall",
    "RelayHysteresis",
    "RestingBall",
    "SampledFeedback",
    "SampledLtiLoop",
    "SawtoothTimer",
    "ScheduledSawtoothTimer",
    "SineSource",
    "SporadicEstimator",
    "SporadicNetwork",
    "SpringPlatform",
    "StaticFeedback",
    "StiffThermostat",
    "SwitchedFeedback",
    "Thermostat",
    "TwoGeneNetwork",
    "TwoTank",
    "VanDerPol",
    "VehicleOnPath",
    "ZeroOrderHold",
]
