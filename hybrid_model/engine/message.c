/* Why something cannot be done, and names for it. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "parts.h"

void engine_end_text(char *text)
{
    size_t size = strlen(text), tail = 0;
    while (tail < size && tail < 3 && ((unsigned char)text[size - 1 - tail] & 0xC0) == 0x80)
        tail++;
    if (tail == size)
        return;
    unsigned char lead = (unsigned char)text[size - 1 - tail];
    size_t wanted = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : lead >= 0xC0 ? 1 : 0;
    if (wanted > tail)
        text[size - 1 - tail] = '\0';
}

bool engine_fail(Engine *engine, Ending ending, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(engine->problem_message, sizeof engine->problem_message, format, arguments);
    va_end(arguments);
    engine_end_text(engine->problem_message);
    engine->problem = ending;
    return false;
}

/* The run is over for the reason noted last. */
bool engine_end_run(Engine *engine)
{
    engine->status->ending = (int32_t)engine->problem;
    engine->status->has_segment = false;
    memcpy(engine->status->message, engine->problem_message, sizeof engine->problem_message);
    return false;
}

const char *engine_name(const char *names, ModelName name, char text[NAME_SIZE])
{
    snprintf(text, NAME_SIZE, "%s%s", names + name.head, names + name.tail);
    engine_end_text(text);
    return text;
}

ModelName engine_state_name(const Model *m, size_t i)
{
    return i < m->n_states ? m->state_names[i] : m->discrete_names[i - m->n_states];
}

const char *engine_describe_state(const Engine *engine, const double *x, const double *z, char *text, size_t size)
{
    const Model *m = engine->model;
    size_t used = 0;
    text[0] = '\0';
    for (size_t i = 0; i < m->n_states + m->n_discrete && used + 1 < size; i++) {
        double value = i < m->n_states ? x[i] : z[i - m->n_states];
        int added = snprintf(text + used, size - used, "%s%s = %.10g", used ? ", " : "",
                             NAME_AT(m->names, engine_state_name(m, i)), value);
        used += added > 0 ? (size_t)added : 0;
    }
    engine_end_text(text);
    return text;
}

const char *engine_message(const Engine *engine)
{
    return engine->status->message;
}

const char *engine_problem(const Engine *engine)
{
    return engine->problem_message;
}
