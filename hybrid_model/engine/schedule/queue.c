/* Heaps: of predicted events by their times, and of the parts that wait for their turn at one instant. */
#include "schedule.h"

static bool before(const Queue *queue, uint32_t a, uint32_t b)
{
    return queue->times[a] < queue->times[b] || (queue->times[a] == queue->times[b] && a < b);
}

static void set(Queue *queue, size_t place, uint32_t part)
{
    queue->parts[place] = part;
    queue->places[part] = (uint32_t)place;
}

static void rise(Queue *queue, size_t place, uint32_t part)
{
    while (place > 0 && before(queue, part, queue->parts[(place - 1) / 2])) {
        set(queue, place, queue->parts[(place - 1) / 2]);
        place = (place - 1) / 2;
    }
    set(queue, place, part);
}

static void sink(Queue *queue, size_t place, uint32_t part)
{
    for (size_t child = 2 * place + 1; child < queue->count; child = 2 * place + 1) {
        if (child + 1 < queue->count && before(queue, queue->parts[child + 1], queue->parts[child]))
            child++;
        if (!before(queue, queue->parts[child], part))
            break;
        set(queue, place, queue->parts[child]);
        place = child;
    }
    set(queue, place, part);
}

void queue_put(Queue *queue, uint32_t part, double time)
{
    uint32_t place = queue->places[part];
    if (place == NOBODY) {
        queue->times[part] = time;
        rise(queue, queue->count++, part);
        return;
    }
    bool earlier = time < queue->times[part];
    queue->times[part] = time;
    if (earlier)
        rise(queue, place, part);
    else
        sink(queue, place, part);
}

void queue_remove(Queue *queue, uint32_t part)
{
    uint32_t place = queue->places[part];
    if (place == NOBODY)
        return;
    uint32_t last = queue->parts[--queue->count];
    queue->places[part] = NOBODY;
    if (last == part)
        return;
    set(queue, place, last);
    rise(queue, place, last);
    sink(queue, queue->places[last], last);
}

void pending_add(Pending *pending, uint32_t part)
{
    uint32_t *parts = pending->parts;
    size_t place = pending->count++;
    for (; place > 0 && part < parts[(place - 1) / 2]; place = (place - 1) / 2)
        parts[place] = parts[(place - 1) / 2];
    parts[place] = part;
}

uint32_t pending_take(Pending *pending)
{
    uint32_t *parts = pending->parts, first = parts[0], last = parts[--pending->count];
    size_t place = 0;
    for (size_t child = 1; child < pending->count; child = 2 * place + 1) {
        if (child + 1 < pending->count && parts[child + 1] < parts[child])
            child++;
        if (last <= parts[child])
            break;
        parts[place] = parts[child];
        place = child;
    }
    parts[place] = last;
    return first;
}
