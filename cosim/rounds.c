/* One round of calls to several FMUs. What lies between two calls of a master in Python costs more than most FMUs' own
   work in them. Signatures are those of FMI 2.0.4, sections 2.1.7 and 4.2.1, and FMI 3.0.2, sections 2.2.6 and 4.2. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

typedef void (*Function)(void);
typedef int (*DoStep2)(void *, double, double, int);
typedef int (*DoStep3)(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int (*Get2)(void *, const uint32_t *, size_t, void *);
typedef int (*Get3)(void *, const uint32_t *, size_t, void *, size_t);

enum { WARNING = 1 };

typedef struct {
    Function function;
    void *component;
    double reached;
    int32_t major;
    int32_t status;
    bool event;
    bool terminate;
    bool early;
} StepCall;

typedef struct {
    Function function;
    void *component;
    const uint32_t *references;
    size_t count;
    void *values;
    size_t length;
    int32_t major;
    int32_t status;
} GetCall;

EXPORTED size_t step_all(StepCall *calls, size_t first, size_t count, double t, double size);
EXPORTED size_t get_all(GetCall *calls, size_t count);

/* Steps FMUs from `first` on; returns which one has something to say of its step, or `count`. */
size_t step_all(StepCall *calls, size_t first, size_t count, double t, double size)
{
    for (size_t k = first; k < count; k++) {
        StepCall *call = &calls[k];
        if (call->major == 2) {
            call->status = ((DoStep2)call->function)(call->component, t, size, 1);
            if (call->status != 0) {
                return k;
            }
            continue;
        }
        call->status = ((DoStep3)call->function)(
            call->component, t, size, true, &call->event, &call->terminate, &call->early, &call->reached);
        if (call->status > WARNING || call->event || call->terminate || call->early) {
            return k;
        }
    }
    return count;
}

/* Makes all calls; returns which one failed, or `count`. */
size_t get_all(GetCall *calls, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        GetCall *call = &calls[k];
        call->status = call->major == 2
                           ? ((Get2)call->function)(call->component, call->references, call->count, call->values)
                           : ((Get3)call->function)(
                                 call->component, call->references, call->count, call->values, call->length);
        if (call->status > WARNING) {
            return k;
        }
    }
    return count;
}
