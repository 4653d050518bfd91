#!/usr/bin/env bash
# Ecos multiplies by zero where a connection of an SSP file has an offset and leaves out the factor.
#
# A connection of SSP may have a LinearTransformation: what arrives is factor * value + offset. Both are optional: the
# schema of SSP 1.0 gives the factor the default 1, the offset 0. So <ssc:LinearTransformation offset="273.15"/> makes
# kelvins of degrees Celsius, and a good engineer expects a tool that reads the element to know its defaults. Ecos
# takes a factor that is left out for 0: the sensor stands at 273.15 whatever the room does, in silence. Who is hurt:
# all who take over an SSP file that is right, in which what has its default is left out; and the value is a plausible
# one.
#
# Needs python3 with venv, and cc. Ends with status 0 if Ecos still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
packages=('ecospy==0.7.2' 'tbb==2023.2.0' 'fmpy==0.3.32' 'numpy==2.4.6')
"$work/env/bin/pip" install --quiet --disable-pip-version-check "${packages[@]}"

# An FMU for Co-Simulation, FMI 2.0: its output is the time, so a signal that rises by 1 in each second; u is an input.
mkdir -p "$work/part/binaries/linux64"
cat > "$work/part.c" <<'C'
#include <stdlib.h>
typedef unsigned R;
enum { U, NOW, COUNT };
#define x ((double *)c)
#define OK(name, ...) int name(__VA_ARGS__) { return 0; }
#define REFUSED(name, ...) int name(__VA_ARGS__) { return 3; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *f, int v, int l)
{
    return calloc(COUNT, sizeof(double));
}
void fmi2FreeInstance(void *c) { free(c); }
OK(fmi2SetDebugLogging, void *c, int on, size_t n, const char **k)
OK(fmi2SetupExperiment, void *c, int d, double tol, double t, int s, double e)
OK(fmi2EnterInitializationMode, void *c)
OK(fmi2ExitInitializationMode, void *c)
OK(fmi2Terminate, void *c)
int fmi2Reset(void *c) { x[U] = x[NOW] = 0.0; return 0; }
int fmi2DoStep(void *c, double t, double h, int no) { x[NOW] = t + h; return 0; }
int fmi2GetReal(void *c, const R *r, size_t n, double *y)
{
    for (size_t i = 0; i < n; i++)
        y[i] = x[r[i]];
    return 0;
}
int fmi2SetReal(void *c, const R *r, size_t n, const double *y)
{
    for (size_t i = 0; i < n; i++)
        x[r[i]] = y[i];
    return 0;
}
OK(fmi2CancelStep, void *c)
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
REFUSED(fmi2SetRealInputDerivatives, void *c, const R *r, size_t n, const int *o, const double *y)
REFUSED(fmi2GetRealOutputDerivatives, void *c, const R *r, size_t n, const int *o, double *y)
REFUSED(fmi2GetStatus, void *c, int k, int *y)
REFUSED(fmi2GetRealStatus, void *c, int k, double *y)
REFUSED(fmi2GetIntegerStatus, void *c, int k, int *y)
REFUSED(fmi2GetBooleanStatus, void *c, int k, int *y)
REFUSED(fmi2GetStringStatus, void *c, int k, const char **y)
C
cc -w -shared -fPIC -o "$work/part/binaries/linux64/part.so" "$work/part.c"
cat > "$work/part/modelDescription.xml" <<'X'
<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="part" guid="part" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="part" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"><Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="now" valueReference="1" causality="output" variability="continuous" initial="calculated">
      <Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies=""/></Outputs>
    <InitialUnknowns><Unknown index="2" dependencies=""/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
X

cat > "$work/run.py" <<'P'
import ctypes, pathlib, shutil, sys, zipfile
import fmpy
from fmpy.ssp.ssd import read_ssd

# The wheel of ecospy leaves out the library of oneTBB, which it needs.
ctypes.CDLL(str(next(pathlib.Path(sys.prefix, "lib").glob("libtbb.so.*"))), ctypes.RTLD_GLOBAL)
import ecospy

work = pathlib.Path(sys.argv[1])
path = shutil.move(shutil.make_archive(str(work / "part"), "zip", work / "part"), work / "part.fmu")
fmpy.read_model_description(str(path), validate=True)
ecospy.EcosLib.set_log_level("warn")
SPACE = "http://ssp-standard.org/SSP1/SystemStructure"
STRUCTURE = f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="{SPACE}Description" xmlns:ssc="{SPACE}Common" version="1.0" name="chain">
  <ssd:System name="chain">
    <ssd:Elements>
      <ssd:Component name="room" type="application/x-fmu-sharedlibrary" source="resources/part.fmu">
        <ssd:Connectors><ssd:Connector name="now" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="sensor" type="application/x-fmu-sharedlibrary" source="resources/part.fmu">
        <ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="room" startConnector="now" endElement="sensor" endConnector="u">
        <ssc:LinearTransformation ATTRIBUTES/>
      </ssd:Connection>
    </ssd:Connections>
  </ssd:System>
</ssd:SystemStructureDescription>
"""


def arrives(attributes):
    """What the sensor has after 1 s."""
    with zipfile.ZipFile(work / "chain.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", STRUCTURE.replace("ATTRIBUTES", attributes))
        archive.write(path, "resources/part.fmu")
    read_ssd(str(work / "chain.ssp"), validate=True)
    with ecospy.EcosSimulation(0.125, ssp_path=str(work / "chain.ssp")) as run:
        assert run.init()
        run.step(8)
        assert run.get_real("room::now") == 1.0
        return run.get_real("sensor::u")


print(f"Ecos {ecospy.EcosLib.version()}: the room sends 1 degree Celsius after 1 s; what arrives at the sensor")
found = {}
for attributes, exact in (
    ('factor="1" offset="273.15"', 274.15),
    ('offset="273.15"', 274.15),
    ('factor="2"', 2.0),
):
    found[attributes] = arrives(attributes)
    print(f"  {attributes}: {found[attributes]} (exactly {exact})")
sys.exit(list(found.values()) != [274.15, 273.15, 2.0])
P
"$work/env/bin/python" "$work/run.py" "$work"
