#!/usr/bin/env bash
# An FMU for Co-Simulation in PathSim is one communication step ahead of everything else.
#
# pathsim-fmi's CoSimulationFMU takes a step every dt. A good engineer expects that its outputs at t are what the FMU has
# come to at t; those of the last communication point would be a delay, and known. The block steps at the beginning of each
# step: at t it goes from t to t + dt and shows what is there at t + dt. An FMU whose output is its time says 0.1 at 0, and
# what others send arrives before it was due: an event of the FMU is seen up to a step before it happens. Who is hurt:
# everybody who closes a loop around such a block, for a lead of one step hides a delay that the real system has; and who
# compares its signals with another tool's.
#
# Needs python3 with venv, and cc. Ends with status 0 if pathsim-fmi still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'pathsim-fmi==0.1.1' 'pathsim==0.27.1' 'fmpy==0.3.32'

# An FMU for Co-Simulation, FMI 2.0, whose output is the time that it has come to.
mkdir -p "$work/ramp/binaries/linux64"
cat > "$work/ramp.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
#define NOW (*(double *)c)
#define OK(name, ...) int name(__VA_ARGS__) { return 0; }
#define REFUSED(name, ...) int name(__VA_ARGS__) { return 3; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *f, int v, int l)
{
    return calloc(1, sizeof(double));
}
void fmi2FreeInstance(void *c) { free(c); }
OK(fmi2SetDebugLogging, void *c, int on, size_t n, const char **k)
OK(fmi2SetupExperiment, void *c, int d, double tol, double t, int s, double e)
OK(fmi2EnterInitializationMode, void *c)
OK(fmi2ExitInitializationMode, void *c)
OK(fmi2Terminate, void *c)
int fmi2Reset(void *c) { NOW = 0.0; return 0; }
int fmi2GetReal(void *c, const R *r, size_t n, double *x) { for (size_t i = 0; i < n; i++) x[i] = NOW; return 0; }
REFUSED(fmi2SetReal, void *c, const R *r, size_t n, const double *x)
int fmi2DoStep(void *c, double t, double h, int no) { NOW = t + h; return 0; }
OK(fmi2CancelStep, void *c)
REFUSED(fmi2GetInteger, void *c, const R *r, size_t n, int *x)
REFUSED(fmi2GetBoolean, void *c, const R *r, size_t n, int *x)
REFUSED(fmi2GetString, void *c, const R *r, size_t n, const char **x)
REFUSED(fmi2SetInteger, void *c, const R *r, size_t n, const int *x)
REFUSED(fmi2SetBoolean, void *c, const R *r, size_t n, const int *x)
REFUSED(fmi2SetString, void *c, const R *r, size_t n, const char **x)
REFUSED(fmi2GetFMUstate, void *c, void **s)
REFUSED(fmi2SetFMUstate, void *c, void *s)
REFUSED(fmi2FreeFMUstate, void *c, void **s)
REFUSED(fmi2SerializedFMUstateSize, void *c, void *s, size_t *n)
REFUSED(fmi2SerializeFMUstate, void *c, void *s, char *b, size_t n)
REFUSED(fmi2DeSerializeFMUstate, void *c, const char *b, size_t n, void **s)
REFUSED(fmi2GetDirectionalDerivative, void *c, const R *z, size_t m, const R *v, size_t n, const double *d, double *y)
REFUSED(fmi2SetRealInputDerivatives, void *c, const R *r, size_t n, const int *o, const double *x)
REFUSED(fmi2GetRealOutputDerivatives, void *c, const R *r, size_t n, const int *o, double *x)
REFUSED(fmi2GetStatus, void *c, int k, int *x)
REFUSED(fmi2GetRealStatus, void *c, int k, double *x)
REFUSED(fmi2GetIntegerStatus, void *c, int k, int *x)
REFUSED(fmi2GetBooleanStatus, void *c, int k, int *x)
REFUSED(fmi2GetStringStatus, void *c, int k, const char **x)
C
cc -w -shared -fPIC -o "$work/ramp/binaries/linux64/ramp.so" "$work/ramp.c"
cat > "$work/ramp/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="ramp" guid="ramp" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="ramp" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <ScalarVariable name="y" valueReference="0" causality="output" variability="continuous" initial="calculated"><Real/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/></Outputs>
    <InitialUnknowns><Unknown index="1"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
X

MPLBACKEND=agg MPLCONFIGDIR="$work" "$work/env/bin/python" - "$work" <<'P'
import pathlib, shutil, sys
from importlib.metadata import version

import fmpy
from pathsim import Connection, Simulation
from pathsim.blocks import Scope
from pathsim_fmi import CoSimulationFMU

folder = pathlib.Path(sys.argv[1]) / "ramp"
path = shutil.make_archive(str(folder), "zip", folder)
fmpy.read_model_description(path, validate=True)
fmpy_rows = fmpy.simulate_fmu(path, stop_time=0.4, step_size=0.1, output_interval=0.1)
block, scope = CoSimulationFMU(path, dt=0.1), Scope()
Simulation([block, scope], [Connection(block, scope)], dt=0.1, log=False).run(0.4)
times, (outputs,) = scope.read()
print(f"pathsim-fmi {version('pathsim-fmi')}: the output of an FMU that shows its time, with steps of 0.1 s")
print(f"  fmpy {fmpy.__version__}:", ", ".join(f"y({t:.1f}) = {y:.1f}" for t, y in fmpy_rows))
print("  PathSim:", ", ".join(f"y({t:.1f}) = {y:.1f}" for t, y in zip(times, outputs)))
ahead = [y - t for t, y in zip(times, outputs)]
sys.exit(not (max(abs(y - t) for t, y in fmpy_rows) < 1e-9 and min(ahead[1:]) > 0.099))
P
