/* The engine: memory, the jump loop, advance, prediction, views, save and restore. */
#include "engine.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "parts.h"

/* ---- messages ---- */

bool problem(Engine *engine, Ending ending, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(engine->problem_message, sizeof engine->problem_message, format, arguments);
    va_end(arguments);
    engine->problem = ending;
    return false;
}

/* The run is over for the reason noted last. */
static bool end_run(Engine *engine)
{
    engine->status->ending = (int32_t)engine->problem;
    memcpy(engine->status->message, engine->problem_message, sizeof engine->problem_message);
    return false;
}

static size_t append_values(char *text, size_t used, size_t size, size_t n, const char *const *names,
                            const double *values)
{
    for (size_t i = 0; i < n && used + 1 < size; i++) {
        int added = snprintf(text + used, size - used, "%s%s = %.10g", used ? ", " : "", names[i], values[i]);
        used += added > 0 ? (size_t)added : 0;
    }
    return used;
}

const char *describe_state(const Engine *engine, const double *x, const double *z, char *text, size_t size)
{
    const Model *m = engine->model;
    text[0] = '\0';
    size_t used = append_values(text, 0, size, m->n_states, m->state_names, x);
    append_values(text, used, size, m->n_discrete, m->discrete_names, z);
    return text;
}

/* ---- memory ---- */

/* Hands out pieces of one allocation; without memory it only counts. */
typedef struct {
    unsigned char *memory;
    size_t used;
} Cursor;

static void *take(Cursor *cursor, size_t size)
{
    void *place = cursor->memory ? cursor->memory + cursor->used : NULL;
    cursor->used += (size + 15) / 16 * 16;
    return place;
}

static Point take_point(Cursor *cursor, const Model *m)
{
    double *values = take(cursor, (2 + m->n_states + m->n_discrete) * sizeof(double));
    if (!values)
        return (Point){NULL, NULL, NULL, NULL};
    return (Point){values, values + 1, values + 2, values + 2 + m->n_states};
}

/* Lays out the block; called once with no memory, to learn the size. */
static size_t lay_out_block(Engine *engine, unsigned char *memory)
{
    const Model *m = engine->model;
    Cursor cursor = {memory, 0};
    engine->wrapper = take(&cursor, engine->wrapper_size);
    engine->status = take(&cursor, sizeof(Status));
    engine->live = take_point(&cursor, m);
    engine->predicted = take_point(&cursor, m);
    engine->u = take(&cursor, m->n_inputs * sizeof(double));
    engine->p = take(&cursor, m->n_parameters * sizeof(double));
    engine->history = take(&cursor, m->n_jumps * sizeof(JumpHistory));
    engine->ticked = take(&cursor, m->n_clocks);
    return cursor.used;
}

static size_t lay_out_scratch(Engine *engine, unsigned char *memory)
{
    const Model *m = engine->model;
    size_t vector = m->n_states * sizeof(double), rows = m->n_margins + 1;
    Cursor cursor = {memory, 0};
    engine->arg = take(&cursor, (m->n_arg + MODEL_N_ARG) * sizeof(double *));
    engine->res = take(&cursor, (m->n_res + 2) * sizeof(double *));
    engine->iw = take(&cursor, m->n_iw * sizeof(long long));
    engine->w = take(&cursor, m->n_w * sizeof(double));
    engine->step.x1 = take(&cursor, vector);
    for (size_t s = 0; s < N_STAGES; s++) {
        engine->step.k[s] = take(&cursor, vector);
        engine->probe_k[s] = take(&cursor, vector);
    }
    for (size_t i = 0; i < 3; i++)
        engine->step.dense[i] = take(&cursor, vector);
    engine->probe_x = take(&cursor, vector);
    engine->dense_x = take(&cursor, vector);
    engine->margins = take(&cursor, rows * sizeof(double));
    engine->times = take(&cursor, m->n_times * sizeof(double));
    engine->samples = take(&cursor, (N_SAMPLES + 1) * rows * sizeof(double));
    engine->outputs = take(&cursor, m->n_outputs * sizeof(double));
    engine->is_guard = take(&cursor, rows);
    engine->reset = take_point(&cursor, m);
    engine->shown = take_point(&cursor, m);
    return cursor.used;
}

Engine *engine_create(const Model *m, size_t wrapper_size)
{
    Engine *engine = calloc(1, sizeof *engine);
    if (!engine)
        return NULL;
    engine->model = m;
    engine->wrapper_size = wrapper_size;
    engine->block_size = lay_out_block(engine, NULL);
    engine->block = calloc(1, engine->block_size);
    engine->scratch = calloc(1, lay_out_scratch(engine, NULL));
    if (!engine->block || !engine->scratch) {
        engine_free(engine);
        return NULL;
    }
    lay_out_block(engine, engine->block);
    lay_out_scratch(engine, engine->scratch);
    for (size_t j = 0; j < m->n_jumps; j++)
        if (m->jumps[j].kind == JUMP_ON_STATE)
            engine->is_guard[m->jumps[j].index] = 1;
    engine_reset(engine);
    return engine;
}

void engine_free(Engine *engine)
{
    if (!engine)
        return;
    free(engine->block);
    free(engine->scratch);
    free(engine);
}

void *engine_wrapper(Engine *engine)
{
    return engine->wrapper;
}

static void fill(double *to, const double *from, size_t n)
{
    if (n > 0)
        memcpy(to, from, n * sizeof(double));
}

void copy_point(const Engine *engine, const Point *from, const Point *to)
{
    fill(to->time, from->time, 2 + engine->model->n_states + engine->model->n_discrete);
}

void engine_reset(Engine *engine)
{
    const Model *m = engine->model;
    memset(engine->block, 0, engine->block_size);
    engine->status->relative_tolerance = RELATIVE_TOLERANCE;
    engine->status->absolute_tolerance = ABSOLUTE_TOLERANCE;
    fill(engine->live.x, m->x, m->n_states);
    fill(engine->live.z, m->z, m->n_discrete);
    fill(engine->u, m->u, m->n_inputs);
    fill(engine->p, m->p, m->n_parameters);
    engine->view = VIEW_NONE;
    problem(engine, ENDED_NOT, "%s", "");
}

size_t engine_block_size(const Engine *engine)
{
    return engine->block_size;
}

void engine_save(const Engine *engine, void *block)
{
    memcpy(block, engine->block, engine->block_size);
}

void engine_restore(Engine *engine, const void *block)
{
    memcpy(engine->block, block, engine->block_size);
    engine->view = VIEW_NONE;
}

/* ---- values ---- */

bool evaluate(Engine *engine, ModelFunction function, double t, const double *x, const double *z, double *first,
              double *second)
{
    /* The function may use the places behind its own for the functions that it calls. */
    engine->arg[0] = &t;
    engine->arg[1] = x;
    engine->arg[2] = z;
    engine->arg[3] = engine->u;
    engine->arg[4] = engine->p;
    engine->res[0] = first;
    engine->res[1] = second;
    return function(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

/* Something that the future depends on has changed. */
static void changed(Engine *engine)
{
    *engine->live.step = 0.0;
    engine->status->prediction = PREDICTION_NONE;
    engine->view = VIEW_NONE;
}

void engine_set_tolerance(Engine *engine, double relative)
{
    /* Below 1e-13 rounding would decide about steps. */
    double tolerance = fmax(fmin(relative, RELATIVE_TOLERANCE), 1e-13);
    engine->status->relative_tolerance = tolerance;
    engine->status->absolute_tolerance = ABSOLUTE_TOLERANCE * (tolerance / RELATIVE_TOLERANCE);
}

void engine_set_time(Engine *engine, double t)
{
    *engine->live.time = t;
    changed(engine);
}

double engine_time(const Engine *engine)
{
    return *engine->live.time;
}

void engine_set(Engine *engine, Bank bank, size_t index, double value)
{
    double *values = bank == BANK_STATE      ? engine->live.x
                     : bank == BANK_DISCRETE ? engine->live.z
                     : bank == BANK_INPUT    ? engine->u
                                             : engine->p;
    if (values[index] == value)
        return;
    values[index] = value;
    changed(engine);
}

Ending engine_ending(const Engine *engine)
{
    return (Ending)engine->status->ending;
}

const char *engine_message(const Engine *engine)
{
    return engine->status->message;
}

const char *engine_problem(const Engine *engine)
{
    return engine->problem_message;
}

bool engine_ticked(const Engine *engine, size_t clock)
{
    return engine->ticked[clock] != 0;
}

void engine_clear_ticks(Engine *engine)
{
    memset(engine->ticked, 0, engine->model->n_clocks);
}

size_t engine_jumps_taken(const Engine *engine)
{
    return (size_t)engine->status->jumps_taken;
}

/* ---- jumps ---- */

/* Copies the new state into the point if all of it is finite. */
static bool accept_state(Engine *engine, const char *source, const Point *point)
{
    const Model *m = engine->model;
    for (size_t i = 0; i < m->n_states + m->n_discrete; i++) {
        const char *name = i < m->n_states ? m->state_names[i] : m->discrete_names[i - m->n_states];
        if (!isfinite(engine->reset.x[i]))
            return problem(engine, ENDED_NOT_FINITE,
                           "'%s' becomes %g at t = %.17g by %s; states must be finite. Remedy: check that map and the "
                           "parameters.",
                           name, engine->reset.x[i], *point->time, source);
    }
    fill(point->x, engine->reset.x, m->n_states + m->n_discrete);
    *point->step = 0.0;
    return true;
}

static bool apply_reset(Engine *engine, size_t jump, const Point *point)
{
    const ModelJump *entry = &engine->model->jumps[jump];
    char source[MESSAGE_SIZE / 4];
    if (!evaluate(engine, entry->reset, *point->time, point->x, point->z, engine->reset.x, engine->reset.z))
        return problem(engine, ENDED_FAILED, "The jump map of '%s' could not be evaluated at t = %.17g.", entry->name,
                       *point->time);
    snprintf(source, sizeof source, "the jump map of '%s'", entry->name);
    return accept_state(engine, source, point);
}

static bool evaluate_times(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    if (m->n_times == 0)
        return true;
    if (!evaluate(engine, m->times, *point->time, point->x, point->z, engine->times, NULL))
        return problem(engine, ENDED_FAILED, "The event times of '%s' could not be evaluated at t = %.17g.", m->name,
                       *point->time);
    for (size_t j = 0; j < m->n_jumps; j++)
        if (m->jumps[j].kind == JUMP_ON_TIME && isnan(engine->times[m->jumps[j].index]))
            return problem(engine, ENDED_NOT_FINITE,
                           "The time of '%s' is not a number at t = %.17g; a time event needs a time (infinity: "
                           "never). Remedy: check its expression and the parameters.",
                           m->jumps[j].name, *point->time);
    return true;
}

static bool stuck_in_time(Engine *engine, size_t jump, double t)
{
    return problem(engine, ENDED_FAILED,
                   "The time event '%s' was taken %d times at t = %.17g s and is due again; its next time must lie "
                   "after the present one. Remedy: let its jump map move the time on by more than rounding.",
                   engine->model->jumps[jump].name, TIME_EVENT_REPEATS, t);
}

/* Takes the breakpoints of the flow that are due. */
static bool take_internal_jumps(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    for (size_t repeats = 0;; repeats++) {
        if (!evaluate_times(engine, point))
            return false;
        size_t j = 0;
        while (j < m->n_jumps && !(m->jumps[j].kind == JUMP_ON_TIME && m->jumps[j].internal &&
                                   engine->times[m->jumps[j].index] <= *point->time))
            j++;
        if (j == m->n_jumps)
            return true;
        if (repeats == TIME_EVENT_REPEATS)
            return stuck_in_time(engine, j, *point->time);
        if (!apply_reset(engine, j, point))
            return false;
    }
}

/* Whether a jump on the state may be taken where flow has priority: outside the flow set, or where
   the flow leaves it at once. */
static bool flow_is_over(Engine *engine, const Point *point, bool *over)
{
    double margin, later, soon = *point->time + event_tolerance(*point->time);
    *over = false;
    if (!engine->model->has_flow_set)
        return true;
    if (!evaluate_flow_set(engine, *point->time, point->x, point->z, &margin))
        return false;
    *over = margin < 0.0;
    if (margin != 0.0)
        return true;
    if (!step_begin(engine, point) || !step_probe(engine, point, soon) ||
        !evaluate_flow_set(engine, soon, engine->probe_x, point->z, &later))
        return false;
    *over = later < 0.0;
    return true;
}

/* The first enabled visible jump at the point, n_jumps if there is none. */
static bool first_enabled(Engine *engine, const Point *point, size_t *jump)
{
    const Model *m = engine->model;
    bool open = !m->flow_priority, asked = open;
    *jump = m->n_jumps;
    if (!evaluate_times(engine, point) || !evaluate_margins(engine, *point->time, point->x, point->z))
        return false;
    for (size_t j = 0; j < m->n_jumps; j++) {
        const ModelJump *entry = &m->jumps[j];
        bool due = entry->kind == JUMP_ON_TIME ? !entry->internal && engine->times[entry->index] <= *point->time
                                               : engine->margins[entry->index] >= 0.0;
        if (due && entry->kind == JUMP_ON_STATE && !asked) {
            if (!flow_is_over(engine, point, &open))
                return false;
            asked = true;
        }
        if (due && (entry->kind == JUMP_ON_TIME || open)) {
            *jump = j;
            return true;
        }
    }
    return true;
}

static void tick(Engine *engine, size_t jump)
{
    for (size_t c = 0; c < engine->model->n_clocks; c++)
        if (engine->model->clock_jump[c] == jump)
            engine->ticked[c] = 1;
}

/* Counts a visible jump; false if there are too many. */
static bool count_jump(Engine *engine, size_t jump)
{
    Status *status = engine->status;
    double t = *engine->live.time;
    if (status->jumps_time != t) {
        status->jumps_time = t;
        status->state_jumps_there = status->time_jumps_there = 0;
    }
    status->jumps_taken++;
    if (engine->model->jumps[jump].kind == JUMP_ON_TIME)
        return ++status->time_jumps_there <= TIME_EVENT_REPEATS || stuck_in_time(engine, jump, t);
    status->state_jumps_there++;
    return zeno_record(engine, jump);
}

static bool take_jump(Engine *engine, size_t jump)
{
    changed(engine);
    if (!apply_reset(engine, jump, &engine->live) || !take_internal_jumps(engine, &engine->live))
        return end_run(engine);
    tick(engine, jump);
    return count_jump(engine, jump) || end_run(engine);
}

bool engine_start(Engine *engine)
{
    changed(engine);
    if (!evaluate(engine, engine->model->start, *engine->live.time, engine->live.x, engine->live.z, engine->reset.x,
                  engine->reset.z))
        return problem(engine, ENDED_FAILED, "The start values of '%s' could not be evaluated.", engine->model->name);
    return accept_state(engine, "its start value", &engine->live) && take_internal_jumps(engine, &engine->live);
}

size_t engine_pending(Engine *engine)
{
    size_t jump;
    if (engine->status->ending != ENDED_NOT || !first_enabled(engine, &engine->live, &jump))
        return engine->model->n_jumps;
    return jump;
}

bool engine_jump(Engine *engine, bool *states_changed)
{
    size_t jump, n = engine->model->n_states;
    *states_changed = false;
    if (engine->status->ending != ENDED_NOT)
        return false;
    if (!take_internal_jumps(engine, &engine->live) || !first_enabled(engine, &engine->live, &jump))
        return end_run(engine);
    if (jump == engine->model->n_jumps)
        return true;
    fill(engine->dense_x, engine->live.x, n);
    bool taken = take_jump(engine, jump);
    for (size_t i = 0; i < n; i++)
        *states_changed = *states_changed || engine->dense_x[i] != engine->live.x[i];
    return taken;
}

bool engine_jump_all(Engine *engine)
{
    while (engine->status->ending == ENDED_NOT) {
        size_t jump;
        if (!first_enabled(engine, &engine->live, &jump))
            return end_run(engine);
        if (jump == engine->model->n_jumps)
            return true;
        take_jump(engine, jump);
    }
    return false;
}

/* ---- flow ---- */

/* The next time event after the point; visible ones only if asked for. */
static double next_time(Engine *engine, const Point *point, bool visible, bool internal)
{
    const Model *m = engine->model;
    double next = INFINITY;
    for (size_t j = 0; j < m->n_jumps; j++) {
        const ModelJump *entry = &m->jumps[j];
        if (entry->kind == JUMP_ON_TIME && (entry->internal ? internal : visible) &&
            engine->times[entry->index] > *point->time)
            next = fmin(next, engine->times[entry->index]);
    }
    return next;
}

/* Flows to `limit` or to the end of a piece without time events, or to the first guard crossing on it.
   Guards that are simultaneous with one before the limit may put the event beyond it, within the
   event tolerance, but never beyond the piece. */
static FlowEnd flow_piece(Engine *engine, const Point *point, double limit, double piece_end, bool locate,
                          size_t *budget)
{
    double end = fmin(limit, piece_end);
    double level = 0.0;
    if (!step_begin(engine, point) || (locate && !flow_may_begin(engine, point, &level)))
        return FLOW_PROBLEM;
    while (*point->time < end) {
        if (*budget == 0)
            return FLOW_BUDGET;
        --*budget;
        if (!step_accept(engine, point, end))
            return FLOW_PROBLEM;
        if (locate) {
            FlowEnd found = locate_event(engine, point, level, piece_end);
            if (found != FLOW_REACHED)
                return found;
        }
        step_commit(engine, point);
    }
    return FLOW_REACHED;
}

/* Flows to `limit` through the breakpoints on the way; with `locate` it stops at the first visible event. */
static FlowEnd flow(Engine *engine, const Point *point, double limit, bool locate, size_t *budget)
{
    for (;;) {
        size_t jump = engine->model->n_jumps;
        if (!take_internal_jumps(engine, point) || (locate && !first_enabled(engine, point, &jump)))
            return FLOW_PROBLEM;
        if (jump < engine->model->n_jumps)
            return FLOW_EVENT;
        if (*point->time >= limit)
            return FLOW_REACHED;
        double piece_end = next_time(engine, point, locate, true);
        FlowEnd result = flow_piece(engine, point, limit, piece_end, locate, budget);
        if (result != FLOW_REACHED)
            return result;
    }
}

static bool too_many_steps(Engine *engine)
{
    return problem(engine, ENDED_FAILED,
                   "More than %d solver steps in one advance; at t = %.17g s the flow of '%s' is too fast for it. "
                   "Remedy: use shorter communication steps, or look for a stiff or oscillating state.",
                   ADVANCE_STEPS, *engine->live.time, engine->model->name);
}

/* ---- prediction ---- */

bool engine_predict(Engine *engine, double limit, double *event_time)
{
    Status *status = engine->status;
    double now = *engine->live.time, horizon = now + LOOK_AHEAD_TIME * fmax(1.0, fabs(now));
    size_t budget = LOOK_AHEAD_STEPS;
    status->prediction = PREDICTION_NONE;
    if (status->ending != ENDED_NOT)
        return false;
    copy_point(engine, &engine->live, &engine->predicted);
    FlowEnd end = flow(engine, &engine->predicted, fmin(limit, horizon), true, &budget);
    bool renew = end == FLOW_BUDGET || (end == FLOW_REACHED && limit > horizon);
    /* A problem ahead is reported when its time is reached; it may never be, if an input changes. */
    status->prediction = end == FLOW_EVENT ? PREDICTION_EVENT : renew ? PREDICTION_RENEWAL : PREDICTION_QUIET;
    *event_time = *engine->predicted.time;
    return status->prediction != PREDICTION_QUIET;
}

bool engine_next_time_event(Engine *engine, double *event_time)
{
    if (engine->status->ending != ENDED_NOT || !evaluate_times(engine, &engine->live))
        return false;
    *event_time = next_time(engine, &engine->live, true, false);
    return isfinite(*event_time);
}

/* The target lies a rounding or less than the tolerance behind the event: go there if the event is
   still due then; otherwise the point stays at the event. */
static void flow_past_event(Engine *engine, double target)
{
    size_t before, after, budget = LOOK_AHEAD_STEPS;
    copy_point(engine, &engine->live, &engine->shown);
    engine->view = VIEW_NONE;
    if (first_enabled(engine, &engine->live, &before) &&
        flow(engine, &engine->shown, target, false, &budget) == FLOW_REACHED &&
        first_enabled(engine, &engine->shown, &after) && before == after)
        copy_point(engine, &engine->shown, &engine->live);
}

typedef enum { ON_THE_WAY, AT_PREDICTED_EVENT, NOT_PREDICTED } Progress;

/* Uses the prediction, if there is one, as far as it carries. */
static Progress follow_prediction(Engine *engine, double target, size_t *budget, FlowEnd *end)
{
    double event = *engine->predicted.time;
    Prediction prediction = (Prediction)engine->status->prediction;
    bool quiet = prediction == PREDICTION_QUIET;
    if (prediction == PREDICTION_NONE)
        return NOT_PREDICTED;
    if (quiet ? target <= event : target < event - 4.0 * time_ulp(event)) {
        *end = flow(engine, &engine->live, target, false, budget);
        return ON_THE_WAY;
    }
    engine->status->prediction = PREDICTION_NONE;
    if (quiet)
        return NOT_PREDICTED;
    copy_point(engine, &engine->predicted, &engine->live);
    return AT_PREDICTED_EVENT;
}

/* ---- advance ---- */

static Advance advance_locating(Engine *engine, double target, EventPolicy policy, size_t *budget)
{
    for (;;) {
        FlowEnd end = flow(engine, &engine->live, target, true, budget);
        bool at_target = *engine->live.time >= target;
        if (end == FLOW_REACHED)
            return ADVANCE_REACHED;
        if (end == FLOW_BUDGET)
            too_many_steps(engine);
        if (end != FLOW_EVENT) {
            end_run(engine);
            return ADVANCE_ENDED;
        }
        if (policy == EVENTS_STOP || (policy == EVENTS_INSIDE_BEFORE_END && at_target))
            return at_target ? ADVANCE_EVENT_AT_TARGET : ADVANCE_EVENT_BEFORE;
        /* Every round costs budget, so that jumps without progress end as well. */
        *budget -= *budget > 0;
        if (!engine_jump_all(engine))
            return ADVANCE_ENDED;
    }
}

Advance engine_advance(Engine *engine, double target, EventPolicy policy)
{
    size_t budget = ADVANCE_STEPS;
    FlowEnd end = FLOW_REACHED;
    if (engine->status->ending != ENDED_NOT)
        return ADVANCE_ENDED;
    engine->status->jumps_taken = 0;
    engine_clear_ticks(engine);
    engine->view = VIEW_NONE;
    Progress progress = follow_prediction(engine, target, &budget, &end);
    if (progress == ON_THE_WAY && end == FLOW_REACHED)
        return ADVANCE_REACHED;
    if (progress == ON_THE_WAY) {
        if (end == FLOW_BUDGET)
            too_many_steps(engine);
        end_run(engine);
        return ADVANCE_ENDED;
    }
    if (progress == AT_PREDICTED_EVENT && policy != EVENTS_INSIDE) {
        double event = *engine->live.time;
        bool at_target = target <= event + event_tolerance(event);
        if (at_target && target > event)
            flow_past_event(engine, target);
        if (at_target)
            return ADVANCE_EVENT_AT_TARGET;
        if (policy == EVENTS_STOP)
            return ADVANCE_EVENT_BEFORE;
    }
    return advance_locating(engine, target, policy, &budget);
}

/* ---- views ---- */

static bool show(Engine *engine, View view)
{
    const Point *shown = &engine->shown;
    size_t jump;
    copy_point(engine, &engine->live, shown);
    if (view == VIEW_START) {
        if (!evaluate(engine, engine->model->start, *shown->time, shown->x, shown->z, engine->reset.x,
                      engine->reset.z))
            return problem(engine, ENDED_FAILED, "The start values of '%s' could not be evaluated.",
                           engine->model->name);
        return accept_state(engine, "its start value", shown);
    }
    if (view == VIEW_PENDING && engine->status->ending == ENDED_NOT) {
        if (!first_enabled(engine, shown, &jump))
            return false;
        if (jump < engine->model->n_jumps)
            return apply_reset(engine, jump, shown) && take_internal_jumps(engine, shown);
    }
    return true;
}

const double *engine_values(Engine *engine, View view, Bank bank)
{
    const Point *shown = &engine->shown;
    if (bank == BANK_INPUT)
        return engine->u;
    if (bank == BANK_PARAMETER)
        return engine->p;
    if (engine->view != view) {
        engine->view = VIEW_NONE;
        engine->has_outputs = false;
        if (!show(engine, view))
            return NULL;
        engine->view = view;
    }
    if (bank == BANK_STATE)
        return shown->x;
    if (bank == BANK_DISCRETE)
        return shown->z;
    if (!engine->has_outputs) {
        if (!evaluate(engine, engine->model->outputs, *shown->time, shown->x, shown->z, engine->outputs, NULL)) {
            problem(engine, ENDED_FAILED, "The outputs of '%s' could not be evaluated at t = %.17g.",
                    engine->model->name, *shown->time);
            return NULL;
        }
        engine->has_outputs = true;
    }
    return engine->outputs;
}
