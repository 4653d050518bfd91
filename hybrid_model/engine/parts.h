/* What the parts of the engine share; nobody else includes this. */
#ifndef HYBRID_PARTS_H
#define HYBRID_PARTS_H

#include <stdint.h>

#include "engine.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

#define N_STAGES 16           /* most stages whose rates a method keeps */
#define N_LINES 3             /* along which rates are looked at for their rounding, */
#define ON_LINE 17            /* at so many points of each: one rounding is often the same at a few */
#define N_SAMPLES 9           /* of each margin, where a step is looked at for crossings */
#define N_GAPS 8              /* gaps of each jump that must look geometric */
#define N_ZENO_TIMES (N_GAPS + 1)
#define N_RECENT 32           /* of the last jumps at one instant, to name those that enable each other */
#define MESSAGE_SIZE 768

#define RELATIVE_TOLERANCE 1e-13  /* below, rounding would decide about steps */
#define LEAST_STEPS_AHEAD 20
/* Without a stop time a look ahead ends after so many times the present time, or what the flow shows of its own. */
#define LOOK_AHEAD_TIMES 1e6
#define LOOK_AHEAD_EVENTS 1e3
#define INSTANT_STEPS 1000
/* A step of the solver that is read within goes no further than so many steps of the importer, since its interpolation
   has the rounding of its ends; looking ahead of one pays where the target is no more than so many of them away. */
#define STEPS_AHEAD 1000.0
#define STEPS_BELOW 100.0

/* A point of the run.  time, step, x, z, level, size and progress lie one after the other in memory, so one copy
   moves them all; size holds the largest value that each continuous state has had; step is the solver's
   proposal for the next step, 0 when there is none.  level is the margin from which on each guard is
   enabled: 0, or slightly below where a flow ended so shortly
   before the crossing that it counts as reached.  Its last entry is the margin of the flow set up to
   which, under flow priority, the state is on the border: 0, or slightly above for the same reason. */
typedef struct {
    double *time;
    double *step;
    double *x;
    double *z;
    double *level;
    double *size;
    double *progress;         /* see below */
} Point;

/* What is counted to see whether a flow gets on, and what is known of its factors. */
enum {
    LOOKS_STEPS,              /* of the solver, of which the last ones are looked at */
    LOOKS_BEGIN,              /* s: from where they are counted */
    LOOKS_FOUND,              /* looks that have found a jump of the rates to which the flow leads back */
    PACE_STEPS, PACE_BEGIN,
    FACTORS_BEGIN, FACTORS_END, /* s: from where to where a series of the factors goes, see held_factors.c; */
    FACTORS_FOUND,            /* whether there is one */
    N_PROGRESS
};

/* The solver's step from x0 at t0 to x1 at t1. */
typedef struct {
    double t0, t1;
    const double *x0;
    double *x1;
    double *k[N_STAGES];
    bool has_rates[2];        /* those at t0 are in k[0], those at t1 in k[N_STAGES - 1] */
    double *vectors;          /* of the interpolation, made when first needed */
    double begin, end;        /* of the interpolation, which may reach beyond the step */
    bool is_known;            /* it was made without its rates */
    bool has_vectors;
    size_t n_terms;           /* vectors behind these are zero */
    size_t n_windows;         /* equal parts in each of which events are looked for */
} Step;

typedef struct Method Method;

/* The series of the factors on pieces of time, in rows: see held_factors.c.  Of a row: the piece, how many terms the
   series have, 0 for a row that is empty, and then what they depend on. */
enum { PIECE_BEGIN, PIECE_END, PIECE_TERMS, PIECE_KEYS };
typedef struct {
    double *rows, *values, *vectors, *zeros, *sums;
    size_t n_rows, width;     /* so many rows, a power of two */
} Factors;

/* What quadratures need beside the step: vectors at the nodes of a series, and of series. */
typedef struct {
    double *rates, *states, *series, *tails;
} Quadrature;

/* What is known of the time up to the predicted point: that an event is there, that a look ahead ended there for its
   limit of steps, that nothing happens before it, or that nothing happens on the solver's step that leads there. */
typedef enum { PREDICTION_NONE, PREDICTION_EVENT, PREDICTION_RENEWAL, PREDICTION_QUIET, PREDICTION_STEP } Prediction;

/* The times of one jump, for the Zeno guard. */
typedef struct {
    double times[N_ZENO_TIMES];   /* distinct ones, the newest last */
    double burst_start;
    double longest;               /* gap since the last pause */
    double shrinking_from;        /* the first of the gaps that shrink */
    uint64_t total;
    uint64_t stored;
    uint64_t burst;
    uint64_t at_once;
} JumpHistory;

/* The scalars that evolve. */
typedef struct {
    double floor;                 /* size that all states have at least, where they have shown none by themselves */
    double start_time, stop_time;
    double jumps_time;            /* of the last visible jump */
    double recent_time;           /* of the last jumps, breakpoints too, that were taken at one instant */
    uint64_t n_recent;            /* so many they are, of which the last ones are kept */
    uint32_t recent[N_RECENT];
    uint64_t jumps_taken;         /* in the last advance */
    double stride;                /* what a first step may take from the steps before the last jump or change, or 0 */
    /* The live point lies on a step of the solver that goes on to segment_end, and whose interpolation is as long as
       segment_span from segment_begin on; before segment_quiet nothing happens. */
    double segment_begin, segment_span, segment_end, segment_quiet;
    uint64_t segment_terms;
    int32_t has_segment;
    int32_t behind;               /* the live point's states do not belong to its time yet: see engine_catch_up */
    int32_t has_inner_rates;
    int32_t settled;              /* nothing has changed from outside since the last advance */
    int32_t prediction;
    int32_t ending;
    /* What the steps of an explicit method show of stiffness: see stiffness.c. */
    int32_t is_stiff;
    uint32_t steps_to_look, signs_of_stiffness, signs_against;
    char message[MESSAGE_SIZE];
} Status;

/* What a method for stiff flows works with: matrices by columns, n_states by n_states. */
typedef struct {
    double *jacobian;             /* d(rates)/d(states) at the start of the present step */
    double *drift;                /* d(rates)/dt there */
    bool has_jacobian;
    double *matrix;               /* factors of I/(gamma h) - jacobian */
    size_t *pivots;
    double factorized_for;        /* that h, 0 for none */
    double *stages, *probe_stages;
} Implicit;

/* Of the present step, from its first rejections on: what rounding there is in each rate, how fast the flow takes back
   what that moves (1/s), and whether no step is as exact as the states ask for; places to look at the rates. */
typedef struct {
    double *rates, *turned;
    bool decides;
    double *moved, *seen[ON_LINE], *differences[N_LINES];
} Rounding;

typedef struct {
    double *values;
    size_t width, count, capacity;
} Rows;

struct Engine {
    const Model *model;
    const Method *method;
    /* The block, and what lies in it. */
    unsigned char *block;
    size_t block_size;
    void *wrapper;
    size_t wrapper_size;
    Status *status;
    Point live, predicted;
    double *u, *p;
    JumpHistory *history;
    unsigned char *ticked;        /* by each jump */
    double *segment;              /* vectors of its interpolation */
    double *inner_rates;          /* noted for points outside the flow set */
    /* Scratch: nothing here outlives a call, except the cache of a view. */
    unsigned char *scratch;
    const double **arg;
    double **res;
    long long *iw;
    double *w;
    Step step;
    Implicit implicit;            /* without places where no method for stiff flows may be needed */
    Quadrature quadrature;
    Factors factors;
    Rounding rounding;
    double *probe_k[N_STAGES], *probe_x, *dense_x;
    double *margins, *enabled, *times, *samples, *sampled_x;
    double *times_of;             /* the discrete states and parameters that the times are those of */
    bool has_times;
    double *outputs, *rates, *indicators;   /* of the view */
    double *seeds[2];
    double *slopes;               /* rates and outputs on both sides of a point */
    double *unit;                 /* a direction */
    unsigned char *is_guard;      /* of each margin: some jump waits for it */
    size_t n_guards;              /* jumps that wait for one */
    Point reset, shown;           /* result of a reset map; what a view shows */
    View view;
    bool has_outputs, has_rates, has_indicators;
    StepHook hook;
    void *hook_context;
    JumpHook jump_hook;
    void *jump_context;
    double target;                /* of the present advance */
    bool keeps;                   /* the next step of the predicted point is kept as the segment */
    double largest;               /* state of the present step */
    EngineOptions options;
    Statistics statistics;
    RecordKind record;
    Rows rows[N_ROW_KINDS];
    Ending problem;
    size_t suspect;               /* the state that the solver blames */
    char problem_message[MESSAGE_SIZE];
};

/* Why a flow ended.  CHANGED: the hook has set an input or a nearer target.  SHORTER: it has not; its step is to be
   made again, of the length that the point has now. */
typedef enum { FLOW_REACHED, FLOW_EVENT, FLOW_SHORTER, FLOW_CHANGED, FLOW_BUDGET, FLOW_PROBLEM } FlowEnd;

/* What is called so often that calls would cost more. */

/* The larger and the smaller of two numbers; the second one where the first is not a number. */
static inline double engine_larger(double a, double b)
{
    return a > b ? a : b;
}

static inline double engine_smaller(double a, double b)
{
    return a < b ? a : b;
}

static inline void engine_copy(double *to, const double *from, size_t n)
{
    if (n > 0)
        memcpy(to, from, n * sizeof(double));
}

/* Hands a function of the model its arguments and places for its results. */
static inline void engine_bind(Engine *engine, const double *t, const double *x, const double *z, double *first,
                               double *second)
{
    /* The function may use the places behind its own for the functions that it calls. */
    engine->arg[0] = t;
    engine->arg[1] = x;
    engine->arg[2] = z;
    engine->arg[3] = engine->u;
    engine->arg[4] = engine->p;
    engine->res[0] = first;
    engine->res[1] = second;
}

/* Evaluates a function of the model at (t, x, z) with the present inputs and parameters. */
static inline bool engine_evaluate(Engine *engine, ModelFunction function, double t, const double *x, const double *z,
                                   double *first, double *second)
{
    engine_bind(engine, &t, x, z, first, second);
    return function(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

/* The files of the engine from the lowest to the highest: each calls functions of those before it only.  Those of
   engine.h are in message.c, segment.c, block.c, recorder.c, values.c, jumps.c, create.c, views.c, sensitivity.c (after
   differences.c), predict.c, outside.c and engine.c, the last ones; samples.c, rises.c and crossings.c, before
   locate.c, are in search.h; methods, before create.c, in method.h, and chebyshev.c, before those, in chebyshev.h. */

/* message.c */
/* Notes why something cannot be done; always false, so that callers can return it. */
bool engine_fail(Engine *engine, Ending ending, const char *format, ...) LIKE_PRINTF(3, 4);
/* The run is over for the reason noted last; always false. */
bool engine_end_run(Engine *engine);
/* The name of continuous state i, or from n_states on that of a discrete one. */
ModelName engine_state_name(const Model *m, size_t i);
/* The values of a state for a message: "h = 0.1, v = -4.4". */
const char *engine_describe_state(const Engine *engine, const double *x, const double *z, char *text, size_t size);

/* segment.c */
/* Moves the live point along the segment; its states follow when they are asked for. */
void engine_segment_move(Engine *engine, double t);
/* Brings the live point's states to its time: whatever uses them calls this first.  Nothing that the run depends on
   changes by it, so that a run is the same whoever looks at it. */
void engine_catch_up(Engine *engine);

/* factor_pieces.c */
/* Memory for the factors of `parts` points that take turns; false without memory. */
bool engine_keep_factors(Engine *engine, size_t parts);
void engine_free_factors(Engine *engine);
/* The point's values are about to become those of `z`. */
void engine_watch_factors(const Engine *engine, const Point *point, const double *z);
/* A value of the live point has been set. */
void engine_note_factors(const Engine *engine, Bank bank, size_t index);

/* block.c */
/* Whether the flow may turn out to be stiff in a run. */
bool engine_may_show_stiffness(const Model *model);
void engine_copy_point(const Engine *engine, const Point *from, const Point *to);
/* The number of seeds in one of the engine's two places for them. */
size_t engine_seed_count(const Model *model);
/* The block and the scratch, zeroed; the model, the method and the size of the wrapper must be there. */
bool engine_take_memory(Engine *engine);

/* values.c */
/* The rates of the states there; nothing to do without states. */
bool engine_rates(Engine *engine, double t, const double *x, const double *z, double *result);
/* The usual size of state i at a point whose value there is x. */
double engine_state_size(const Engine *engine, const Point *point, size_t i, double x);
/* The largest state that the run has shown at the point, and at x. */
double engine_largest_state(const Engine *engine, const Point *point, const double *x);
/* What rounding of its rate leaves open in state i after a step of h. */
double engine_left_by_rounding(const Engine *engine, size_t i, double h);
/* The error that is allowed in state i of that size; engine->largest must be there. */
double engine_error_scale(const Engine *engine, const Point *point, size_t i, double size);
/* The point has got where it is: its states are among those that the run has shown. */
void engine_note_sizes(const Engine *engine, const Point *point);
/* The flow begins anew at the point: with a first step, for which the steps before are a guide. */
void engine_begin_anew(const Engine *engine, const Point *point);
/* Guards are enabled from zero on. */
void engine_clear_levels(const Engine *engine, const Point *point);
/* The live point goes on by itself from where it is on a segment, if it is on one. */
void engine_leave_segment(Engine *engine);
/* Something that the future depends on has changed. */
void engine_changed(Engine *engine);

/* rounding.c */
/* Finds how much of the rates at (t, x, z), where steps are about `h` long, is rounding; false if that cannot be
   told. */
bool engine_find_rounding(Engine *engine, double t, const double *x, const double *z, double h);
/* Whether in a step of h from the point rounding leaves more open than its error may be; engine_step_begin comes
   before. */
bool engine_rounding_decides(Engine *engine, const Point *point, double h);

/* first_step.c */
/* The length of a first step from the point towards `limit`, for states as large as `size`; engine_step_begin comes
   before. */
bool engine_first_step(Engine *engine, const Point *point, double limit, double size, double *h);
/* Gives states that are far below where a flow to `limit` may lead a size of that; whether they got one.
   engine_step_begin comes before. */
bool engine_raise_floor(Engine *engine, const Point *point, double limit);

/* progress.c */
/* Whether the run gets on with the step that was accepted towards `limit`; false if it creeps or chatters. */
bool engine_gets_on(Engine *engine, const Point *point, double limit);
/* Notes that no step of h is short enough, and why; always false. */
bool engine_too_small(Engine *engine, const Point *point, double h);
/* The pace of a flow is counted from the point on. */
void engine_begin_pace(const Point *point);

/* stiffness.c */
/* Takes the method for stiff flows, or the other one, for the steps from now on. */
void engine_choose_method(Engine *engine);
/* Looks at an accepted step for what makes a flow stiff.  Where the method is about to change, and where it is one for
   stiff flows, whose steps differ by orders of magnitude, the pace so far says nothing: no flow creeps. */
void engine_watch_stiffness(Engine *engine, const Point *point);

/* integrate.c */
/* A step may begin at the point: its rates are in step->k[0], if they are not known otherwise. */
bool engine_step_begin(Engine *engine, const Point *point);
/* One accepted step from the point towards `limit`, which it never passes; the result is in engine->step. */
bool engine_step_accept(Engine *engine, const Point *point, double limit);
/* The point takes the end of the step. */
void engine_step_commit(Engine *engine, const Point *point);
/* The state at any time of the present step, as exact as its end: engine->probe_x. */
bool engine_step_probe(Engine *engine, const Point *point, double t);

/* dense.c */
/* The vectors of the interpolation of the present step. */
const double *engine_step_vectors(Engine *engine);
/* The interpolation of the present step: engine->dense_x. */
void engine_step_dense(Engine *engine, double t);
/* Keeps the present step as a segment on which the live point moves. */
void engine_segment_keep(Engine *engine);

/* recorder.c */
/* Keeps the present step up to `end`, where the states are x. */
bool engine_record_step(Engine *engine, double end, const double *x);
/* Keeps a straight way of the live point from the start of the present step to `end`, where the states are x. */
bool engine_record_line(Engine *engine, double end, const double *x);
/* Keeps the jump (n_jumps: the start) of the live point to engine->reset. */
bool engine_record_jump(Engine *engine, size_t jump);

/* sets.c */
/* How far apart (s) crossings may be at `t` and still be one instant. */
double engine_one_instant(const Engine *engine, double t);
/* Margins of the jumps at (t, x); false if one is not a number. */
bool engine_evaluate_margins(Engine *engine, double t, const double *x, const double *z);
bool engine_evaluate_flow_set(Engine *engine, double t, const double *x, const double *z, double *margin);
/* By how much the margin of the flow set may be negative at a state of the present step that counts as inside. */
double engine_flow_border(Engine *engine, const Point *point, double t, const double *x);
/* Whether the flow leads out of the flow set from the point, which is on its border; engine_step_begin comes before. */
bool engine_leads_out(Engine *engine, const Point *point, double margin, bool *out);
/* Whether the point may flow as far as the flow set says; *level is the margin to be kept. */
bool engine_flow_may_begin(Engine *engine, const Point *point, double *level);
/* Notes that the state can neither flow nor jump; always false. */
bool engine_blocked(Engine *engine, double t, const double *x, const double *z, double margin);

/* zeno.c */
/* Records a jump of the live point at its time; false if it is one too many. */
bool engine_zeno_record(Engine *engine, size_t jump);
/* Notes a jump of the live point, a breakpoint as well, to name those that enable each other. */
void engine_note_jump(Engine *engine, size_t jump);
/* Notes that a jump is taken at one instant for the `count`th time, which is once too often; always false. */
bool engine_too_many_at_once(Engine *engine, size_t jump, unsigned long long count, double t);

/* jumps.c */
/* Applies the start map to the point. */
bool engine_apply_start(Engine *engine, const Point *point);
/* Takes a jump that is due at the point, for which the event times must be there; those afterwards are there then. */
bool engine_apply_reset(Engine *engine, size_t jump, const Point *point);
bool engine_evaluate_times(Engine *engine, const Point *point);
/* Takes the breakpoints of the flow that are due and come before any visible jump; the times are there then. */
bool engine_take_internal_jumps(Engine *engine, const Point *point);
/* The first enabled visible jump at the point, whose times must be there; n_jumps if there is none. */
bool engine_first_enabled(Engine *engine, const Point *point, size_t *jump);

/* views.c */
/* Computes the state that a view shows, into engine->shown, once. */
bool engine_hold_view(Engine *engine, View view);

/* differences.c */
/* Puts difference quotients along a direction in the place of those of `rates` and `outputs` that are not numbers,
   where both sides agree on one. */
bool engine_mend_slopes(Engine *engine, double *const direction[MODEL_N_ARG], double *rates, double *outputs);
/* The same for the sensitivities in `seeds`, whose weights are there. */
bool engine_mend_sensitivities(Engine *engine, double *const seeds[N_SEEDS]);

/* locate.c */
/* Looks for the first event on the present step; FLOW_EVENT moves the point there. */
FlowEnd engine_locate_event(Engine *engine, const Point *point, double level, double piece_end);
/* Enables the guards that would cross within one instant after `t`, a time on or at the end of
   the present step, if the flow could go on: neither a breakpoint nor the end of a run may hide a
   crossing that rounding puts behind it. */
bool engine_raise_levels(Engine *engine, const Point *point, double t);
/* The same for the point itself, and for the border of the flow set under flow priority. */
bool engine_raise_levels_here(Engine *engine, const Point *point);
/* Goes straight on to a guard where the solver cannot, if it is as near as a solver comes; a flow map that is defined
   up to a guard only, as a root is, stops it some ulp before. */
bool engine_reach_guard(Engine *engine, const Point *point, double limit);

/* flow.c */
/* The next time event after the point, of those that are asked for, whose times must be there.  Times that differ by
   rounding only are one, the latest of them. */
double engine_next_time(Engine *engine, const Point *point, bool visible, bool internal);
/* Flows to `limit` through the breakpoints on the way; with `locate` it stops at the first visible event. */
FlowEnd engine_flow(Engine *engine, const Point *point, double limit, bool locate, size_t *budget);

/* predict.c */
/* Flows the live point to the target or to the first event.  What is foreseen is used, and with `ahead` the flow is
   looked at a step of the solver at a time; `foreseen` tells whether the event is one that was seen ahead. */
FlowEnd engine_flow_on(Engine *engine, EventPolicy policy, bool ahead, size_t *budget, bool *foreseen);
/* The target lies a rounding or less than an instant behind the event: go there if the event is still due then and no
   breakpoint lies between; otherwise the point stays at the event. */
void engine_flow_past_event(Engine *engine, double target);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
