/* Networks with random wires between parts of one model, which are given values from outside too, run in pieces of
   random length, two threads with two networks each: what happens must not depend on the pieces, nor on who else runs.
   Prints the number of events. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "schedule.h"

#define GROUPS 2
#define MOST_PARTS 40
#define END 2.0
#define CHANGES 12

typedef struct {
    uint64_t state;
} Dice;

static double roll(Dice *dice)
{
    dice->state = dice->state * 6364136223846793005u + 1442695040888963407u;
    return (double)(dice->state >> 11) / 9007199254740992.0;
}

static size_t pick(Dice *dice, size_t n)
{
    return (size_t)(roll(dice) * (double)n);
}

typedef struct {
    uint64_t seed, pieces;        /* of the network, and of the lengths of its pieces */
    size_t events;
    uint64_t digest;
    int failed;
} Task;

typedef struct {
    uint32_t groups[MOST_PARTS], source[MOST_PARTS * 8], input[MOST_PARTS * 8], target[MOST_PARTS * 8];
    uint64_t first[MOST_PARTS + 1];
    uint32_t signals[MOST_PARTS * 8], targets[MOST_PARTS * 8], inputs[MOST_PARTS * 8];
    size_t n_parts, n_wires;
} Wiring;

static void wire(Wiring *wiring, Dice *dice, size_t n_inputs)
{
    for (uint32_t part = 0; part < wiring->n_parts; part++)
        for (uint32_t input = 0; input < n_inputs; input++) {
            if (roll(dice) < 0.3)
                continue;
            wiring->source[wiring->n_wires] = (uint32_t)pick(dice, wiring->n_parts);
            wiring->target[wiring->n_wires] = part;
            wiring->input[wiring->n_wires++] = input;
        }
    size_t next = 0;
    for (uint32_t part = 0; part < wiring->n_parts; part++) {
        wiring->first[part] = next;
        for (size_t k = 0; k < wiring->n_wires; k++)
            if (wiring->source[k] == part) {
                wiring->signals[next] = 0;
                wiring->targets[next] = wiring->target[k];
                wiring->inputs[next++] = wiring->input[k];
            }
    }
    wiring->first[wiring->n_parts] = next;
}

static void place(Schedule *schedule, size_t group, Dice *dice)
{
    size_t sizes[] = {model.n_states, model.n_discrete, model.n_inputs, model.n_parameters};
    size_t count = schedule->groups[group].count;
    double *rows[4];
    for (size_t bank = 0; bank < 4; bank++) {
        rows[bank] = calloc(count * sizes[bank] + 1, sizeof(double));
        for (size_t k = 0; k < count * sizes[bank]; k++)
            rows[bank][k] = bank == BANK_STATE ? 2.0 * roll(dice) - 1.0 : bank == BANK_PARAMETER ? 0.1 + roll(dice) : 0.0;
    }
    schedule_place(schedule, group, (const double *const *)rows);
    for (size_t bank = 0; bank < 4; bank++)
        free(rows[bank]);
}

static void note(Task *task, EventLog *log)
{
    for (size_t k = 0; k < log->count; k++) {
        uint64_t bits;
        memcpy(&bits, &log->times[k], sizeof bits);
        task->digest = (task->digest ^ bits ^ log->parts[k] ^ ((uint64_t)log->jumps[k] << 32)) * 1099511628211u;
    }
    task->events += log->count;
    log->count = 0;
}

typedef struct {
    double t, value;
    uint32_t part, input;
} Change;

static void draw_changes(Change *changes, Dice *dice, size_t n_parts)
{
    for (size_t k = 0; k < CHANGES; k++) {
        /* Two in three come together with another one, or with breakpoints of the parts. */
        double when = k % 3 == 0 ? (double)k + 0.9 * roll(dice) : (double)(k / 3) * 3.0;
        changes[k] = (Change){.t = END * when / CHANGES, .value = 2.0 * roll(dice) - 1.0,
                              .part = (uint32_t)pick(dice, n_parts), .input = (uint32_t)pick(dice, model.n_inputs)};
        if (k > 0 && changes[k].t < changes[k - 1].t)
            changes[k].t = changes[k - 1].t;
    }
}

/* A part does not look beyond the next of its changes from number k on. */
static void look_until(Schedule *schedule, const Change *changes, size_t k, uint32_t part)
{
    while (k < CHANGES && changes[k].part != part)
        k++;
    schedule_at(schedule, part)->status->stop_time = k < CHANGES ? changes[k].t : END;
}

static bool give(Schedule *schedule, const Change *changes, size_t k)
{
    look_until(schedule, changes, k + 1, changes[k].part);
    return schedule_receive(schedule, changes[k].part, BANK_INPUT, changes[k].input, changes[k].value) &&
           schedule_iterate(schedule, schedule->t);
}

/* To the time of each change, and to the end, in pieces. */
static ScheduleEnd go_on(Task *task, Schedule *schedule, const Change *changes, Dice *pieces)
{
    ScheduleEnd end = SCHEDULE_REACHED;
    for (size_t k = 0; k <= CHANGES && end == SCHEDULE_REACHED; k++) {
        do {
            note(task, &schedule->log);
            size_t work = 1 + pick(pieces, 50);
            end = k < CHANGES ? schedule_approach(schedule, changes[k].t, work) : schedule_advance(schedule, END, work);
        } while (end == SCHEDULE_GOING);
        if (k < CHANGES && end == SCHEDULE_REACHED && !give(schedule, changes, k))
            end = schedule->end;
    }
    note(task, &schedule->log);
    return end;
}

static void run_network(Task *task)
{
    Dice dice = {task->seed}, pieces = {task->pieces};
    Wiring *wiring = calloc(1, sizeof *wiring);
    const Model *const models[GROUPS] = {&model, &model};
    const Signal sent[GROUPS] = {{BANK_DISCRETE, 0}, {BANK_DISCRETE, 0}};
    const size_t n_sent[GROUPS] = {1, 1};
    wiring->n_parts = 2 + pick(&dice, MOST_PARTS - 2);
    for (size_t i = 0; i < wiring->n_parts; i++)
        wiring->groups[i] = (uint32_t)pick(&dice, GROUPS);
    wire(wiring, &dice, model.n_inputs);
    Schedule *schedule = schedule_create(GROUPS, models, n_sent, sent, wiring->n_parts, wiring->groups);
    schedule->keeps = task->seed % 3 == 0 ? LOG_INSTANTS : LOG_SIGNALS;
    schedule->wires = (Wires){wiring->first, wiring->signals, wiring->targets, wiring->inputs};
    for (size_t group = 0; group < GROUPS; group++) {
        schedule->groups[group].engine->options.look_ahead_steps = 1.0 + (double)pick(&dice, 4);
        place(schedule, group, &dice);
    }
    Change changes[CHANGES];
    draw_changes(changes, &dice, wiring->n_parts);
    task->failed = !schedule_start(schedule, 0.0, END, true);
    for (uint32_t i = 0; i < wiring->n_parts; i++)
        look_until(schedule, changes, 0, i);
    task->failed = task->failed || !schedule_begin(schedule);
    ScheduleEnd end = task->failed ? schedule->end : go_on(task, schedule, changes, &pieces);
    task->failed = task->failed || end != SCHEDULE_REACHED;
    if (task->failed)
        fprintf(stderr, "seed %llu: end %d, %s %s\n", (unsigned long long)task->seed, (int)end, schedule->message,
                engine_message(schedule_at(schedule, schedule->culprit)));
    schedule_free(schedule);
    free(wiring);
}

static void *run_two(void *tasks)
{
    run_network((Task *)tasks);
    run_network((Task *)tasks + 1);
    return NULL;
}

int main(int count, char **given)
{
    uint64_t seed = count > 1 ? strtoull(given[1], NULL, 10) : 1;
    Task tasks[2][2] = {{{.seed = seed, .pieces = 1}, {.seed = seed + 1, .pieces = 2}},
                        {{.seed = seed, .pieces = 3}, {.seed = seed + 1, .pieces = 4}}};
    pthread_t threads[2];
    for (int k = 0; k < 2; k++)
        pthread_create(&threads[k], NULL, run_two, tasks[k]);
    for (int k = 0; k < 2; k++)
        pthread_join(threads[k], NULL);
    int failed = 0;
    for (int k = 0; k < 2; k++) {
        failed |= tasks[0][k].failed || tasks[1][k].failed || tasks[0][k].digest != tasks[1][k].digest;
        printf("%zu\n", tasks[0][k].events);
    }
    return failed;
}
