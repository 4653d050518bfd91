/* The memory of a network: what evolves lies in one piece, which is copied to save a run. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "schedule.h"

/* The counts and times that go with that piece. */
typedef struct {
    double t, start, stop;
    uint64_t n_queued, n_pending, n_touched, running;
} Moment;

static void note_jump(void *context, double time, size_t jump)
{
    Schedule *schedule = context;
    schedule->last_jump = (uint32_t)jump;
    schedule->jumps++;
    if (schedule->hook)
        schedule->hook(schedule->hook_context, time, schedule->acting, jump);
}

/* A place in the memory, or (without memory) only its size. */
static void *take(unsigned char *memory, size_t *used, size_t count, size_t size)
{
    void *place = memory ? memory + *used : NULL;
    /* What is too large for an address fails as an allocation. */
    if (size > 0 && count > (SIZE_MAX / 2 - *used) / size)
        *used = SIZE_MAX / 2;
    else
        *used += (count * size + 15) / 16 * 16;
    return place;
}

static size_t lay_out(Schedule *schedule, unsigned char *memory)
{
    size_t used = 0, n = schedule->n_parts;
    schedule->parts = take(memory, &used, n, sizeof(Part));
    schedule->queue.times = take(memory, &used, n, sizeof(double));
    schedule->queue.parts = take(memory, &used, n, sizeof(uint32_t));
    schedule->queue.places = take(memory, &used, n, sizeof(uint32_t));
    schedule->pending.parts = take(memory, &used, n, sizeof(uint32_t));
    schedule->touched = take(memory, &used, n, sizeof(uint32_t));
    for (size_t k = 0; k < schedule->n_groups; k++) {
        Group *group = &schedule->groups[k];
        group->slab = take(memory, &used, group->count, group->block_size);
        group->sent = take(memory, &used, group->count, group->n_signals * sizeof(double));
    }
    /* What is written before it is read again is no part of a run. */
    schedule->size = used;
    for (size_t k = 0; k < schedule->n_groups; k++)
        schedule->groups[k].copy = take(memory, &used, 1, schedule->groups[k].block_size);
    return used;
}

static bool make_group(Schedule *schedule, Group *group, const Model *maps, const Signal *signals, size_t n_signals)
{
    Engine *engine = group->engine = engine_create(maps, 0);
    if (!engine)
        return false;
    if (!engine_keep_factors(engine, group->count))
        return false;
    engine_set_jump_hook(engine, note_jump, schedule);
    group->home = engine->block;
    group->block_size = engine_block_size(engine);
    group->inputs_at = (size_t)((unsigned char *)(void *)engine->u - engine->block);
    group->signals = signals;
    group->n_signals = n_signals;
    for (size_t k = 0; k < n_signals; k++)
        group->sends_outputs = group->sends_outputs || signals[k].bank == BANK_OUTPUT;
    if (n_signals > schedule->log.width)
        schedule->log.width = n_signals;
    return true;
}

static bool make_groups(Schedule *schedule, const Model *const models[], const size_t n_signals[],
                        const Signal *signals, const uint32_t groups[])
{
    schedule->groups = calloc(schedule->n_groups + 1, sizeof(Group));
    if (!schedule->groups)
        return false;
    for (size_t i = 0; i < schedule->n_parts; i++)
        schedule->groups[groups[i]].count++;
    for (size_t k = 0; k < schedule->n_groups; signals += n_signals[k], k++)
        if (!make_group(schedule, &schedule->groups[k], models[k], signals, n_signals[k]))
            return false;
    return true;
}

Schedule *schedule_create(size_t n_groups, const Model *const models[], const size_t n_signals[],
                          const Signal signals[], size_t n_parts, const uint32_t groups[])
{
    Schedule *schedule = calloc(1, sizeof *schedule);
    if (!schedule)
        return NULL;
    schedule->n_groups = n_groups;
    schedule->n_parts = n_parts;
    bool made = make_groups(schedule, models, n_signals, signals, groups);
    schedule->memory = calloc(1, made ? lay_out(schedule, NULL) + 1 : 1);
    schedule->due = malloc((n_parts + 1) * sizeof(uint32_t));
    schedule->values = malloc(schedule->log.width * sizeof(double) + 1);
    schedule->changed = malloc(schedule->log.width * sizeof(bool) + 1);
    if (!made || !schedule->memory || !schedule->due || !schedule->values || !schedule->changed) {
        schedule_free(schedule);
        return NULL;
    }
    lay_out(schedule, schedule->memory);
    for (size_t k = 0; k < n_groups; k++)
        schedule->groups[k].count = 0;
    for (size_t i = 0; i < n_parts; i++)
        schedule->parts[i] = (Part){.group = groups[i], .member = (uint32_t)schedule->groups[groups[i]].count++};
    schedule_clear(schedule);
    return schedule;
}

void schedule_free(Schedule *schedule)
{
    if (!schedule)
        return;
    for (size_t k = 0; schedule->groups && k < schedule->n_groups; k++) {
        Group *group = &schedule->groups[k];
        if (group->engine)
            engine_use_block(group->engine, group->home);
        engine_free(group->engine);
    }
    log_free(&schedule->log);
    free(schedule->groups);
    free(schedule->memory);
    free(schedule->due);
    free(schedule->values);
    free(schedule->changed);
    free(schedule);
}

void schedule_clear(Schedule *schedule)
{
    schedule->queue.count = schedule->pending.count = schedule->n_touched = 0;
    schedule->t = schedule->start = 0.0;
    schedule->stop = INFINITY;
    schedule->running = false;
    schedule->end = SCHEDULE_GOING;
    for (size_t i = 0; i < schedule->n_parts; i++) {
        Part *part = &schedule->parts[i];
        *part = (Part){.group = part->group, .member = part->member};
        schedule->queue.places[i] = NOBODY;
    }
    for (size_t k = 0; k < schedule->n_groups; k++) {
        Group *group = &schedule->groups[k];
        group->present = group->copied = NOBODY;
        /* Blocks as the engine's own is at its beginning. */
        memset(group->slab, 0, group->count * group->block_size);
        for (size_t i = 0; i < group->n_signals * group->count; i++)
            group->sent[i] = NAN;
    }
    for (uint32_t i = 0; i < schedule->n_parts; i++)
        schedule_at(schedule, i)->status->stop_time = INFINITY;
}

static size_t moment_size(void)
{
    return (sizeof(Moment) + 15) / 16 * 16;
}

size_t schedule_state_size(const Schedule *schedule)
{
    return moment_size() + schedule->size;
}

void schedule_save(Schedule *schedule, void *bytes)
{
    const Moment moment = {schedule->t, schedule->start, schedule->stop, schedule->queue.count,
                           schedule->pending.count, schedule->n_touched, schedule->running};
    schedule_let_go(schedule);
    memcpy(bytes, &moment, sizeof moment);
    memcpy((unsigned char *)bytes + moment_size(), schedule->memory, schedule->size);
}

void schedule_restore(Schedule *schedule, const void *bytes)
{
    Moment moment;
    memcpy(&moment, bytes, sizeof moment);
    memcpy(schedule->memory, (const unsigned char *)bytes + moment_size(), schedule->size);
    schedule->t = moment.t;
    schedule->start = moment.start;
    schedule->stop = moment.stop;
    schedule->queue.count = (size_t)moment.n_queued;
    schedule->pending.count = (size_t)moment.n_pending;
    schedule->n_touched = (size_t)moment.n_touched;
    schedule->running = moment.running != 0;
    schedule->end = SCHEDULE_GOING;
    for (size_t k = 0; k < schedule->n_groups; k++)
        schedule->groups[k].present = schedule->groups[k].copied = NOBODY;
}

/* Whether a list of parts holds each of them at most once, and (which flag of a part tells) those that it should. */
static bool list_is_sound(const Part *parts, size_t n_parts, const uint32_t *list, size_t count, bool pending)
{
    size_t flagged = 0;
    for (size_t i = 0; i < n_parts; i++)
        flagged += pending ? parts[i].pending : parts[i].touched;
    if (flagged != count)
        return false;
    for (size_t k = 0; k < count; k++)
        if (list[k] >= n_parts || !(pending ? parts[list[k]].pending : parts[list[k]].touched))
            return false;
    return true;
}

static bool queue_is_sound(const Queue *queue, size_t n_parts)
{
    size_t queued = 0;
    for (size_t i = 0; i < n_parts; i++) {
        uint32_t place = queue->places[i];
        if (place == NOBODY)
            continue;
        if (place >= queue->count || queue->parts[place] != i || isnan(queue->times[i]))
            return false;
        queued++;
    }
    return queued == queue->count;
}

static bool parts_are_sound(const Schedule *schedule, const Part *parts)
{
    for (size_t i = 0; i < schedule->n_parts; i++) {
        const Part *own = &schedule->parts[i], *part = &parts[i];
        const unsigned char *flags[] = {(const unsigned char *)&part->touched, (const unsigned char *)&part->pending,
                                        (const unsigned char *)&part->unsure, (const unsigned char *)&part->far,
                                        (const unsigned char *)&part->due, (const unsigned char *)&part->ends};
        if (own->group != part->group || own->member != part->member || !isfinite(part->t) ||
            !isfinite(part->t_event))
            return false;
        for (size_t k = 0; k < sizeof flags / sizeof *flags; k++)
            if (*flags[k] > 1)
                return false;
    }
    return true;
}

bool schedule_state_is_sound(const Schedule *schedule, void *bytes)
{
    unsigned char *memory = (unsigned char *)bytes + moment_size();
    size_t n = schedule->n_parts;
    Moment moment;
    memcpy(&moment, bytes, sizeof moment);
    if (!isfinite(moment.t) || !isfinite(moment.start) || isnan(moment.stop) || moment.n_queued > n ||
        moment.n_pending > n || moment.n_touched > n || moment.running > 1)
        return false;
#define SAME_PLACE(pointer) (void *)(memory + ((unsigned char *)(void *)(pointer) - schedule->memory))
    const Part *parts = SAME_PLACE(schedule->parts);
    const Queue queue = {SAME_PLACE(schedule->queue.times), SAME_PLACE(schedule->queue.parts),
                         SAME_PLACE(schedule->queue.places), (size_t)moment.n_queued};
    if (!parts_are_sound(schedule, parts) || !queue_is_sound(&queue, n) ||
        !list_is_sound(parts, n, SAME_PLACE(schedule->pending.parts), (size_t)moment.n_pending, true) ||
        !list_is_sound(parts, n, SAME_PLACE(schedule->touched), (size_t)moment.n_touched, false))
        return false;
    for (size_t k = 0; k < schedule->n_groups; k++) {
        const Group *group = &schedule->groups[k];
        for (size_t i = 0; i < group->count; i++)
            if (!engine_block_is_sound(group->engine, (unsigned char *)SAME_PLACE(group->slab) + i * group->block_size))
                return false;
    }
    return true;
}
