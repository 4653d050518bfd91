#!/usr/bin/env bash
# A container of the FMU Manipulation Toolbox steps all its FMUs with the largest step that any of them proposes.
#
# Two FMUs are put into one container, and no step is given for it. One proposes 1 ms in its DefaultExperiment, a fast
# controller; the other 0.25 s, a slow plant. A good engineer expects the smallest step, or a question: whoever proposes
# 1 ms is not right with 0.25 s. The container takes the largest, and the log names it among other lines at the level
# INFO. Who is hurt: everybody who adds a slow model to a container that has worked until then.
#
# Needs python3 with venv, and cc. Ends with status 0 if the toolbox still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'fmu-manipulation-toolbox==2.0' 'fmpy==0.3.32' 'numpy==2.4.6'

# Two FMUs for Co-Simulation, FMI 2.0, whose output is the time that they have come to.
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
cc -w -shared -fPIC -o "$work/ramp.so" "$work/ramp.c"
cat > "$work/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="ramp" guid="ramp" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="ramp" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="STEP"/>
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
import importlib.metadata, logging, pathlib, sys, zipfile
import fmpy
from fmu_manipulation_toolbox.container import FMUContainer

logging.disable(logging.CRITICAL)
work = pathlib.Path(sys.argv[1])
text = (work / "modelDescription.xml").read_text()
proposed = {"fast": "0.001", "slow": "0.25"}
for name, step in proposed.items():
    with zipfile.ZipFile(work / f"{name}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", text.replace("STEP", step))
        archive.write(work / "ramp.so", "binaries/linux64/ramp.so")
    fmpy.read_model_description(str(work / f"{name}.fmu"), validate=True)


def made_of(*names):
    container = FMUContainer("both", work)
    for name in names:
        container.get_fmu(f"{name}.fmu")
    container.add_implicit_rule()
    container.make_fmu(work / "both.fmu")
    return float(fmpy.read_model_description(str(work / "both.fmu")).defaultExperiment.stepSize)


version = importlib.metadata.version("fmu-manipulation-toolbox")
print(f"fmu-manipulation-toolbox {version}: FMUs that propose {proposed} s; the step of a container of")
steps = {names: made_of(*names) for names in (("fast",), ("slow",), ("fast", "slow"), ("slow", "fast"))}
for names, step in steps.items():
    print(f"  {' and '.join(names)}: {step} s")
sys.exit(list(steps.values()) != [0.001, 0.25, 0.25, 0.25])
P
"$work/env/bin/python" "$work/run.py" "$work"
