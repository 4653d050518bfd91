#!/usr/bin/env bash
# fmpy shows a jump in a table of inputs one output point late in Co-Simulation.
#
# simulate_fmu takes a table of inputs with two rows at a jump. A good engineer expects a result with both sides of the
# jump, as Model Exchange has it, or with the new value. In Co-Simulation the row at the jump is recorded before the new
# value is set, and no second row follows: the recorded input itself, and every output that depends on it directly, are
# old there, and the next row is a whole output interval later. What the FMU computes from the input is right. Who is
# hurt: everybody who compares such a result with another tool's, or reads reaction times from it.
#
# Needs python3 with venv, and cc. Ends with status 0 if fmpy still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'fmpy==0.3.32' 'numpy==2.4.6'

# An FMU for Co-Simulation, FMI 2.0, whose output is its input.
mkdir -p "$work/wire/binaries/linux64"
cat > "$work/wire.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
#define U (*(double *)c)
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
int fmi2Reset(void *c) { U = 0.0; return 0; }
int fmi2GetReal(void *c, const R *r, size_t n, double *x) { for (size_t i = 0; i < n; i++) x[i] = U; return 0; }
int fmi2SetReal(void *c, const R *r, size_t n, const double *x) { for (size_t i = 0; i < n; i++) U = x[i]; return 0; }
OK(fmi2DoStep, void *c, double t, double h, int no)
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
cc -w -shared -fPIC -o "$work/wire/binaries/linux64/wire.so" "$work/wire.c"
cat > "$work/wire/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="wire" guid="wire" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="wire" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="continuous" initial="calculated"><Real/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies="1"/></Outputs>
    <InitialUnknowns><Unknown index="2" dependencies="1"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
X

cat > "$work/run.py" <<'P'
import pathlib, shutil, sys
import fmpy
import numpy as np

folder = pathlib.Path(sys.argv[1]) / "wire"
path = shutil.make_archive(str(folder), "zip", folder)
fmpy.read_model_description(path, validate=True)
table = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (1.0, 1.0)], dtype=[("time", float), ("u", float)])
result = fmpy.simulate_fmu(path, stop_time=1.0, output_interval=0.25, input=table, output=["u", "y"])
print(f"fmpy {fmpy.__version__}: y = u, u jumps from 0 to 1 at 0.5 s, a row every 0.25 s")
for t, u, y in result:
    print(f"  t = {t:.2f}: u = {u:.0f}, y = {y:.0f}")
sys.exit([(t, y) for t, _, y in result.tolist()] != [(0.0, 0.0), (0.25, 0.0), (0.5, 0.0), (0.75, 1.0), (1.0, 1.0)])
P
"$work/env/bin/python" "$work/run.py" "$work"
