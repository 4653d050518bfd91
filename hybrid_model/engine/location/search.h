/* What locating an event on the present step needs to know: shared by samples.c, rises.c, crossings.c and locate.c,
   each of which calls those before it only. */
#ifndef HYBRID_SEARCH_H
#define HYBRID_SEARCH_H

#include "parts.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

#define DEGREE (N_SAMPLES - 1)
/* How often one row is split in one step: a simple crossing needs none, a kink a few. */
#define SPLITS 60

/* Rows are the jumps' margins, then the exit from the flow set. */
typedef struct {
    Engine *engine;
    const Point *point;
    double level;             /* the margin of the flow set that is to be kept */
    double piece_end;         /* the flow may be probed up to here */
    double begin, end;        /* the window of the step whose samples are there */
    size_t n_rows, exit_row;
    bool failed;
    bool unsettled;           /* some row was split as often as may be, and is decided by its samples */
} Search;

typedef enum { ON_INTERPOLATION, ON_STEP } Path;

typedef struct {
    double a, value_a;        /* negative */
    double b, value_b;        /* zero or above */
} Bracket;

/* The rises of a row through a threshold along the interpolation, in the order of time.  The pieces
   still to be looked at lie end to end, so their ends are all there is to keep of them. */
typedef struct {
    Search *search;
    size_t row;
    double threshold;
    bool sampled;             /* the samples are those of the whole window */
    double begin, value;      /* the start of the next piece, and the row there less the threshold */
    double ends[SPLITS + 1];
    size_t n_ends;
    int splits;
} Rises;

/* samples.c */
/* Fills `rows` with the margins at a time of the step; a failure is noted in the search and ends every
   loop on it. */
bool engine_look(Search *search, Path path, double t, double *rows);
/* The same where the run need not come: a failure only says that nothing is known. */
bool engine_try_to_look(Search *search, Path path, double t, double *rows);
/* The same at the times of the samples of a window, one row of margins after the other. */
bool engine_look_at_samples(Search *search, const double *times, double *rows);
/* The value of one row. */
double engine_look_at(Search *search, Path path, double t, size_t row);
/* The value of one row in a sample of the window. */
static inline double engine_sample(const Search *search, size_t i, size_t row)
{
    return search->engine->samples[i * search->n_rows + row];
}

/* rises.c */
/* Chebyshev-Lobatto points on [0, 1]. */
extern const double engine_points[N_SAMPLES];
/* The time of a sample of the piece from a to b. */
static inline double engine_sample_time(double a, double b, size_t i)
{
    return i + 1 == N_SAMPLES ? b : a + (b - a) * engine_points[i];
}
/* Begins at the start of the window, whose samples must be there. */
void engine_begin_rises(Rises *rises, Search *search, size_t row, double threshold);
/* Begins at the start of the step, and ends with the window. */
void engine_begin_rises_of_step(Rises *rises, Search *search, size_t row, double threshold);
/* The next bracket among the pieces that begin up to `latest`; false if there is none, or on failure. */
bool engine_next_rise(Rises *rises, double latest, Bracket *bracket);

/* crossings.c */
/* Shrinks a bracket on the solver's step to the width at which a crossing is located. */
void engine_refine_bracket(Search *search, Path path, double wide, size_t row, Bracket *bracket);
/* The first guard crossing in the window; with flow priority guards are not looked at inside the flow set. */
bool engine_first_guard(Search *search, double *t);
/* The last time before `t` at which the flow set's margin falls below zero: minus infinity if the interpolation has
   none, not a number if the step has none. */
double engine_last_inside(Search *search, double t);
/* The time at which the flow set is left, if the window leaves it by more than the tolerance. */
bool engine_first_exit(Search *search, double latest, double *t);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
