/* A network behind the calls of an engine: what it shows and is given. */
#include "assembled.h"

#include <math.h>

/* The part that has an element of a bank of the whole, and where the part has it. */
static uint32_t owner(const Assembly *of, Bank bank, size_t index, size_t *own)
{
    size_t low = 0, high = of->n_parts;
#define FIRST(i)                                                                                                       \
    (bank == BANK_DISCRETE ? of->places[i].z : bank == BANK_PARAMETER ? of->places[i].p                                \
     : bank == BANK_OUTPUT    ? of->places[i].y                                                                        \
     : bank == BANK_INDICATOR ? of->places[i].margin                                                                   \
                              : of->places[i].x)
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
    if (!schedule_receive(assembled->schedule, part, bank, index, value))
        assembled_over(assembled);
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

void assembled_follow(Assembled *assembled)
{
    uint32_t next;
    assembled_settle(assembled, &next);
}

const double *assembled_values(Assembled *assembled, View view, Bank bank, size_t index)
{
    Schedule *schedule = assembled->schedule;
    Engine *whole = assembled->whole;
    size_t own;
    if (bank == BANK_INPUT || bank == BANK_PARAMETER)
        return (bank == BANK_INPUT ? whole->u : whole->p) + index;
    uint32_t part = owner(assembled->of, bank, index, &own);
    /* After the end of a run nothing comes next. */
    bool pends = view == VIEW_PENDING && schedule->pending.count > 0 && whole->status->ending == ENDED_NOT;
    uint32_t next = pends ? schedule->pending.parts[0] : NOBODY;
    bool computed = bank != BANK_STATE && bank != BANK_DISCRETE;
    /* The margin of the flow set, which lies behind those of the jump sets, is of all parts. */
    bool of_all = bank == BANK_INDICATOR && index >= whole->model->n_margins;
    if (of_all || (next != NOBODY && computed)) {
        /* What is computed from the jump that comes next, and from what it sends. */
        const double *values = engine_values(assembled_whole(assembled), view, bank);
        return values ? values + index : NULL;
    }
    if (part != next)
        view = VIEW_LIVE;
    Engine *engine = schedule_peek(schedule, part, schedule->t);
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
        Engine *engine = schedule_peek(assembled->schedule, i, assembled->schedule->t);
        const Model *part = engine->model;
        engine_catch_up(engine);
        engine_copy(whole->live.x + at->x, engine->live.x, part->n_states);
        engine_copy(whole->live.z + at->z, engine->live.z, part->n_discrete);
        engine_copy(whole->live.size + at->x, engine->live.size, part->n_states);
        engine_copy(whole->live.level + at->margin, engine->live.level, part->n_margins);
        double *level = &whole->live.level[m->n_margins];
        *level = fmax(*level, engine->live.level[part->n_margins]);
    }
    assembled->filled = assembled->mirrored = true;
    return whole;
}
