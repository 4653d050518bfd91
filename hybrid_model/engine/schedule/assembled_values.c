/* A network behind the calls of an engine: what it shows and is given. */
#include "assembled.h"

#include <math.h>

/* The part that has an element of a bank of the whole, and where the part has it. */
static uint32_t owner(const Assembly *of, Bank bank, size_t index, size_t *own)
{
    size_t low = 0, high = of->n_parts;
#define FIRST(i)                                                                                                       \
    (bank == BANK_DISCRETE ? of->places[i].z : bank == BANK_PARAMETER ? of->places[i].p                                \
     : bank == BANK_OUTPUT ? of->places[i].y : of->places[i].x)
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (FIRST(middle) <= index)
            low = middle;
        else
            high = middle;
    }
    *own = index - FIRST(low);
    return (uint32_t)low;
}

static void set(Assembled *assembled, uint32_t part, Bank bank, size_t index, double value)
{
    Schedule *schedule = assembled->schedule;
    if (!assembled_bring(assembled, part)) {
        assembled_over(assembled);
        return;
    }
    engine_set(schedule_at(schedule, part), bank, index, value);
    schedule_touch(schedule, part);
}

void assembled_set(Assembled *assembled, Bank bank, size_t index, double value)
{
    const Assembly *of = assembled->of;
    Engine *whole = assembled->whole;
    double *known = bank == BANK_INPUT ? whole->u : whole->p;
    size_t own;
    if (known[index] == value || whole->status->ending != ENDED_NOT)
        return;
    known[index] = value;
    assembled->mirrored = false;
    if (bank == BANK_PARAMETER) {
        uint32_t part = owner(of, bank, index, &own);
        set(assembled, part, bank, own, value);
        return;
    }
    for (uint64_t k = of->first_heard[index]; k < of->first_heard[index + 1]; k++)
        set(assembled, of->heard[k].part, bank, of->heard[k].input, value);
}

const double *assembled_values(Assembled *assembled, View view, Bank bank, size_t index)
{
    Schedule *schedule = assembled->schedule;
    Engine *whole = assembled->whole;
    size_t own;
    if (bank == BANK_INPUT || bank == BANK_PARAMETER)
        return (bank == BANK_INPUT ? whole->u : whole->p) + index;
    uint32_t part = owner(assembled->of, bank, index, &own), next = NOBODY;
    if (view == VIEW_PENDING && (schedule->pending.count > 0 || schedule->n_touched > 0) &&
        !assembled_settle(assembled, &next))
        view = VIEW_LIVE;
    if (next == NOBODY || (part != next && (bank == BANK_STATE || bank == BANK_DISCRETE)))
        view = VIEW_LIVE;
    else if (part != next) {
        /* What others compute from the jump that comes next. */
        const double *values = assembled_whole(assembled) ? engine_values(whole, view, bank) : NULL;
        return values ? values + index : NULL;
    }
    if (!assembled_bring(assembled, part)) {
        assembled_over(assembled);
        return NULL;
    }
    Engine *engine = schedule_at(schedule, part);
    const double *values = engine_values(engine, view, bank);
    if (!values)
        engine_fail(whole, ENDED_FAILED, "%s", engine_problem(engine));
    return values ? values + own : NULL;
}

Engine *assembled_whole(Assembled *assembled)
{
    const Assembly *of = assembled->of;
    Engine *whole = assembled->whole;
    const Model *m = whole->model;
    if (assembled->mirrored)
        return whole;
    engine_set_time(whole, assembled->schedule->t);
    for (uint32_t i = 0; i < of->n_parts; i++) {
        const Places *at = &of->places[i];
        Engine *engine = schedule_at(assembled->schedule, i);
        const Model *part = engine->model;
        if (!assembled_bring(assembled, i)) {
            assembled_over(assembled);
            return NULL;
        }
        engine_catch_up(engine);
        engine_copy(whole->live.x + at->x, engine->live.x, part->n_states);
        engine_copy(whole->live.z + at->z, engine->live.z, part->n_discrete);
        engine_copy(whole->live.size + at->x, engine->live.size, part->n_states);
        engine_copy(whole->live.level + at->margin, engine->live.level, part->n_margins);
        double *level = &whole->live.level[m->n_margins];
        *level = fmax(*level, engine->live.level[part->n_margins]);
    }
    assembled->mirrored = true;
    return whole;
}
