#!/usr/bin/env bash
# fmpy's simulate_ssp makes the first step of a system with zeros at all inputs, whatever the sources give at the start.
#
# One FMU gives 5 at all times, another integrates its input; their connection is all there is. A good engineer expects
# 5 after 1 s: FMI's initialization mode is there so that outputs at the start reach inputs before the first step.
# fmpy leaves initialization mode of each FMU before it reads an output, and
# begins with 0 on every connection; so the integral is short by one step, and a system that would stay where it is
# is pushed away by its first step. Who is hurt: everybody who takes fmpy's run of an .ssp for a reference; the error goes
# with the step, but no setting makes it go away.
#
# Needs python3 with venv, and cc. Ends with status 0 if fmpy still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'fmpy==0.3.32' 'numpy==2.4.6'

# Two FMUs for Co-Simulation, FMI 2.0: a constant 5, and the integral of an input that is held during a step.
mkdir -p "$work/five/binaries/linux64" "$work/sum/binaries/linux64" "$work/two/resources"
cat > "$work/fmu.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
#define V ((double *)c) /* input, output */
#define OK(name, ...) int name(__VA_ARGS__) { return 0; }
#define REFUSED(name, ...) int name(__VA_ARGS__) { return 3; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *f, int v, int l)
{
    double *c = calloc(2, sizeof(double));
    c[1] = START;
    return c;
}
void fmi2FreeInstance(void *c) { free(c); }
OK(fmi2SetDebugLogging, void *c, int on, size_t n, const char **k)
OK(fmi2SetupExperiment, void *c, int d, double tol, double t, int s, double e)
OK(fmi2EnterInitializationMode, void *c)
OK(fmi2ExitInitializationMode, void *c)
OK(fmi2Terminate, void *c)
int fmi2Reset(void *c) { V[0] = 0.0; V[1] = START; return 0; }
int fmi2GetReal(void *c, const R *r, size_t n, double *x) { for (size_t i = 0; i < n; i++) x[i] = V[r[i]]; return 0; }
int fmi2SetReal(void *c, const R *r, size_t n, const double *x) { for (size_t i = 0; i < n; i++) V[r[i]] = x[i]; return 0; }
int fmi2DoStep(void *c, double t, double h, int no) { V[1] += h * V[0]; return 0; }
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
cc -w -shared -fPIC -DSTART=5.0 -o "$work/five/binaries/linux64/five.so" "$work/fmu.c"
cc -w -shared -fPIC -DSTART=0.0 -o "$work/sum/binaries/linux64/sum.so" "$work/fmu.c"
cat > "$work/five/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="five" guid="five" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="five" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="continuous" initial="exact">
      <Real start="5"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="1" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
X
cat > "$work/sum/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="sum" guid="sum" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="sum" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="continuous" initial="exact">
      <Real start="0"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
X
cat > "$work/two/SystemStructure.ssd" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="two">
  <ssd:System name="two">
    <ssd:Connectors><ssd:Connector name="integral" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>
    <ssd:Elements>
      <ssd:Component name="five" type="application/x-fmu-sharedlibrary" source="resources/five.fmu">
        <ssd:Connectors><ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="sum" type="application/x-fmu-sharedlibrary" source="resources/sum.fmu">
        <ssd:Connectors>
          <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="five" startConnector="y" endElement="sum" endConnector="u"/>
      <ssd:Connection startElement="sum" startConnector="y" endConnector="integral"/>
    </ssd:Connections>
  </ssd:System>
</ssd:SystemStructureDescription>
X

cat > "$work/run.py" <<'P'
import pathlib, shutil, sys
import fmpy
from fmpy.ssp.simulation import simulate_ssp

work = pathlib.Path(sys.argv[1])
for name in ("five", "sum"):
    fmu = shutil.move(shutil.make_archive(str(work / name), "zip", work / name), work / f"two/resources/{name}.fmu")
    fmpy.read_model_description(fmu, validate=True)
path = shutil.move(shutil.make_archive(str(work / "two"), "zip", work / "two"), work / "two.ssp")
print(f"fmpy {fmpy.__version__}: the integral of 5 over 1 s")
ends = {}
for step in (0.5, 0.25, 0.125):
    result = simulate_ssp(path, stop_time=1.0, step_size=step)
    name = next(name for name in result.dtype.names if name.endswith("integral") or name.endswith("sum.y"))
    ends[step] = float(result[name][-1])
    print(f"  steps of {step:5g} s: {ends[step]:g}")
sys.exit(any(abs(end - 5.0 * (1.0 - step)) > 1e-12 for step, end in ends.items()))
P
"$work/env/bin/python" "$work/run.py" "$work"
