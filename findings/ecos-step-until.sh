#!/usr/bin/env bash
# Ecos's step_until stops one step before the time that it is given, and step_for with the step does nothing.
#
# EcosSimulation has step(n), step_until(time) and step_for(duration). A good engineer expects step_until(1.0) to come
# to 1 s, as step(8) does with steps of 1/8 s, and a loop of step_for(1/8) to go on by a step each time. step_until
# goes on while the end of the next step is before the given time, so it ends at 0.875 s; step_for is step_until of the
# time now and the duration, so it makes one step too few, and none at all if the duration is one step. The first step
# of a run is always made; where sums of steps are rounded down (0.1 s), the missing step may be made. Nothing is said.
# Who is hurt: loops around Ecos that set inputs or read outputs at given times, or couple it with something that has a
# clock of its own; their last row, and with step_for every row, is that of another time.
#
# Needs python3 with venv, and cc. Ends with status 0 if Ecos still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
packages=('ecospy==0.7.2' 'tbb==2023.2.0' 'fmpy==0.3.32' 'numpy==2.4.6')
"$work/env/bin/pip" install --quiet --disable-pip-version-check "${packages[@]}"

# An FMU for Co-Simulation, FMI 2.0, whose output is the time that it has come to.
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
import ctypes, pathlib, shutil, sys
import fmpy

# The wheel of ecospy leaves out the library of oneTBB, which it needs.
ctypes.CDLL(str(next(pathlib.Path(sys.prefix, "lib").glob("libtbb.so.*"))), ctypes.RTLD_GLOBAL)
import ecospy

path = shutil.make_archive(sys.argv[1] + "/part", "zip", sys.argv[1] + "/part")
path = shutil.move(path, sys.argv[1] + "/part.fmu")
fmpy.read_model_description(path, validate=True)
ecospy.EcosLib.set_log_level("warn")


def ends_at(step, drive):
    """Times of Ecos and of the FMU."""
    structure = ecospy.EcosSimulationStructure()
    structure.add_model("part", path)
    with ecospy.EcosSimulation(step, structure=structure) as run:
        assert run.init()
        drive(run)
        return run.get_time(), run.get_real("part::now")


def to_one(run):
    run.step_until(1.0)


def parts(step):
    def drive(run):
        for _ in range(round(1 / step)):
            run.step_for(step)

    return drive


print(f"Ecos {ecospy.EcosLib.version()}: times that Ecos and an FMU in it come to, in s; 1 s is asked for each time")
found = {}
for step in (0.125, 0.1):
    for name, drive in (
        (f"step({round(1 / step)})", lambda run: run.step(round(1 / step))),
        ("step_until(1.0)", to_one),
        (f"{round(1 / step)} x step_for({step})", parts(step)),
    ):
        found[name, step] = ends_at(step, drive)
        print(f"  steps of {step} s, {name}: {found[name, step]}")
same = (
    found["step(8)", 0.125] == (1.0, 1.0)
    and found["step_until(1.0)", 0.125] == (0.875, 0.875)
    and found["8 x step_for(0.125)", 0.125] == (0.125, 0.125)
    and found["10 x step_for(0.1)", 0.1] == (0.1, 0.1)
)
sys.exit(not same)
P
"$work/env/bin/python" "$work/run.py" "$work"
