/* What the files of the FMI 3.0 layer share: the instance, and how a call is refused. */
#ifndef HYBRID_FMI3_INSTANCE_H
#define HYBRID_FMI3_INSTANCE_H

#include "engine.h"
#include "fmi3Functions.h"

enum {
    MODE_INSTANTIATED = 1,
    MODE_INITIALIZATION = 2,
    MODE_EVENT = 4,
    MODE_STEP = 8,
    MODE_TERMINATED = 16,
    MODE_SETTABLE = 15,        /* anything at all can be set */
    MODE_ANY = 31
};

typedef struct {
    double time;               /* the communication point */
    double stop_time;          /* infinite if there is none */
    int32_t mode;
    int32_t end_reported;      /* fmi3DoStep has said that the run is over */
} Run;

typedef struct {
    Engine *engine;
    Run *run;
    char *name;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    bool event_mode_used, early_return_allowed;
} Instance;

#if defined(__GNUC__)
#define LIKE_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define LIKE_PRINTF(text, first)
#endif

/* Logs an error, also when logging is switched off, if there is a logger; always fmi3Error, so that
   callers can return it. */
fmi3Status refuse(const Instance *instance, const char *format, ...) LIKE_PRINTF(2, 3);
fmi3Status null_argument(const Instance *instance, const char *function);
/* The instance, if the function may be called now; NULL (and one log line) otherwise. */
Instance *enter(fmi3Instance handle, const char *function, int modes);
const char *mode_name(int mode);

#endif
