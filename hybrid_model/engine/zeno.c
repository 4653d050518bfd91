/* The Zeno guard: what is counted for each jump, and when a run stops.  Each jump is counted by itself: many parts of
   a model that jump together are not yet an accumulation.  It decides as hybrid_model/reference/zeno.py does.

   (a) more jumps at one instant than any cascade needs; and of jumps on the state (b) gaps that shrink like a geometric
   sequence whose rest is small beside them: the jumps accumulate; (c) a burst of jumps that is
   small beside the longest gap since the last pause, or that floating point does not resolve. */
#include <math.h>
#include <stdio.h>

#include "parts.h"

static double last_gap(const JumpHistory *history)
{
    return history->times[N_ZENO_TIMES - 1] - history->times[N_ZENO_TIMES - 2];
}

/* Keeps the longest gap, and the first one of those that shrink. */
static void measure(const ModelScales *scales, JumpHistory *history, double t)
{
    double gap = t - history->times[N_ZENO_TIMES - 1];
    double before = history->stored > 1 ? last_gap(history) : 0.0;
    bool after_pause = gap < scales->pause * before;
    history->longest = after_pause ? gap : fmax(history->longest, gap);
    if (after_pause || !(gap < before))
        history->shrinking_from = gap;
}

static void remember(const Engine *engine, JumpHistory *history, double t)
{
    history->total++;
    history->at_once++;
    if (history->stored > 0 && history->times[N_ZENO_TIMES - 1] == t)
        return;
    history->at_once = 1;
    if (history->stored > 0)
        measure(&engine->model->scales, history, t);
    for (size_t i = 0; i + 1 < N_ZENO_TIMES; i++)
        history->times[i] = history->times[i + 1];
    history->times[N_ZENO_TIMES - 1] = t;
    if (history->stored < N_ZENO_TIMES)
        history->stored++;
    if (history->burst == 0 || (double)history->burst >= engine->options.jumps_in_window) {
        history->burst_start = t;
        history->burst = 0;
    }
    history->burst++;
}

/* Whether a burst is full, and an accumulation. */
static bool crowded(const Engine *engine, const JumpHistory *history, double t)
{
    const ModelScales *scales = &engine->model->scales;
    const EngineOptions *options = &engine->options;
    double span = t - history->burst_start;
    double least = options->jumps_in_window * scales->chatter * engine_time_ulp(t);
    double window = options->window >= 0.0 ? options->window : fmax(scales->crowd * history->longest, least);
    return (double)history->burst >= options->jumps_in_window && span <= window;
}

/* Whether the newest gaps shrink geometrically: the last gap, and the last ratio. */
static bool shrinking(double spread, const JumpHistory *history, double *gap, double *ratio)
{
    if (history->stored < N_GAPS + 1)
        return false;
    const double *times = history->times + (N_ZENO_TIMES - N_GAPS - 1);
    double least = INFINITY, greatest = 0.0;
    for (size_t i = 0; i + 1 < N_GAPS; i++) {
        *gap = times[i + 2] - times[i + 1];
        *ratio = *gap / (times[i + 1] - times[i]);
        least = fmin(least, *ratio);
        greatest = fmax(greatest, *ratio);
    }
    return greatest < 1.0 && greatest - least <= spread * *ratio;
}

void engine_note_jump(Engine *engine, size_t jump)
{
    Status *status = engine->status;
    if (status->recent_time != *engine->live.time)
        status->n_recent = 0;
    status->recent_time = *engine->live.time;
    status->recent[status->n_recent++ % N_RECENT] = (uint32_t)jump;
}

/* The jump that was taken `back` jumps before the last one at this instant. */
static size_t recent(const Status *status, uint64_t back)
{
    return status->recent[(status->n_recent - 1 - back) % N_RECENT];
}

/* Whether a jump before the one `back` jumps before the last was another one than those after it, and than `jump`. */
static bool is_new(const Status *status, uint64_t back, size_t jump)
{
    bool found = recent(status, back) != jump;
    for (uint64_t later = 0; later < back; later++)
        found = found && recent(status, later) != recent(status, back);
    return found;
}

/* The other jumps that were taken last at this instant, in the order in which they follow `jump`: "'b', 'c'"; how many
   they are. */
static size_t in_turn_with(const Engine *engine, size_t jump, char *text, size_t size)
{
    const Status *status = engine->status;
    uint64_t kept = (uint64_t)fmin(fmin((double)status->n_recent, N_RECENT), engine->options.jumps_at_once + 1.0);
    size_t count = 0, used = 0;
    text[0] = '\0';
    for (uint64_t back = kept; back-- > 0;) {
        if (!is_new(status, back, jump))
            continue;
        const char *name = NAME_AT(engine->model->names, engine->model->jumps[recent(status, back)].name);
        int added = used < size ? snprintf(text + used, size - used, "%s'%s'", count++ ? ", " : "", name) : 0;
        used += added > 0 ? (size_t)added : 0;
    }
    engine_end_text(text);
    return count;
}

bool engine_too_many_at_once(Engine *engine, size_t jump, unsigned long long count, double t)
{
    const ModelJump *entry = &engine->model->jumps[jump];
    const char *name = NAME_AT(engine->model->names, entry->name);
    char others[NAME_SIZE];
    if (engine->status->recent_time == t && in_turn_with(engine, jump, others, sizeof others) > 0)
        return engine_fail(engine, ENDED_ZENO,
                           "Zeno: %llu jumps of '%s' at one instant, t = %.9g s, in turn with %s: they enable each "
                           "other. Make the jump map of one of them leave the jump sets of the others (a "
                           "margin of zero is inside), or move its time on past the present.",
                           count, name, t, others);
    if (entry->kind == JUMP_ON_TIME)
        return engine_fail(
            engine, ENDED_ZENO,
            "Zeno: %llu jumps of '%s' at one instant, t = %.9g s: its time is still not after the present. "
            "Let the jump map move the time on past it; where a run starts later than its clock, "
            "declare the clock's state with computed=True and let start_map give the next time to come.",
            count, name, t);
    return engine_fail(engine, ENDED_ZENO,
                       "Zeno: %llu jumps of '%s' at one instant, t = %.9g s: after the jump the state is still in the "
                       "jump set, or what other parts send at that instant brings it back. Make the jump map leave "
                       "the jump set, or let the margin be negative there (a threshold that is zero together with its "
                       "error fires for ever; so does a set given as 0 outside and 1 inside, because zero is inside).",
                       count, name, t);
}

bool engine_zeno_record(Engine *engine, size_t jump)
{
    const ModelScales *scales = &engine->model->scales;
    const EngineOptions *options = &engine->options;
    JumpHistory *history = &engine->history[jump];
    ModelName name = engine->model->jumps[jump].name;
    double t = *engine->live.time, gap = 0.0, ratio = 0.0;
    remember(engine, history, t);
    unsigned long long total = history->total, burst = history->burst;
    if ((double)history->at_once > options->jumps_at_once)
        return engine_too_many_at_once(engine, jump, history->at_once, t);
    /* Times that are known are the author's own. */
    if (engine->model->jumps[jump].kind == JUMP_ON_TIME)
        return true;
    if (shrinking(options->spread, history, &gap, &ratio)) {
        double rest = gap * ratio / (1.0 - ratio), remainder = options->remainder;
        remainder = remainder >= 0.0 ? remainder : scales->accumulation * history->shrinking_from;
        if (rest <= fmax(remainder, scales->resolved * engine_time_ulp(t)))
            return engine_fail(
                engine, ENDED_ZENO,
                "Zeno: %llu jumps of '%s' accumulate at t = %.12g s (the last gap was %.2g s, each %.3f times the "
                "one before). End the run before that time, or give the jump set a minimum dwell time.",
                total, NAME_AT(engine->model->names, name), t + rest, gap, ratio);
    }
    if (crowded(engine, history, t))
        return engine_fail(
            engine, ENDED_ZENO,
            "Zeno: %llu jumps of '%s' in %.2g s around t = %.12g s: jumps accumulate there. End the run before, or "
            "give the jump set a minimum dwell time.",
            burst, NAME_AT(engine->model->names, name), t - history->burst_start, t);
    return true;
}
