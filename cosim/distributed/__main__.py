"""``python -m cosim.distributed HOST:PORT``: a system for a mosaik on this machine or another one."""

import mosaik_api_v3

from cosim.distributed.mosaik_simulator import SystemSimulator

mosaik_api_v3.start_simulation(SystemSimulator())
