/* Measures what the calls of Co-Simulation FMUs cost, in turns, so that what disturbs one disturbs all.

   step_cost [--step S] [--steps N] [--flight N] [--rounds N] [--preload LIBRARY]...
             --fmu NAME VERSION BINARY TOKEN RESOURCES REFERENCES CAPABILITIES ...

   REFERENCES are value references with commas between them; CAPABILITIES are letters: e event mode,
   s states that can be saved, - none.  A library to be preloaded is one that binaries need and do not
   name: libpython for those that embed an interpreter.

   Prints lines: "value NAME T VALUE..." of one untimed run, then "time NAME WHAT NANOSECONDS" of each
   round, "count NAME WHAT NUMBER" of the calls and events in event mode. */
#define _POSIX_C_SOURCE 200809L
#include "step_cost.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST_CONTENDERS 32
#define REPETITIONS 1000

typedef struct {
    double step;
    size_t steps, flight, rounds;       /* flight: the steps at the begin without an event */
} Plan;

AnyFunction find_function(void *library, const char *name)
{
    /* ISO C has no cast between the two kinds of pointer. */
    union { void *object; AnyFunction function; } both = {dlsym(library, name)};
    return both.function;
}

void *open_library(const Contender *contender)
{
    void *library = dlopen(contender->binary, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        fprintf(stderr, "%s: %s\n", contender->name, dlerror());
    return library;
}

bool failed(const Contender *contender, const char *what)
{
    fprintf(stderr, "%s: failed: %s\n", contender->name, what);
    return false;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void report(const Contender *contender, const char *what, double nanoseconds, size_t n)
{
    printf("time\t%s\t%s\t%.4f\n", contender->name, what, nanoseconds / (double)n);
}

static bool print_values(Contender *contender, const Plan *plan)
{
    const Interface *does = contender->interface;
    if (!does->start(contender, false))
        return false;
    for (size_t i = 0; i < plan->steps; i++) {
        if (!does->steps_and_reads(contender, i, 1, plan->step))
            return false;
        printf("value\t%s\t%.17g", contender->name, (double)(i + 1) * plan->step);
        for (size_t k = 0; k < contender->n_values; k++)
            printf("\t%.17g", contender->values[k]);
        printf("\n");
    }
    return true;
}

static bool measure_steps(Contender *contender, const Plan *plan)
{
    const Interface *does = contender->interface;
    /* Once untimed: the contender before has left the caches full of its own. */
    if (!does->start(contender, false) || !does->steps(contender, 0, plan->steps, plan->step) ||
        !does->start(contender, false))
        return false;
    double begin = now();
    if (!does->steps(contender, 0, plan->flight, plan->step))
        return false;
    double middle = now();
    if (!does->steps(contender, plan->flight, plan->steps - plan->flight, plan->step))
        return false;
    double end = now();
    report(contender, "step", end - begin, plan->steps);
    if (plan->flight > 0)
        report(contender, "flight", middle - begin, plan->flight);
    return true;
}

static bool measure_values(Contender *contender, const Plan *plan)
{
    const Interface *does = contender->interface;
    if (!does->start(contender, false))
        return false;
    double begin = now();
    if (!does->steps_and_reads(contender, 0, plan->steps, plan->step))
        return false;
    double middle = now();
    if (!does->reads(contender, REPETITIONS))
        return false;
    double end = now();
    report(contender, "step and read", middle - begin, plan->steps);
    report(contender, "read", end - middle, REPETITIONS);
    if (!contender->has_states)
        return true;
    begin = now();
    if (!does->saves(contender, REPETITIONS))
        return false;
    report(contender, "save and restore", now() - begin, REPETITIONS);
    return true;
}

static bool measure_events(Contender *contender, const Plan *plan, bool obey)
{
    const Interface *does = contender->interface;
    const char *how = obey ? "events announced" : "events by early return";
    EventRun run;
    if (!contender->has_events || !does->event_steps)
        return true;
    if (!does->start(contender, true))
        return false;
    double begin = now();
    if (!does->event_steps(contender, plan->steps, plan->step, obey, &run))
        return false;
    report(contender, how, now() - begin, plan->steps);
    printf("count\t%s\t%s\t%zu\t%zu\n", contender->name, how, run.calls, run.events);
    return true;
}

static bool measure(Contender *contender, const Plan *plan)
{
    return measure_steps(contender, plan) && measure_values(contender, plan) &&
           measure_events(contender, plan, true) && measure_events(contender, plan, false);
}

static bool read_contender(char **words, Contender *contender)
{
    *contender = (Contender){.name = words[0], .binary = words[2], .token = words[3], .resources = words[4]};
    contender->interface = strcmp(words[1], "2.0") == 0 ? &interface2 : &interface3;
    contender->has_events = strchr(words[6], 'e') != NULL;
    contender->has_states = strchr(words[6], 's') != NULL;
    for (char *rest = words[5]; *rest != '\0' && contender->n_values < MOST_VALUES; rest += *rest == ',')
        contender->references[contender->n_values++] = (uint32_t)strtoul(rest, &rest, 10);
    return contender->n_values > 0 || failed(contender, "no value reference given");
}

static bool preload(const char *library)
{
    if (dlopen(library, RTLD_NOW | RTLD_GLOBAL))
        return true;
    fprintf(stderr, "%s\n", dlerror());
    return false;
}

static bool read_plan(int argc, char **argv, Plan *plan, Contender *contenders, size_t *n)
{
    for (int i = 1; i + 1 < argc; i += 2) {
        const char *option = argv[i];
        if (strcmp(option, "--step") == 0)
            plan->step = strtod(argv[i + 1], NULL);
        else if (strcmp(option, "--steps") == 0)
            plan->steps = (size_t)strtoul(argv[i + 1], NULL, 10);
        else if (strcmp(option, "--flight") == 0)
            plan->flight = (size_t)strtoul(argv[i + 1], NULL, 10);
        else if (strcmp(option, "--rounds") == 0)
            plan->rounds = (size_t)strtoul(argv[i + 1], NULL, 10);
        else if (strcmp(option, "--preload") == 0 && preload(argv[i + 1]))
            continue;
        else if (strcmp(option, "--fmu") == 0 && i + 7 < argc && *n < MOST_CONTENDERS) {
            if (!read_contender(argv + i + 1, &contenders[(*n)++]))
                return false;
            i += 6;
        } else {
            fprintf(stderr, "step_cost: '%s' cannot be used like this.\n", option);
            return false;
        }
    }
    return *n > 0 && plan->flight <= plan->steps;
}

static int run_all(int argc, char **argv)
{
    static Contender contenders[MOST_CONTENDERS];
    Plan plan = {.step = 0.01, .steps = 200, .flight = 40, .rounds = 100};
    size_t n = 0;
    if (!read_plan(argc, argv, &plan, contenders, &n))
        return EXIT_FAILURE;
    for (size_t k = 0; k < n; k++)
        if (!contenders[k].interface->load(&contenders[k]) || !print_values(&contenders[k], &plan))
            return EXIT_FAILURE;
    for (size_t round = 0; round < plan.rounds; round++)
        for (size_t k = 0; k < n; k++)
            if (!measure(&contenders[k], &plan))
                return EXIT_FAILURE;
    for (size_t k = 0; k < n; k++)
        contenders[k].interface->unload(&contenders[k]);
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    int status = run_all(argc, argv);
    fflush(NULL);
    /* Not by exit: an embedded interpreter's handlers may wait for each other for ever. */
    _Exit(status);
}
