#!/usr/bin/env bash
# fmpy's CVode integrates an FMU for Model Exchange with inputs that stand still between output points.
#
# simulate_fmu takes a table of inputs and draws straight lines between its rows; so say the rows of its result. A good
# engineer expects that the solver is given these lines: it calls the derivatives at times of its own choice, and keeps to
# the relative tolerance. The time and the states are set in each such call, the inputs are not: they keep the value of the
# last output point, also beyond the next one where a step of CVode is longer. With x' = u and u = t the state after 10 s
# is 44.2 instead of 50 with output points 1 s apart, and no tolerance helps. The inputs are also set where event
# indicators are looked at, so an indicator that never fires changes the result. Who is hurt: everybody who drives an FMU
# by measured or planned signals, with output points as far apart as the plot needs them; who fits parameters to such a
# run, for every input is late by half an output interval or more; and who compares importers.
#
# Needs python3 with venv, and cc. Ends with status 0 if fmpy still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'fmpy==0.3.32' 'numpy==2.4.6'

# A store for Model Exchange, FMI 2.0: x' = u, with an event indicator 1 + x if the description says that it has one.
mkdir -p "$work/store/binaries/linux64"
cat > "$work/store.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
enum { X, U, DX };
#define v ((double *)c)
#define OK(name, ...) int name(__VA_ARGS__) { return 0; }
#define REFUSED(name, ...) int name(__VA_ARGS__) { return 3; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2Reset(void *c) { v[X] = v[U] = 0.0; return 0; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *f, int s, int l)
{
    return calloc(2, sizeof(double));
}
void fmi2FreeInstance(void *c) { free(c); }
OK(fmi2SetDebugLogging, void *c, int on, size_t n, const char **k)
OK(fmi2SetupExperiment, void *c, int d, double tol, double t, int s, double e)
OK(fmi2EnterInitializationMode, void *c)
OK(fmi2ExitInitializationMode, void *c)
OK(fmi2Terminate, void *c)
OK(fmi2EnterEventMode, void *c)
OK(fmi2EnterContinuousTimeMode, void *c)
OK(fmi2SetTime, void *c, double t)
int fmi2NewDiscreteStates(void *c, struct { int again, end, nominals, values, has; double next; } *info)
{
    info->again = info->end = info->nominals = info->values = info->has = 0;
    return 0;
}
int fmi2CompletedIntegratorStep(void *c, int no, int *event, int *end) { return *event = *end = 0; }
int fmi2GetDerivatives(void *c, double *d, size_t n) { d[0] = v[U]; return 0; }
int fmi2GetContinuousStates(void *c, double *s, size_t n) { s[0] = v[X]; return 0; }
int fmi2SetContinuousStates(void *c, const double *s, size_t n) { v[X] = s[0]; return 0; }
int fmi2GetNominalsOfContinuousStates(void *c, double *s, size_t n) { s[0] = 1.0; return 0; }
int fmi2GetEventIndicators(void *c, double *z, size_t n)
{
    for (size_t i = 0; i < n; i++)
        z[i] = 1.0 + v[X];
    return 0;
}
int fmi2GetReal(void *c, const R *r, size_t n, double *y)
{
    for (size_t i = 0; i < n; i++)
        y[i] = v[r[i] == DX ? U : r[i]];
    return 0;
}
int fmi2SetReal(void *c, const R *r, size_t n, const double *y)
{
    for (size_t i = 0; i < n; i++)
        v[r[i]] = y[i];
    return 0;
}
REFUSED(fmi2GetInteger, void *c, const R *r, size_t n, int *y)
REFUSED(fmi2GetBoolean, void *c, const R *r, size_t n, int *y)
REFUSED(fmi2GetString, void *c, const R *r, size_t n, const char **y)
REFUSED(fmi2SetInteger, void *c, const R *r, size_t n, const int *y)
REFUSED(fmi2SetBoolean, void *c, const R *r, size_t n, const int *y)
REFUSED(fmi2SetString, void *c, const R *r, size_t n, const char **y)
REFUSED(fmi2GetFMUstate, void *c, void **s)
REFUSED(fmi2SetFMUstate, void *c, void *s)
REFUSED(fmi2FreeFMUstate, void *c, void **s)
REFUSED(fmi2SerializedFMUstateSize, void *c, void *s, size_t *n)
REFUSED(fmi2SerializeFMUstate, void *c, void *s, char *b, size_t n)
REFUSED(fmi2DeSerializeFMUstate, void *c, const char *b, size_t n, void **s)
REFUSED(fmi2GetDirectionalDerivative, void *c, const R *z, size_t m, const R *w, size_t n, const double *d, double *y)
C
cc -w -shared -fPIC -o "$work/store/binaries/linux64/store.so" "$work/store.c"
cat > "$work/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="store" guid="store" numberOfEventIndicators="COUNT">
  <ModelExchange modelIdentifier="store"/>
  <DefaultExperiment startTime="0" stopTime="10"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output" variability="continuous" initial="exact">
      <Real start="0"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="2" causality="local" variability="continuous" initial="calculated">
      <Real derivative="1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/></Outputs>
    <Derivatives><Unknown index="3" dependencies="2"/></Derivatives>
    <InitialUnknowns><Unknown index="3" dependencies="2"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
X

cat > "$work/run.py" <<'P'
import pathlib, shutil, sys
import fmpy
import numpy as np

work = pathlib.Path(sys.argv[1])
description = (work / "modelDescription.xml").read_text()
kind = [("time", float), ("u", float)]
ramp = np.array([(t, t) for t in np.linspace(0.0, 10.0, 11)], dtype=kind)
level = np.array([(0.0, 5.0), (10.0, 5.0)], dtype=kind)


def state(inputs, indicators=0, **options):
    """x(10 s); the input of every row of the result is checked."""
    (work / "store" / "modelDescription.xml").write_text(description.replace("COUNT", str(indicators)))
    path = shutil.make_archive(str(work / "store"), "zip", work / "store")
    fmpy.read_model_description(path, validate=True)
    rows = fmpy.simulate_fmu(path, stop_time=10.0, input=inputs, output=["x", "u"], **options)
    assert np.allclose(rows["u"], np.interp(rows["time"], inputs["time"], inputs["u"]))
    return float(rows["x"][-1])


print(f"fmpy {fmpy.__version__}: x' = u, a row of inputs for each second, Model Exchange with CVode; x(10 s), exactly 50")
still = state(level, output_interval=1.0, relative_tolerance=1e-8)
print(f"  u = 5, an output point each second, tolerance 1e-8: {still:.6f}")
found = {}
for interval in (1.0, 0.1, 0.01):
    for tolerance in (1e-4, 1e-8):
        found[interval, tolerance] = state(ramp, output_interval=interval, relative_tolerance=tolerance)
        print(f"  u = t, an output point each {interval} s, tolerance {tolerance}: {found[interval, tolerance]:.6f}")
watched = state(ramp, 1, output_interval=1.0, relative_tolerance=1e-4)
print(f"  u = t, each 1.0 s, tolerance 0.0001, with an event indicator that never fires: {watched:.6f}")
wrong = all(value < 49.9 for value in found.values())
sys.exit(not (abs(still - 50.0) < 1e-6 and wrong and found[1.0, 1e-8] < 45.0 and watched > found[1.0, 1e-4] + 1.0))
P
"$work/env/bin/python" "$work/run.py" "$work"
