#!/usr/bin/env bash
# CasADi imports an FMU with events, and its integrator goes on through them in silence.
#
# DaeBuilder(name, folder) reads FMUs for Model Exchange, and create() makes functions of them that its integrators take.
# CasADi itself knows events (when, transition), so a good engineer expects that an FMU with an event indicator is either
# integrated with its events or refused. Its functions leave the indicators out, nothing asks the FMU for an update of its
# discrete states, and nothing is said: a ball falls through the floor. Who is hurt: everybody who fits parameters or
# plans controls for a model with contacts, thermostats or limits that somebody else has exported.
#
# Needs python3 with venv, and cc. Ends with status 0 if CasADi still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'casadi==3.8.2' 'fmpy==0.3.32' 'numpy==2.4.6'

# A bouncing ball for Model Exchange, FMI 2.0: h' = v, v' = -9.81, and v becomes -0.8 v where h falls to 0.
mkdir -p "$work/ball/binaries/linux64"
cat > "$work/ball.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
enum { H, V, DH, DV };
#define x ((double *)c)
#define OK(name, ...) int name(__VA_ARGS__) { return 0; }
#define REFUSED(name, ...) int name(__VA_ARGS__) { return 3; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2Reset(void *c) { x[H] = 1.0, x[V] = 0.0; return 0; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *f, int v, int l)
{
    void *c = malloc(2 * sizeof(double));
    fmi2Reset(c);
    return c;
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
    info->again = info->end = info->nominals = info->has = 0;
    info->values = x[H] <= 0.0 && x[V] < 0.0;
    if (info->values)
        x[H] = 0.0, x[V] *= -0.8;
    return 0;
}
int fmi2CompletedIntegratorStep(void *c, int no, int *event, int *end) { return *event = *end = 0; }
static double rate(void *c, int k) { return k == H ? x[V] : -9.81; }
int fmi2GetDerivatives(void *c, double *d, size_t n) { d[0] = rate(c, H), d[1] = rate(c, V); return 0; }
int fmi2GetContinuousStates(void *c, double *s, size_t n) { s[0] = x[H], s[1] = x[V]; return 0; }
int fmi2SetContinuousStates(void *c, const double *s, size_t n) { x[H] = s[0], x[V] = s[1]; return 0; }
int fmi2GetNominalsOfContinuousStates(void *c, double *s, size_t n) { s[0] = s[1] = 1.0; return 0; }
// Above zero on the way up, also where the ball has just left the floor.
int fmi2GetEventIndicators(void *c, double *z, size_t n) { z[0] = x[H] + (x[V] > 0.0 ? 1e-9 : 0.0); return 0; }
int fmi2GetReal(void *c, const R *r, size_t n, double *y)
{
    for (size_t i = 0; i < n; i++)
        y[i] = r[i] < DH ? x[r[i]] : rate(c, r[i] - DH);
    return 0;
}
int fmi2SetReal(void *c, const R *r, size_t n, const double *y)
{
    for (size_t i = 0; i < n; i++)
        x[r[i]] = y[i];
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
REFUSED(fmi2GetDirectionalDerivative, void *c, const R *z, size_t m, const R *v, size_t n, const double *d, double *y)
C
cc -w -shared -fPIC -o "$work/ball/binaries/linux64/ball.so" "$work/ball.c"
cat > "$work/ball/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="ball" guid="ball" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="ball"/>
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <ScalarVariable name="h" valueReference="0" causality="output" variability="continuous" initial="exact">
      <Real start="1" reinit="true"/></ScalarVariable>
    <ScalarVariable name="v" valueReference="1" causality="output" variability="continuous" initial="exact">
      <Real start="0" reinit="true"/></ScalarVariable>
    <ScalarVariable name="der(h)" valueReference="2" causality="local" variability="continuous" initial="calculated">
      <Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="der(v)" valueReference="3" causality="local" variability="continuous" initial="calculated">
      <Real derivative="2"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/><Unknown index="2"/></Outputs>
    <Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>
    <InitialUnknowns><Unknown index="3"/><Unknown index="4"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
X

cat > "$work/run.py" <<'P'
import pathlib, shutil, sys
import casadi as ca
import fmpy

folder = pathlib.Path(sys.argv[1]) / "ball"
path = shutil.make_archive(str(folder), "zip", folder)
fmpy.read_model_description(path, validate=True)
fmpy_h = fmpy.simulate_fmu(path, stop_time=1.0, relative_tolerance=1e-8, output=["h"])["h"][-1]
ball = ca.DaeBuilder("ball", str(folder))
integrator = ca.integrator("F", "cvodes", ball.create("f"), 0.0, 1.0)
casadi_h = float(integrator(x0=ball.start(ball.x()))["xf"][0])
first = (2 / 9.81) ** 0.5
rest = 1.0 - first
exact = 0.8 * 9.81 * first * rest - 9.81 * rest**2 / 2
print(f"h(1 s) of a ball that falls from 1 m and keeps 0.8 of its speed: exactly {exact:.6f} m")
print(f"  fmpy {fmpy.__version__}: {fmpy_h:.6f} m")
print(f"  CasADi {ca.__version__}: {casadi_h:.6f} m, without a warning (free fall: {1 - 9.81 / 2:.6f} m)")
sys.exit(not (abs(fmpy_h - exact) < 1e-4 and abs(casadi_h - (1 - 9.81 / 2)) < 1e-4))
P
"$work/env/bin/python" "$work/run.py" "$work"
