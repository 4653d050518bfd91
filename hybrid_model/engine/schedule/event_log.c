/* What has happened in a network: columns of times, parts, jumps and what is sent. */
#include <math.h>
#include <stdlib.h>

#include "schedule.h"

#define FIRST_EVENTS 1024

/* A column with room for so many rows; NULL without memory, and the old one is still there. */
static bool widen(void **column, size_t rows, size_t size)
{
    void *wider = realloc(*column, rows * size + 1);
    if (wider)
        *column = wider;
    return wider != NULL;
}

static bool grow(EventLog *log)
{
    size_t capacity = log->capacity > 0 ? 2 * log->capacity : FIRST_EVENTS;
    if (!widen((void **)&log->times, capacity, sizeof(double)) ||
        !widen((void **)&log->parts, capacity, sizeof(uint32_t)) ||
        !widen((void **)&log->jumps, capacity, sizeof(uint32_t)) ||
        !widen((void **)&log->values, capacity, log->width * sizeof(double)))
        return false;
    log->capacity = capacity;
    return true;
}

bool log_event(EventLog *log, double t, uint32_t part, uint32_t jump, const double *signals, size_t n_signals)
{
    if (log->count == log->capacity && !grow(log))
        return false;
    size_t row = log->count++;
    log->times[row] = t;
    log->parts[row] = part;
    log->jumps[row] = jump;
    for (size_t i = 0; i < log->width; i++)
        log->values[row * log->width + i] = i < n_signals ? signals[i] : NAN;
    return true;
}

void log_free(EventLog *log)
{
    free(log->times);
    free(log->parts);
    free(log->jumps);
    free(log->values);
}
