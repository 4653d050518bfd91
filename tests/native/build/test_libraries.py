"""The libraries of the engine and of models: what they export, and when they are compiled."""

import ctypes

from hybrid_model.models.bouncing_ball import BouncingBall
from hybrid_model.native.build.libraries import MODEL_SYMBOL, engine_library, model_library
from hybrid_model.native.model_code import model_code
from hybrid_model.native.networks.network import trace_any


def model_name(path):
    """The first member of the model."""
    function = getattr(ctypes.CDLL(str(path)), MODEL_SYMBOL)
    function.restype = ctypes.POINTER(ctypes.c_char_p)
    return function()[0].decode()


def test_a_model_is_found_in_its_library():
    source = model_code(trace_any(BouncingBall()))
    assert model_name(model_library(source)) == "BouncingBall"


def test_the_engine_is_one_file():
    assert engine_library() == engine_library()
    ctypes.CDLL(str(engine_library()))
