#!/usr/bin/env bash
# Ecos never takes an action of a scenario whose time lies within a step, nor any action after it.
#
# A scenario of Ecos is a list of actions, in a file or in an annotation of an SSP file: at a time, a variable gets a
# value. A good engineer expects an action between two steps at the next one, as a simulator with fixed steps must.
# Ecos looks before each step whether the first action that is left has this very time, within 1e-9 s. If not, it
# waits, also when the time has passed: with steps of 1/8 s that at 0.3 s is never taken, and those at 0.5 s and 0.75
# s, which are on the grid, wait behind it for ever. Nothing is said. The attribute eps of the format, a tolerance that
# could help, is read and not used. Who is hurt: tests of faults and of set points; a test that the system stands a
# fault passes because there was none.
#
# Needs python3 with venv, and cc. Ends with status 0 if Ecos still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
packages=('ecospy==0.7.2' 'tbb==2023.2.0' 'fmpy==0.3.32' 'numpy==2.4.6')
"$work/env/bin/pip" install --quiet --disable-pip-version-check "${packages[@]}"

# An FMU for Co-Simulation, FMI 2.0, with an input u that the actions set.
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
<ssd:SystemStructureDescription xmlns:ssd="{SPACE}Description" xmlns:ssc="{SPACE}Common" version="1.0" name="one">
  <ssd:System name="one">
    <ssd:Elements>
      <ssd:Component name="part" type="application/x-fmu-sharedlibrary" source="resources/part.fmu"/>
    </ssd:Elements>
  </ssd:System>
  <ssd:DefaultExperiment startTime="0" stopTime="1">
    <ssd:Annotations>
      <ssc:Annotation type="com.github.ecos-platform.scenario">
        <ecos:Scenario xmlns:ecos="http://github.com/Ecos-platform/libecos/resources/schema/ScenarioConfig"EPS>
          ACTIONS
        </ecos:Scenario>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:DefaultExperiment>
</ssd:SystemStructureDescription>
"""


def ends_with(actions, eps):
    """The input u of the FMU after 1 s."""
    action = '<ecos:action t="{}"><ecos:variable id="part::u"><ecos:real value="{}"/></ecos:variable></ecos:action>'
    texts = "".join(action.format(*one) for one in actions)
    with zipfile.ZipFile(work / "one.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", STRUCTURE.replace("EPS", eps).replace("ACTIONS", texts))
        archive.write(path, "resources/part.fmu")
    read_ssd(str(work / "one.ssp"), validate=True)
    with ecospy.EcosSimulation(0.125, ssp_path=str(work / "one.ssp")) as run:
        assert run.init()
        run.step(8)
        return run.get_real("part::u")


print(f"Ecos {ecospy.EcosLib.version()}: steps of 0.125 s; an input at 1 s, after actions (time in s, value)")
found = []
for actions, eps in (
    ([(0.25, 1.0), (0.5, 2.0), (0.75, 3.0)], ""),
    ([(0.3, 1.0), (0.5, 2.0), (0.75, 3.0)], ""),
    ([(0.3, 1.0), (0.5, 2.0), (0.75, 3.0)], ' eps="0.1"'),
    ([(0.25, 1.0), (0.3, 1.5), (0.5, 2.0), (0.75, 3.0)], ""),
):
    found.append(ends_with(actions, eps))
    print(f"  {actions}{eps}: {found[-1]} (the last action says {actions[-1][1]})")
sys.exit(found != [3.0, 0.0, 0.0, 1.0])
P
"$work/env/bin/python" "$work/run.py" "$work"
