/* What a process that has loaded the engine as a library may call to run networks part by part: see schedule.h. */
#include <math.h>

#include "schedule.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

/* Changes with every change of what follows. */
#define PARTS_INTERFACE 4

/* Events since they were taken last, in columns. */
typedef struct {
    size_t count, width;
    const double *times;
    const uint32_t *parts, *jumps;
    const double *values;
} NetworkEvents;

/* Why a network has ended, and where: a part's number, the time in s, and the engine's `Ending` of that part (ENDED_NOT
   where the scheduler refused to go on); if that was for a value that is not finite, the input that was sent it. */
typedef struct {
    uint32_t part;
    int end, ending;
    double t;
    const char *message;
    uint32_t input;
    double value;
} NetworkEnd;

EXPORT int parts_interface(void);
EXPORT Schedule *parts_create(size_t n_groups, const Model *const models[], const size_t n_signals[],
                              const Signal signals[], size_t n_parts, const uint32_t groups[]);
EXPORT EngineOptions *parts_options(Schedule *schedule, size_t group);
EXPORT void parts_wires(Schedule *schedule, const uint64_t first[], const uint32_t signals[],
                          const uint32_t targets[], const uint32_t inputs[]);
EXPORT void parts_place(Schedule *schedule, size_t group, const double *const values[]);
EXPORT int parts_start(Schedule *schedule, double start, double stop, int computed);
EXPORT int parts_begin(Schedule *schedule);
EXPORT int parts_adopt(Schedule *schedule, uint32_t part, Engine *engine);
EXPORT void parts_log_instants(Schedule *schedule);
EXPORT void parts_require_finite(Schedule *schedule);
EXPORT int parts_advance(Schedule *schedule, double target, size_t events);
EXPORT int parts_approach(Schedule *schedule, double target, size_t events);
EXPORT int parts_next_instant(Schedule *schedule, double limit);
EXPORT int parts_handle(Schedule *schedule);
EXPORT int parts_receive(Schedule *schedule, uint32_t part, int bank, size_t index, double value);
EXPORT void parts_look_until(Schedule *schedule, uint32_t part, double time);
EXPORT const double *parts_peek(Schedule *schedule, uint32_t part, int bank);
EXPORT const char *parts_problem(Schedule *schedule, uint32_t part);
EXPORT double parts_next_event(const Schedule *schedule);
EXPORT size_t parts_steps(const Schedule *schedule);
EXPORT double parts_time(const Schedule *schedule);
EXPORT void parts_take_events(Schedule *schedule, NetworkEvents *events);
EXPORT void parts_end(Schedule *schedule, NetworkEnd *end);
EXPORT void parts_read(Schedule *schedule, size_t group, int bank, double *values);
EXPORT void parts_read_part(Schedule *schedule, uint32_t part, int bank, double *values);
EXPORT size_t parts_memory(const Schedule *schedule);
EXPORT void parts_free(Schedule *schedule);

int parts_interface(void)
{
    return PARTS_INTERFACE;
}

/* The signals stay the caller's, who keeps them as long as the network. */
Schedule *parts_create(size_t n_groups, const Model *const models[], const size_t n_signals[], const Signal signals[],
                       size_t n_parts, const uint32_t groups[])
{
    Schedule *schedule = schedule_create(n_groups, models, n_signals, signals, n_parts, groups);
    if (schedule)
        schedule->keeps = LOG_SIGNALS;
    return schedule;
}

EngineOptions *parts_options(Schedule *schedule, size_t group)
{
    return engine_options(schedule->groups[group].engine);
}

/* The arrays stay the caller's, who keeps them as long as the network. */
void parts_wires(Schedule *schedule, const uint64_t first[], const uint32_t signals[], const uint32_t targets[],
                   const uint32_t inputs[])
{
    schedule->wires = (Wires){first, signals, targets, inputs};
}

void parts_place(Schedule *schedule, size_t group, const double *const values[])
{
    schedule_place(schedule, group, values);
}

int parts_start(Schedule *schedule, double start, double stop, int computed)
{
    return schedule_start(schedule, start, stop, computed);
}

int parts_begin(Schedule *schedule)
{
    return schedule_begin(schedule);
}

/* A part goes on from where an engine of the same model is, which has begun; false if its group has another model. */
int parts_adopt(Schedule *schedule, uint32_t part, Engine *engine)
{
    Engine *own = schedule_at(schedule, part);
    if (own->model != engine->model)
        return 0;
    engine_save(engine, own->block);
    engine_use_block(own, own->block);
    schedule_touch(schedule, part);
    return 1;
}

void parts_log_instants(Schedule *schedule)
{
    schedule->keeps = LOG_INSTANTS;
    schedule->log.width = 1;
}

/* Values that are not finite are not sent: the run ends there. */
void parts_require_finite(Schedule *schedule)
{
    schedule->only_finite = true;
}

int parts_advance(Schedule *schedule, double target, size_t events)
{
    return (int)schedule_advance(schedule, target, events);
}

int parts_approach(Schedule *schedule, double target, size_t events)
{
    return (int)schedule_approach(schedule, target, events);
}

/* Goes to the next instant with events up to the limit, where they wait for parts_handle; REACHED if there is none. */
int parts_next_instant(Schedule *schedule, double limit)
{
    double instant = schedule->t;
    schedule->enough = SIZE_MAX;
    if (!schedule_next_instant(schedule, limit, &instant))
        return (int)schedule->end;
    schedule->t = instant;
    schedule_touch_due(schedule);
    return (int)(schedule->n_due > 0 ? SCHEDULE_GOING : SCHEDULE_REACHED);
}

/* What is due now, by what has come from outside too. */
int parts_handle(Schedule *schedule)
{
    return schedule_iterate(schedule, schedule->t);
}

int parts_receive(Schedule *schedule, uint32_t part, int bank, size_t index, double value)
{
    return schedule_receive(schedule, part, (Bank)bank, index, value);
}

/* A part does not look beyond a time at which it is given something; in s. */
void parts_look_until(Schedule *schedule, uint32_t part, double time)
{
    schedule_at(schedule, part)->status->stop_time = time;
}

/* The values of a bank of a part as they are now; NULL if they cannot be computed. */
const double *parts_peek(Schedule *schedule, uint32_t part, int bank)
{
    return engine_values(schedule_peek(schedule, part, schedule->t), VIEW_LIVE, (Bank)bank);
}

const char *parts_problem(Schedule *schedule, uint32_t part)
{
    return engine_problem(schedule_at(schedule, part));
}

/* In s; where a look ahead has ended it is earlier. */
double parts_next_event(const Schedule *schedule)
{
    const Queue *queue = &schedule->queue;
    return queue->count > 0 ? queue->times[queue->parts[0]] : INFINITY;
}

size_t parts_steps(const Schedule *schedule)
{
    return schedule->steps;
}

double parts_time(const Schedule *schedule)
{
    return schedule->t;
}

/* They stay as they are until the network goes on. */
void parts_take_events(Schedule *schedule, NetworkEvents *events)
{
    EventLog *log = &schedule->log;
    *events = (NetworkEvents){log->count, log->width, log->times, log->parts, log->jumps, log->values};
    log->count = 0;
}

void parts_end(Schedule *schedule, NetworkEnd *end)
{
    bool refused = schedule->end == SCHEDULE_REFUSED;
    Engine *engine = schedule_at(schedule, schedule->culprit);
    *end = (NetworkEnd){.part = schedule->culprit,
                        .end = (int)schedule->end,
                        .ending = refused ? ENDED_NOT : (int)engine->status->ending,
                        .t = engine_time(engine),
                        .message = refused ? schedule->message : engine_message(engine),
                        .input = schedule->wrong_input,
                        .value = schedule->wrong_value};
}

void parts_read_part(Schedule *schedule, uint32_t part, int bank, double *values)
{
    Engine *engine = schedule_at(schedule, part);
    const Model *m = engine->model;
    const size_t sizes[] = {m->n_states, m->n_discrete, m->n_inputs, m->n_parameters};
    engine_catch_up(engine);
    const double *banks[] = {engine->live.x, engine->live.z, engine->u, engine->p};
    engine_copy(values, banks[bank], sizes[bank]);
}

/* The values of a bank of all parts of a group, row by row in the order of the parts. */
void parts_read(Schedule *schedule, size_t group, int bank, double *values)
{
    const Model *m = schedule->groups[group].engine->model;
    const size_t sizes[] = {m->n_states, m->n_discrete, m->n_inputs, m->n_parameters};
    for (uint32_t i = 0; i < schedule->n_parts; i++)
        if (schedule->parts[i].group == group)
            parts_read_part(schedule, i, bank, values + sizes[bank] * schedule->parts[i].member);
}

/* In bytes, without the events. */
size_t parts_memory(const Schedule *schedule)
{
    return schedule->size + schedule->n_parts * sizeof(uint32_t);
}

void parts_free(Schedule *schedule)
{
    schedule_free(schedule);
}
