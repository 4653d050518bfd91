#!/usr/bin/env bash
# libcosim's simulate_until makes a step even where the simulation has come to that time already.
#
# A good engineer expects that simulate_until(T) does nothing if the time is T or later, so that a loop over a list of
# times, with one of them twice, or a second call to be on the safe side, does no harm. Each call makes one step at least
# and answers with success; the simulation runs ahead of the caller, whose inputs then act later than meant. Who is hurt:
# everybody who drives an execution from outside, in a loop with a user interface or hardware.
#
# Needs python3 with venv, and cc. Ends with status 0 if libcosim still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'libcosimpy==0.0.6'

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

cat > "$work/run.py" <<'P'
import importlib.metadata, pathlib, shutil, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

log_output_level(CosimLogLevel.FATAL)
folder = pathlib.Path(sys.argv[1]) / "ramp"
path = pathlib.Path(shutil.make_archive(str(folder), "zip", folder)).rename(folder.with_suffix(".fmu"))
execution = CosimExecution.from_step_size(100_000_000)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
ramp = execution.add_local_slave(CosimLocalSlave(str(path), "ramp"))
print(f"libcosimpy {importlib.metadata.version('libcosimpy')}: steps of 0.1 s")
reached = []
for target in (0.5, 0.5, 0.5, 0.2):
    done = execution.simulate_until(int(target * 1e9))
    reached.append(execution.status().current_time / 1e9)
    y = observer.last_real_values(ramp, [0])[0]
    print(f"  simulate_until({target} s) answers {done}: the time is {reached[-1]} s, the FMU is at {y:.1f} s")
sys.exit(reached != [0.5, 0.6, 0.7, 0.8])
P
"$work/env/bin/python" "$work/run.py" "$work"
