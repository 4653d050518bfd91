/* An importer of one model that both versions of the standard look alike to.

   harness.c reads calls from its input, one a line, and writes what each of them gave.  importer.c calls the
   functions of the version that it is compiled for.  The model is linked in, so that sanitizers
   and valgrind see all of it; shim.c stands between the runtime and the memory functions. */
#ifndef HARNESS_H
#define HARNESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "description.h"

/* Statuses have the same numbers in both versions.  Where a version has no such function: */
enum { NO_SUCH_FUNCTION = -1, MOST_VALUES = 4096 };

typedef struct {
    const char *kind;          /* "cs", "me", "se" */
    const char *name, *token;
    bool events, early, logging, listening;
    int update;                /* intermediate update: 0 none, 1 looks, 2 asks for an early return */
} Wish;

typedef struct {
    int status;
    bool event, terminate, early;
    double time;
} Stepped;

typedef struct {
    int status;
    bool again, terminate, changed, has_next;
    double next;
} Updated;

/* Of each version. */
void *importer_new(const Wish *wish, void *environment);
void importer_free(void *instance);
/* begin, end, configure, configured, event, step, continuous, terminate, reset; SetupExperiment belongs to begin. */
int importer_plain(void *instance, const char *what);
int importer_begin(void *instance, double start, double stop, double tolerance);
int importer_access(void *instance, bool set, Type type, const uint32_t *references, size_t n, double *values,
                    size_t n_values);
int importer_step(void *instance, double t, double h, Stepped *seen);
int importer_update(void *instance, Updated *seen);
int importer_set_time(void *instance, double t);
int importer_set_states(void *instance, const double *x, size_t n);
int importer_vector(void *instance, const char *what, double *values, size_t n);
int importer_completed(void *instance, bool *event, bool *terminate);
int importer_save(void *instance, void **state);
int importer_restore(void *instance, void *state);
int importer_drop(void *instance, void **state);
int importer_size(void *instance, void *state, size_t *size);
int importer_bytes(void *instance, void *state, unsigned char *bytes, size_t size);
int importer_parse(void *instance, const unsigned char *bytes, size_t size, void **state);
int importer_partial(void *instance, bool forward, uint32_t unknown, uint32_t known, const double *seeds,
                     size_t n_seeds, double *results, size_t n_results);
int importer_rates(void *instance, const uint32_t *references, size_t n, double *values, size_t n_values);
int importer_interval(void *instance, uint32_t clock, double *interval, int *qualifier);
int importer_debug(void *instance, bool on, size_t n, const char *const *categories);
/* Calls what there is with null pointers and zero lengths; statuses as letters, O for OK, E for Error, D else. */
void importer_nulls(void *instance, char *letters, size_t size);

/* Of harness.c: a message has come; what it is not allowed to be ends the process. */
void heard(void *environment, int status, const char *category, const char *message);
/* During a step: reads all values; true if the step is to end. */
bool looked(void *environment, double time);
void broken(const char *promise);
/* Grows an array, never by the memory functions that are watched. */
void *own_memory(size_t size);
void own_free(void *memory);

/* Of shim.c. */
void fail_after(long n);       /* the nth allocation from now on fails; 0: none does */
long living(void);             /* pieces of memory that the runtime holds, of this thread */
long allocations(void);        /* that it has asked for */

/* Of threads.c: whether instances on so many threads give what one gives. */
bool threads_agree(int n_threads, int n_steps, double h);
#endif
