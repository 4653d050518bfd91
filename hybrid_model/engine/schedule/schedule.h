/* Parts that meet only at events: each is one small block, parts with the same maps share an engine, and only those
   that something happens to are touched.  The rules of one instant are those of docs/semantics.md, and of
   hybrid_model/schedule/scheduler.py, which is the same in Python. */
#ifndef HYBRID_SCHEDULE_H
#define HYBRID_SCHEDULE_H

#include "assembly.h"
#include "parts.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

#define NOBODY UINT32_MAX
/* In the place of a jump's index: what a part sends has changed by what it received, without a jump of its own. */
#define NO_JUMP UINT32_MAX
/* Event iterations of one part at one instant, and steps of it in a row that lead nowhere, at most. */
#define MOST_ITERATIONS 10000

/* Parts with the same maps. */
typedef struct {
    Engine *engine;
    unsigned char *home;          /* the engine's own block, on which no part runs */
    unsigned char *slab;          /* the blocks of the parts, one after the other */
    size_t block_size, inputs_at; /* where in a block its inputs lie */
    size_t count;
    uint32_t present;             /* the part on whose block the engine is */
    unsigned char *copy;          /* of the block of a part, */
    uint32_t copied;              /* this one, */
    double copied_to;             /* brought to that time */
    const Signal *signals;        /* the caller's */
    size_t n_signals;
    bool sends_outputs;
    double *sent;                 /* of each part: its signals as they were sent last */
} Group;

typedef struct {
    double t, t_event;            /* s: where it is, and where its last event was */
    uint64_t jumps;
    uint32_t group, member;
    uint32_t iterations, stalls;
    bool touched, pending;
    bool due;                     /* its own event has come; it has not had its turn yet */
    bool unsure;                  /* its place in the queue is where its look ahead ended, no event; */
    bool ends;                    /* it is where its run ends */
    bool far;                     /* it has looked ahead as far as it may, */
    double reach;                 /* over so many times the steps of one look ahead */
} Part;

/* Predicted events, the earliest first and those of one time in the order of parts: a binary heap that knows where in
   it each part is. */
typedef struct {
    double *times;                /* of each part that is in it */
    uint32_t *parts, *places;
    size_t count;
} Queue;

/* Parts in their order. */
typedef struct {
    uint32_t *parts;
    size_t count;
} Pending;

/* What has happened, in order: columns that grow. */
typedef struct {
    double *times;
    uint32_t *parts, *jumps;
    double *values;               /* rows of the part's signals after the event, as wide as the widest group's */
    size_t count, capacity, width;
} EventLog;

/* LOG_INSTANTS: jumps alone, with the times of their instants, which all that jump there share; in the place of signals
   whether a jump is the event that the part had come to that instant for. */
typedef enum { LOG_NOTHING, LOG_SIGNALS, LOG_INSTANTS } LogKind;

/* STIFF: a part's flow has shown that its model needs what it has not, a method for stiff flows.  NOT_FINITE: a part
   was sent a value that is not finite, where all must be. */
typedef enum {
    SCHEDULE_GOING, SCHEDULE_REACHED, SCHEDULE_ENDED, SCHEDULE_REFUSED, SCHEDULE_STIFF, SCHEDULE_NOT_FINITE
} ScheduleEnd;

/* Called with each visible jump of a part. */
typedef void (*PartHook)(void *context, double time, uint32_t part, size_t jump);

typedef struct {
    Group *groups;
    size_t n_groups;
    size_t n_parts;
    Wires wires;
    /* What evolves lies in one piece of memory without pointers: the parts, their blocks and what was sent, the queue,
       and who is pending and touched; with it the counts of those, and the times. */
    unsigned char *memory;
    size_t size;
    Part *parts;
    Queue queue;
    Pending pending;
    uint32_t *touched;
    size_t n_touched;
    double t, start, stop;        /* s: all events are handled up to t; parts look ahead to stop */
    bool running;                 /* for whoever drives it */
    uint32_t *due;
    size_t n_due;
    EventLog log;
    LogKind keeps;
    PartHook hook;
    void *hook_context;
    uint32_t acting, last_jump;   /* the part whose turn it is, and the jump that it has taken */
    bool states_changed;          /* by that jump */
    size_t jumps;                 /* taken so far, for whoever sets it back */
    double *values;               /* of the signals of one part, and which have changed */
    bool *changed;
    size_t work, enough;          /* events and looks ahead so far */
    size_t steps;                 /* of parts so far */
    size_t finished;              /* parts that have been brought to the present target */
    ScheduleEnd end;
    uint32_t culprit;             /* the part that has ended the run */
    bool only_finite;             /* whether values that are sent must be finite, */
    uint32_t wrong_input;         /* and which input of the culprit was sent this one */
    double wrong_value;
    char message[MESSAGE_SIZE];
} Schedule;

/* queue.c */
/* Puts a part in, or elsewhere. */
void queue_put(Queue *queue, uint32_t part, double time);
void queue_remove(Queue *queue, uint32_t part);
/* The same for the parts that wait for their turn at one instant. */
void pending_add(Pending *pending, uint32_t part);
uint32_t pending_take(Pending *pending);

/* event_log.c */
bool log_event(EventLog *log, double t, uint32_t part, uint32_t jump, const double *signals, size_t n_signals);
void log_free(EventLog *log);

/* parts.c: one part */
/* Puts the engine of a part's group on the block of that part. */
Engine *schedule_turn_to(Schedule *schedule, uint32_t i);
/* That engine, which is there already more often than not. */
static inline Engine *schedule_at(Schedule *schedule, uint32_t i)
{
    const Group *group = &schedule->groups[schedule->parts[i].group];
    return group->present == i ? group->engine : schedule_turn_to(schedule, i);
}
/* The same at t, on a copy where the part has to be brought there: whoever looks changes nothing. */
Engine *schedule_peek(Schedule *schedule, uint32_t i, double t);
/* The engines are on no part's block. */
void schedule_let_go(Schedule *schedule);
unsigned char *schedule_block(const Schedule *schedule, uint32_t i);
/* Where the inputs of a part lie. */
double *schedule_inputs(const Schedule *schedule, uint32_t i);
/* The run is refused, or over; always false. */
bool schedule_refuse(Schedule *schedule, uint32_t part, const char *format, ...) LIKE_PRINTF(3, 4);
bool schedule_over(Schedule *schedule, uint32_t part);
/* How far a part's event may be from t and still be of that instant. */
double schedule_instant(const Schedule *schedule, uint32_t i, double t);
/* Brings a part to the target, or to the first event before it; whether it has one there. */
bool schedule_step(Schedule *schedule, uint32_t i, double target, bool *event);
/* Looks ahead from where a part is, some steps far; or as many on from where it has looked, `most` times in all. */
void schedule_predict(Schedule *schedule, uint32_t i);
void schedule_predict_further(Schedule *schedule, uint32_t i, double most);
/* The run is over where a part's look ahead has found that; if it still does, else the part has looked ahead anew.
   Whether the run goes on. */
bool schedule_end_ahead(Schedule *schedule, uint32_t i);
/* The signals of a part as they are; false, and the run is over, if they cannot be computed. */
bool schedule_signals(Schedule *schedule, uint32_t i, double *values);

/* instants.c: what happens at one instant */
/* A part is to be asked for what is due. */
void schedule_touch(Schedule *schedule, uint32_t i);
/* Brings a part to t; `sender` sends to it. */
bool schedule_bring(Schedule *schedule, uint32_t i, double t, uint32_t sender);
/* A part is given a value from outside, now. */
bool schedule_receive(Schedule *schedule, uint32_t i, Bank bank, size_t index, double value);
/* One event iteration of the first part that is pending: at most one jump, and what it sends. */
bool schedule_update(Schedule *schedule, double t);
/* The instant is over: all that were touched look ahead. */
bool schedule_close(Schedule *schedule);
/* Jumps in the order of parts, signals travelling at once, until nothing is due; then the instant is over. */
bool schedule_iterate(Schedule *schedule, double t);

/* memory.c */
/* `signals` are the scalars that leave the parts of each group, `n_signals` of each, one group after the other; they
   stay the caller's, who keeps them. */
Schedule *schedule_create(size_t n_groups, const Model *const models[], const size_t n_signals[],
                          const Signal signals[], size_t n_parts, const uint32_t groups[]);
void schedule_free(Schedule *schedule);
/* As it was created: no part has values, nothing is due. */
void schedule_clear(Schedule *schedule);
/* What evolves, as bytes (aligned as malloc does); whether bytes that come from outside could be that. */
size_t schedule_state_size(const Schedule *schedule);
void schedule_save(Schedule *schedule, void *bytes);
void schedule_restore(Schedule *schedule, const void *bytes);
bool schedule_state_is_sound(const Schedule *schedule, void *bytes);

/* schedule.c */
/* Values of all parts of a group, row by row, in the order of the banks. */
void schedule_place(Schedule *schedule, size_t group, const double *const values[]);
/* Puts all parts at `start`, with their start maps if their states are to be computed; maps are not evaluated beyond
   `stop`. */
bool schedule_start(Schedule *schedule, double start, double stop, bool computed);
/* What all parts send is with their receivers, before anything has happened. */
bool schedule_hand_out(Schedule *schedule);
/* All parts are to be asked for what is due at the start. */
bool schedule_wake(Schedule *schedule);
/* Takes what is due at the start. */
bool schedule_begin(Schedule *schedule);
/* The next instant with events up to `limit`; the parts that have them (`due`) are brought there. */
bool schedule_next_instant(Schedule *schedule, double limit, double *instant);
/* Those parts are to be asked. */
void schedule_touch_due(Schedule *schedule);
/* Handles events before the target, as schedule_advance does; what is due at the target is left for whatever comes from
   outside there, and the parts are not brought there. */
ScheduleEnd schedule_approach(Schedule *schedule, double target, size_t work);
/* Handles events up to the target and brings all parts there; comes back earlier after about so many events and looks
   ahead. */
ScheduleEnd schedule_advance(Schedule *schedule, double target, size_t work);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
