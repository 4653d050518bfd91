#!/usr/bin/env bash
# fmpy takes a start value in degrees Celsius for a difference of temperatures.
#
# simulate_fmu accepts start values with a unit, start_values={"T": (25.0, "degC")}, and converts them by the DisplayUnit
# of the model description. A good engineer expects 25 degC to arrive as 298.15 K. It does where the variable has no
# declared type. Where it has one, as tools that come from Modelica write it, and the type is no relative quantity, the
# offset is dropped in silence: the model starts at 25 K. Who is hurt: everybody with temperatures, or pressures by gauge.
#
# Needs python3 with venv, and cc. Ends with status 0 if fmpy still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'fmpy==0.3.32' 'numpy==2.4.6'

# An FMU for Co-Simulation, FMI 2.0, that keeps the temperature that it is given.
mkdir -p "$work/fmu/binaries/linux64"
cat > "$work/body.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
#define T (*(double *)c)
#define OK(name, ...) int name(__VA_ARGS__) { return 0; }
#define REFUSED(name, ...) int name(__VA_ARGS__) { return 3; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *f, int v, int l)
{
    double *c = malloc(sizeof(double));
    *c = 300.0;
    return c;
}
void fmi2FreeInstance(void *c) { free(c); }
OK(fmi2SetDebugLogging, void *c, int on, size_t n, const char **k)
OK(fmi2SetupExperiment, void *c, int d, double tol, double t, int s, double e)
OK(fmi2EnterInitializationMode, void *c)
OK(fmi2ExitInitializationMode, void *c)
OK(fmi2Terminate, void *c)
int fmi2Reset(void *c) { T = 300.0; return 0; }
int fmi2GetReal(void *c, const R *r, size_t n, double *x) { for (size_t i = 0; i < n; i++) x[i] = T; return 0; }
int fmi2SetReal(void *c, const R *r, size_t n, const double *x) { for (size_t i = 0; i < n; i++) T = x[i]; return 0; }
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
cc -w -shared -fPIC -o "$work/fmu/binaries/linux64/body.so" "$work/body.c"

cat > "$work/run.py" <<'P'
import pathlib, sys, zipfile
import fmpy

work = pathlib.Path(sys.argv[1])
TYPES = """<TypeDefinitions><SimpleType name="Temperature">
  <Real quantity="ThermodynamicTemperature" unit="K"/></SimpleType></TypeDefinitions>"""
TEXT = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="body" guid="body" numberOfEventIndicators="0">
<CoSimulation modelIdentifier="body" canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions><Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" offset="-273.15"/></Unit></UnitDefinitions>
{types}
<DefaultExperiment startTime="0" stopTime="1"/>
<ModelVariables><ScalarVariable name="T" valueReference="0" causality="parameter" variability="fixed" initial="exact">
<Real {declared}unit="K" start="300"/></ScalarVariable>
<ScalarVariable name="seen" valueReference="1" causality="output" variability="continuous" initial="calculated">
<Real {declared}unit="K"/></ScalarVariable></ModelVariables>
<ModelStructure><Outputs><Unknown index="2"/></Outputs><InitialUnknowns><Unknown index="2"/></InitialUnknowns>
</ModelStructure></fmiModelDescription>"""
seen = {}
for name, types, declared in (("without", "", ""), ("with", TYPES, 'declaredType="Temperature" ')):
    path = work / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", TEXT.format(types=types, declared=declared))
        archive.write(work / "fmu/binaries/linux64/body.so", "binaries/linux64/body.so")
    fmpy.read_model_description(str(path), validate=True)
    result = fmpy.simulate_fmu(str(path), start_values={"T": (25.0, "degC")}, output=["seen"])
    seen[name] = float(result["seen"][0])
print(f"fmpy {fmpy.__version__}: T = 25 degC arrives as")
print(f"  {seen['without']} K {'without'} a declared type")
print(f"  {seen['with']} K with one")
sys.exit(seen != {"without": 298.15, "with": 25.0})
P
"$work/env/bin/python" "$work/run.py" "$work"
