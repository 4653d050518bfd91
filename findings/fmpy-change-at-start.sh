#!/usr/bin/env bash
# fmpy never takes a change of a discrete input that lies at the start time of a run with Model Exchange.
#
# simulate_fmu takes a table of inputs and a start time, so one table can serve for several runs, each of which starts
# where the one before it stopped, or at the time of interest. Discrete inputs stand still between the rows, and a row
# counts from its time on. A good engineer expects a run that starts at the time of a row to have the value of that row.
# fmpy takes the row before it, for what holds just before the event, and then waits for events after the start time:
# the one at the start is never made. A valve that opens at 1 s stays shut in the run that starts at 1 s, until the next
# row with another value; runs that start 1 ms earlier or later are right, and so are tables whose first row is at the
# start. Who is hurt: runs in pieces, with states handed over, of which none takes the change; and scenarios that start
# where a mode changes, where one looks first.
#
# Needs python3 with venv, and cc. Ends with status 0 if fmpy still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'fmpy==0.3.32' 'numpy==2.4.6'

# A tank for Model Exchange, FMI 2.0: x' = u, where u is a discrete input, a valve that stands still between events.
mkdir -p "$work/tank/binaries/linux64"
cat > "$work/tank.c" <<'C'
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
OK(fmi2GetEventIndicators, void *c, double *z, size_t n)
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
cc -w -shared -fPIC -o "$work/tank/binaries/linux64/tank.so" "$work/tank.c"
cat > "$work/tank/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="tank" guid="tank" numberOfEventIndicators="0">
  <ModelExchange modelIdentifier="tank"/>
  <DefaultExperiment startTime="0" stopTime="2"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output" variability="continuous" initial="exact">
      <Real start="0"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="1" causality="input" variability="discrete"><Real start="0"/>
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
path = shutil.make_archive(str(work / "tank"), "zip", work / "tank")
description = fmpy.read_model_description(path, validate=True)
assert {variable.name: variable.variability for variable in description.modelVariables}["u"] == "discrete"
table = np.array([(0.0, 0.0), (1.0, 1.0), (3.0, 0.0)], dtype=[("time", float), ("u", float)])


def run(start, stop, level=0.0, solver="CVode", rows=table):
    """Level and valve at the end."""
    result = fmpy.simulate_fmu(
        path,
        start_time=start,
        stop_time=stop,
        solver=solver,
        output_interval=(stop - start) / 100,
        step_size=(stop - start) / 100,
        relative_tolerance=1e-8,
        start_values={"x": level},
        input=rows,
        output=["x", "u"],
    )
    return float(result["x"][-1]), float(result["u"][-1])


print(f"fmpy {fmpy.__version__}: x' = u, Model Exchange; u = 0 from 0 s, 1 from 1 s, 0 from 3 s; x(2 s), exactly 1")
found = {}
for start in (0.0, 0.999, 1.0, 1.001):
    for solver in ("CVode", "Euler"):
        level, valve = found[start, solver] = run(start, 2.0, max(0.0, start - 1.0), solver)
        print(f"  {solver}, a run that starts at {start} s: x = {level:.6f}, u = {valve}")
before, _ = run(0.0, 1.0)
after, _ = run(1.0, 2.0, before)
print(f"  CVode, two runs, from 0 to 1 s and from 1 to 2 s: x = {after:.6f}")
cut, _ = run(1.0, 2.0, before, rows=table[1:])
print(f"  the second one with a table whose first row is that of 1 s: x = {cut:.6f}")
good = all(abs(found[key][0] - 1.0) < 0.02 and found[key][1] == 1.0 for key in found if key[0] != 1.0)
lost = all(found[1.0, solver] == (0.0, 0.0) for solver in ("CVode", "Euler"))
sys.exit(not (good and lost and abs(after) < 1e-9 and abs(cut - 1.0) < 1e-6))
P
"$work/env/bin/python" "$work/run.py" "$work"
