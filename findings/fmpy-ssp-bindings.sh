#!/usr/bin/env bash
# fmpy's simulate_ssp leaves out the parameter bindings that a system structure holds.
#
# A component in SystemStructure.ssd has a ParameterBinding with a value for a parameter of its FMU. A good
# engineer expects a run of the file as it is to take that value, for the binding is part of the system.
# fmpy reads the binding, lists it on the component, and runs with the FMU's own start value, without a word; only a
# parameter set handed over as an argument is applied. Who is hurt: everybody who is sent an .ssp and runs it to see
# whether it does what its author says, and whoever writes parameters as bindings, as the standard has them.
#
# Needs python3 with venv, and cc. Ends with status 0 if fmpy still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'fmpy==0.3.32' 'numpy==2.4.6'

# An FMU for Co-Simulation, FMI 2.0, whose output is its parameter.
mkdir -p "$work/tap/binaries/linux64" "$work/one/resources"
cat > "$work/tap.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
#define K (*(double *)c)
#define OK(name, ...) int name(__VA_ARGS__) { return 0; }
#define REFUSED(name, ...) int name(__VA_ARGS__) { return 3; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *f, int v, int l)
{
    double *c = malloc(sizeof(double));
    *c = 1.0;
    return c;
}
void fmi2FreeInstance(void *c) { free(c); }
OK(fmi2SetDebugLogging, void *c, int on, size_t n, const char **k)
OK(fmi2SetupExperiment, void *c, int d, double tol, double t, int s, double e)
OK(fmi2EnterInitializationMode, void *c)
OK(fmi2ExitInitializationMode, void *c)
OK(fmi2Terminate, void *c)
int fmi2Reset(void *c) { K = 1.0; return 0; }
int fmi2GetReal(void *c, const R *r, size_t n, double *x) { for (size_t i = 0; i < n; i++) x[i] = K; return 0; }
int fmi2SetReal(void *c, const R *r, size_t n, const double *x) { for (size_t i = 0; i < n; i++) K = x[i]; return 0; }
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
cc -w -shared -fPIC -o "$work/tap/binaries/linux64/tap.so" "$work/tap.c"
cat > "$work/tap/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="tap" guid="tap" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="tap" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <ScalarVariable name="k" valueReference="0" causality="parameter" variability="fixed" initial="exact"><Real start="1"/>
    </ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="continuous" initial="calculated"><Real/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies=""/></Outputs>
    <InitialUnknowns><Unknown index="2" dependencies="1"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
X
cat > "$work/one/SystemStructure.ssd" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="one">
  <ssd:System name="one">
    <ssd:Connectors><ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>
    <ssd:Elements>
      <ssd:Component name="tap" type="application/x-fmu-sharedlibrary" source="resources/tap.fmu">
        <ssd:Connectors>
          <ssd:Connector name="k" kind="parameter"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
        <ssd:ParameterBindings>
          <ssd:ParameterBinding>
            <ssd:ParameterValues>
              <ssv:ParameterSet version="1.0" name="values">
                <ssv:Parameters><ssv:Parameter name="k"><ssv:Real value="3"/></ssv:Parameter></ssv:Parameters>
              </ssv:ParameterSet>
            </ssd:ParameterValues>
          </ssd:ParameterBinding>
        </ssd:ParameterBindings>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="tap" startConnector="y" endConnector="y"/>
    </ssd:Connections>
  </ssd:System>
</ssd:SystemStructureDescription>
X

cat > "$work/run.py" <<'P'
import pathlib, shutil, sys
import fmpy
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd

work = pathlib.Path(sys.argv[1])
shutil.move(shutil.make_archive(str(work / "tap"), "zip", work / "tap"), work / "one/resources/tap.fmu")
fmpy.read_model_description(work / "one/resources/tap.fmu", validate=True)
path = shutil.move(shutil.make_archive(str(work / "one"), "zip", work / "one"), work / "one.ssp")
(component,) = read_ssd(path).system.elements
read = component.parameterBindings[0].parameterValues[0].parameters[0]
result = simulate_ssp(path, stop_time=1.0, step_size=0.5)
name = next(name for name in result.dtype.names if name.endswith("y"))
print(f"fmpy {fmpy.__version__}: y = k; the binding says k = 3, the FMU starts with k = 1")
print(f"  the binding that fmpy reads: {read.name} = {read.value}")
print(f"  y at the end: {result[name][-1]:g}")
sys.exit(not (read.name == "k" and float(read.value) == 3.0 and result[name][-1] == 1.0))
P
"$work/env/bin/python" "$work/run.py" "$work"
