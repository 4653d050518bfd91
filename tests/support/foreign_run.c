/* Runs an FMU of FMI 3.0 for Co-Simulation, on any platform, and prints what it does at full precision.

   Arguments: library, instantiation token, stop time, step, value references to print.  Events are taken in Event Mode,
   where they happen.  Halfway the state is serialised, and the rest is run by another instance. */
#include <stdio.h>
#include <stdlib.h>

#include "fmi3FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
static void *find(const char *path, const char *name)
{
    HMODULE library = LoadLibraryA(path);
    return library ? (void *)GetProcAddress(library, name) : NULL;
}
#else
#include <dlfcn.h>
static void *find(const char *path, const char *name)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        fprintf(stderr, "%s\n", dlerror());
    return library ? dlsym(library, name) : NULL;
}
#endif

enum { MOST_VALUES = 64, MOST_UPDATES = 1000 };

static const char *path;

static void *function(const char *name)
{
    void *found = find(path, name);
    if (!found) {
        fprintf(stderr, "There is no %s in %s.\n", name, path);
        exit(1);
    }
    return found;
}

#define CALL(name, arguments)                                                        \
    do {                                                                             \
        fmi3Status status_ = ((fmi3##name##TYPE *)function("fmi3" #name))arguments;  \
        if (status_ != fmi3OK) {                                                     \
            fprintf(stderr, "fmi3" #name " answers %d.\n", (int)status_);            \
            exit(1);                                                                 \
        }                                                                            \
    } while (0)

static void tell(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static fmi3Instance instantiate(const char *token)
{
    fmi3InstantiateCoSimulationTYPE *make =
        (fmi3InstantiateCoSimulationTYPE *)function("fmi3InstantiateCoSimulation");
    fmi3Instance instance =
        make("block", token, NULL, fmi3False, fmi3False, fmi3True, fmi3True, NULL, 0, NULL, tell, NULL);
    if (!instance)
        exit(1);
    return instance;
}

static void print_values(fmi3Instance instance, const char *what, double t, const fmi3ValueReference *references,
                         size_t n)
{
    fmi3Float64 values[MOST_VALUES];
    CALL(GetFloat64, (instance, references, n, values, n));
    printf("%s %.17g", what, t);
    for (size_t i = 0; i < n; i++)
        printf(" %.17g", values[i]);
    printf("\n");
}

static void settle(fmi3Instance instance)
{
    fmi3Boolean again = fmi3True, terminate = fmi3False, flag;
    fmi3Float64 next;
    for (int k = 0; again && k < MOST_UPDATES; k++)
        CALL(UpdateDiscreteStates, (instance, &again, &terminate, &flag, &flag, &flag, &next));
    CALL(EnterStepMode, (instance));
}

/* Go on by another instance, from what bytes can carry. */
static fmi3Instance handed_over(fmi3Instance instance, const char *token)
{
    fmi3FMUState state = NULL, copy = NULL;
    size_t size = 0;
    fmi3Instance other = instantiate(token);
    CALL(GetFMUState, (instance, &state));
    CALL(SerializedFMUStateSize, (instance, state, &size));
    fmi3Byte *bytes = malloc(size);
    CALL(SerializeFMUState, (instance, state, bytes, size));
    CALL(DeserializeFMUState, (other, bytes, size, &copy));
    CALL(SetFMUState, (other, copy));
    CALL(FreeFMUState, (other, &copy));
    CALL(FreeFMUState, (instance, &state));
    free(bytes);
    ((fmi3FreeInstanceTYPE *)function("fmi3FreeInstance"))(instance);
    return other;
}

int main(int count, char **arguments)
{
    fmi3ValueReference references[MOST_VALUES];
    size_t n = 0;
    if (count < 6 || count > 5 + MOST_VALUES)
        return 2;
    path = arguments[1];
    const char *token = arguments[2];
    double stop = atof(arguments[3]), h = atof(arguments[4]), t = 0.0;
    for (int i = 5; i < count; i++)
        references[n++] = (fmi3ValueReference)atol(arguments[i]);
    printf("version %s\n", ((fmi3GetVersionTYPE *)function("fmi3GetVersion"))());
    fmi3Instance instance = instantiate(token);
    CALL(EnterInitializationMode, (instance, fmi3False, 0.0, 0.0, fmi3True, stop));
    CALL(ExitInitializationMode, (instance));
    settle(instance);
    for (long k = 1; (double)k * h <= stop * (1.0 + 1e-12); k++) {
        double point = (double)k * h;
        while (t < point) {
            fmi3Boolean event = fmi3False, terminate = fmi3False, early = fmi3False;
            CALL(DoStep, (instance, t, point - t, fmi3True, &event, &terminate, &early, &t));
            if (event) {
                CALL(EnterEventMode, (instance));
                print_values(instance, "event", t, references, n);
                settle(instance);
            }
        }
        t = point;
        print_values(instance, "point", t, references, n);
        if (2 * k == (long)(stop / h + 0.5))
            instance = handed_over(instance, token);
    }
    CALL(Terminate, (instance));
    ((fmi3FreeInstanceTYPE *)function("fmi3FreeInstance"))(instance);
    return 0;
}
