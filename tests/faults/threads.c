/* Instances on threads of their own, with little stack: each run is the run of one instance alone. */
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <string.h>

#include "harness.h"

enum { MOST_THREADS = 64 };

typedef struct {
    int n_steps;
    double h;
    uint64_t sum;              /* of the bits of all that was seen; 0: something failed */
} Task;

static uint64_t mix(uint64_t sum, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (sum ^ bits) * 1099511628211u;
}

/* Until no further update is needed; false if the run is over. */
static bool iterate(void *instance)
{
    Updated seen = {.again = true};
    while (seen.again && !seen.terminate)
        if (importer_update(instance, &seen) != 0)
            return false;
    return !seen.terminate && importer_plain(instance, "step") == 0;
}

static uint64_t watched(void *instance, uint64_t sum)
{
    for (uint32_t i = 0; i < description.n_variables; i++) {
        double value;
        if (description.variables[i].type != TYPE_FLOAT64 || description.variables[i].size != 1)
            continue;
        if (importer_access(instance, false, TYPE_FLOAT64, &i, 1, &value, 1) != 0)
            return 0;
        sum = mix(sum, value);
    }
    return sum;
}

static void *run(void *argument)
{
    Task *task = argument;
    const Wish wish = {.kind = "cs", .name = "thread", .token = description.token, .events = FMI_VERSION == 3,
                       .early = true, .logging = false, .listening = false, .update = 0};
    void *instance = importer_new(&wish, NULL), *state = NULL;
    uint64_t sum = 14695981039346656037u;
    double t = 0.0;
    task->sum = 0;
    if (!instance || importer_begin(instance, 0.0, NAN, NAN) != 0 || importer_plain(instance, "end") != 0 ||
        (wish.events && !iterate(instance)))
        return NULL;
    for (int k = 1; k <= task->n_steps && sum != 0;) {
        Stepped seen = {.time = t};
        double target = (double)k * task->h;
        if (importer_step(instance, t, target - t, &seen) != 0 || seen.terminate)
            break;
        t = seen.early ? seen.time : target;
        sum = mix(watched(instance, sum), t);
        if (seen.event && wish.events && (importer_plain(instance, "event") != 0 || !iterate(instance)))
            break;
        /* Half of what a run remembers goes through a saved state. */
        if (k % 2 == 0 && (importer_save(instance, &state) != 0 || importer_restore(instance, state) != 0))
            break;
        k += !seen.early;
    }
    importer_drop(instance, &state);
    importer_free(instance);
    task->sum = t > 0.0 ? sum : 0;
    return NULL;
}

bool threads_agree(int n_threads, int n_steps, double h)
{
    Task alone = {n_steps, h, 0}, tasks[MOST_THREADS];
    pthread_t threads[MOST_THREADS];
    pthread_attr_t little;
    bool agree = true;
    run(&alone);
    pthread_attr_init(&little);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    pthread_attr_setstacksize(&little, (size_t)64 * 1024);
#endif
    for (int i = 0; i < n_threads && i < MOST_THREADS; i++) {
        tasks[i] = alone;
        if (pthread_create(&threads[i], &little, run, &tasks[i]) != 0)
            broken("the harness can start threads");
    }
    for (int i = 0; i < n_threads && i < MOST_THREADS; i++) {
        pthread_join(threads[i], NULL);
        agree = agree && tasks[i].sum == alone.sum;
    }
    pthread_attr_destroy(&little);
    return agree && alone.sum != 0;
}
