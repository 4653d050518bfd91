/* Reads calls, one a line, and writes what each gave: a status and values, or a word.

   Numbers are the 16 hexadecimal digits of their bits, so that no rounding and no locale comes between.  Whatever
   the calls, the harness itself looks after promises that hold always: the floating-point environment is as it was,
   nothing is allocated where nothing may be, messages are whole, callers may free their strings. */
#define _GNU_SOURCE
#include "harness.h"

#include <fenv.h>
#include <inttypes.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PLACES = 64, TOKENS = 256 };

typedef struct {
    void *instance;
    int update, looks;
} Place;

static Place places[PLACES];
static void *states[PLACES];
static unsigned char *bytes;
static size_t n_bytes;
static double values[MOST_VALUES];
/* Messages since they were last asked for, with a bar behind each. */
static char messages[1 << 20];
static size_t n_message_bytes;

void broken(const char *promise)
{
    fprintf(stderr, "broken promise: %s\n", promise);
    fflush(NULL);
    abort();
}

/* ---- what the FMU calls ---- */

static bool is_utf8(const char *text)
{
    for (const unsigned char *c = (const unsigned char *)text; *c; c++) {
        int more = *c < 0x80 ? 0 : *c >= 0xF0 ? 3 : *c >= 0xE0 ? 2 : *c >= 0xC2 ? 1 : -1;
        if (more < 0)
            return false;
        for (; more > 0; more--)
            if ((*++c & 0xC0) != 0x80)
                return false;
    }
    return true;
}

void heard(void *environment, int status, const char *category, const char *message)
{
    (void)environment;
    bool is_error = strcmp(category, "logStatusError") == 0;
    if (!is_error && strcmp(category, "logEvents") != 0)
        broken("log categories are those of the description");
    if (is_error != (status == 3))
        broken("errors, and nothing else, are logged as errors");
    if (*message == '\0' || strlen(message) > 1100 || !is_utf8(message))
        broken("a message is a text of limited length");
    if (n_message_bytes + strlen(message) + 2 < sizeof messages)
        n_message_bytes += (size_t)sprintf(messages + n_message_bytes, "%s|", message);
}

/* The values of all variables of a type but the clocks; the sum of their sizes. */
static int read_type(void *instance, Type type, double *to, size_t *n)
{
    uint32_t *references = own_memory(description.n_variables * sizeof *references);
    size_t found = 0, size = 0;
    for (size_t i = 0; i < description.n_variables; i++)
        if (description.variables[i].type == type && size + description.variables[i].size <= MOST_VALUES - *n) {
            references[found++] = (uint32_t)i;
            size += description.variables[i].size;
        }
    int status = found > 0 ? importer_access(instance, false, type, references, found, to + *n, size) : 0;
    *n += size;
    own_free(references);
    return status;
}

bool looked(void *environment, double time)
{
    Place *place = environment;
    double seen[MOST_VALUES];
    size_t n = 0;
    if (read_type(place->instance, TYPE_FLOAT64, seen, &n) != 0 || seen[0] != time)
        broken("on the way of a step all values can be read, and the time is that of the callback");
    return place->update == 2 && ++place->looks % 3 == 0;
}

/* ---- the floating-point environment ---- */

static unsigned long environment_now(void)
{
    /* The flags of exceptions that occurred are no setting; rounding, traps and what denormals become are. */
    fenv_t now;
    fegetenv(&now);
#if defined(__x86_64__)
    return ((unsigned long)now.__control_word << 32) | (now.__mxcsr & ~0x3Ful);
#else
    return ((unsigned long)fegetround() << 32) | (unsigned)fegetexcept();
#endif
}

/* ---- reading and writing ---- */

static char *word(void)
{
    char *found = strtok(NULL, " \n");
    return found ? found : "";
}

static size_t number(void)
{
    return (size_t)strtoull(word(), NULL, 10);
}

static bool more(double *value)
{
    char *digits = strtok(NULL, " \n");
    uint64_t bits = digits ? strtoull(digits, NULL, 16) : 0;
    memcpy(value, &bits, sizeof bits);
    return digits != NULL;
}

static double bits(void)
{
    double value = 0.0;
    more(&value);
    return value;
}

static void tell(double value)
{
    uint64_t digits;
    memcpy(&digits, &value, sizeof digits);
    printf(" %016" PRIx64, digits);
}

static void tell_all(int status, size_t n)
{
    printf("%d", status);
    for (size_t i = 0; i < n; i++)
        tell(values[i]);
}

/* A text in hexadecimal digits; "-" is none, "." is empty. */
static char *text(void)
{
    const char *digits = word();
    size_t n = strlen(digits) / 2;
    if (*digits == '-' || *digits == '\0')
        return NULL;
    char *found = own_memory(n + 1);
    for (size_t i = 0; i < n; i++) {
        char two[3] = {digits[2 * i], digits[2 * i + 1], '\0'};
        found[i] = (char)strtol(two, NULL, 16);
    }
    return found;
}

static void *instance(void)
{
    return places[number() % PLACES].instance;
}

static size_t read_values(void)
{
    size_t n = 0;
    while (n < MOST_VALUES && more(&values[n]))
        n++;
    return n;
}

static size_t size_of(uint32_t reference)
{
    return reference < description.n_variables ? description.variables[reference].size : 1;
}

static Type type_of(uint32_t reference)
{
    return reference < description.n_variables ? description.variables[reference].type : TYPE_FLOAT64;
}

/* ---- calls ---- */

static void do_new(void)
{
    Place *place = &places[number() % PLACES];
    Wish wish = {.kind = word()};
    wish.events = number(), wish.early = number(), wish.logging = number(), wish.listening = number();
    place->update = wish.update = (int)number();
    char *name = text();
    const char *given = word();
    char *token = own_memory(strlen(given) + strlen(description.token) + 1);
    strcpy(token, strcmp(given, "own") == 0 ? description.token : given);
    wish.name = name;
    wish.token = strcmp(given, "none") == 0 ? NULL : token;
    place->looks = 0;
    place->instance = importer_new(&wish, place);
    /* Whoever keeps these reads rubbish from now on, and sanitizers see it. */
    if (name)
        memset(name, '?', strlen(name));
    memset(token, '?', strlen(token));
    own_free(name);
    own_free(token);
    printf("%d", place->instance ? 0 : 3);
}

static void do_free(void)
{
    Place *place = &places[number() % PLACES];
    importer_free(place->instance);
    place->instance = NULL;
    printf("0");
}

static void do_begin(void)
{
    void *own = instance();
    double start = bits(), stop = bits(), tolerance = bits();
    printf("%d", importer_begin(own, start, stop, tolerance));
}

static void do_plain(void)
{
    void *own = instance();
    printf("%d", importer_plain(own, word()));
}

static void do_get(void)
{
    void *own = instance();
    uint32_t reference = (uint32_t)number();
    size_t n = size_of(reference);
    int status = importer_access(own, false, type_of(reference), &reference, 1, values, n);
    tell_all(status, status == 0 ? n : 0);
}

static void do_set(void)
{
    void *own = instance();
    uint32_t reference = (uint32_t)number();
    size_t n = read_values();
    printf("%d", importer_access(own, true, type_of(reference), &reference, 1, values, n));
}

static void do_values(void)
{
    static const Type TYPES[] = {TYPE_FLOAT64, TYPE_INT32, TYPE_BOOLEAN};
    void *own = instance();
    size_t n = 0;
    int status = 0;
    for (size_t i = 0; i < 3 && status == 0; i++)
        status = read_type(own, TYPES[i], values, &n);
    tell_all(status, status == 0 ? n : 0);
}

static void do_step(void)
{
    void *own = instance();
    double t = bits(), h = bits();
    Stepped seen = {.time = 0.0};
    importer_step(own, t, h, &seen);
    printf("%d %d %d %d", seen.status, seen.event, seen.terminate, seen.early);
    tell(seen.time);
}

static void do_update(void)
{
    Updated seen = {.next = 0.0};
    importer_update(instance(), &seen);
    printf("%d %d %d %d %d", seen.status, seen.again, seen.terminate, seen.changed, seen.has_next);
    tell(seen.next);
}

static void do_time(void)
{
    void *own = instance();
    printf("%d", importer_set_time(own, bits()));
}

static void do_states(void)
{
    void *own = instance();
    size_t n = read_values();
    printf("%d", importer_set_states(own, values, n));
}

static void do_vector(void)
{
    void *own = instance();
    const char *what = word();
    size_t n = number();
    int status = importer_vector(own, what, values, n < MOST_VALUES ? n : MOST_VALUES);
    tell_all(status, status == 0 ? n : 0);
}

static void do_completed(void)
{
    bool event = false, terminate = false;
    int status = importer_completed(instance(), &event, &terminate);
    printf("%d %d %d", status, event, terminate);
}

static void do_save(void)
{
    void *own = instance();
    printf("%d", importer_save(own, &states[number() % PLACES]));
}

static void do_load(void)
{
    void *own = instance();
    printf("%d", importer_restore(own, states[number() % PLACES]));
}

static void do_drop(void)
{
    void *own = instance();
    printf("%d", importer_drop(own, &states[number() % PLACES]));
}

static void do_bytes(void)
{
    void *own = instance(), *state = states[number() % PLACES];
    size_t size = 0;
    int status = importer_size(own, state, &size);
    if (status == 0) {
        own_free(bytes);
        /* No byte more than was asked for. */
        bytes = own_memory(size);
        n_bytes = size;
        status = importer_bytes(own, state, bytes, size);
    }
    printf("%d %zu", status, size);
}

static void do_parse(void)
{
    void *own = instance();
    printf("%d", importer_parse(own, bytes, n_bytes, &states[number() % PLACES]));
}

/* The bytes that are kept: shown, or changed at a place, or of another number. */
static void do_show_bytes(void)
{
    for (size_t i = 0; i < n_bytes; i++)
        printf("%02x", bytes[i]);
}

static void do_give_bytes(void)
{
    char *digits = word();
    unsigned char *given = own_memory(strlen(digits) / 2);
    own_free(bytes);
    bytes = given;
    n_bytes = strlen(digits) / 2;
    for (size_t i = 0; i < n_bytes; i++) {
        char two[3] = {digits[2 * i], digits[2 * i + 1], '\0'};
        bytes[i] = (unsigned char)strtoul(two, NULL, 16);
    }
    printf("0 %zu", n_bytes);
}

static void do_partial(void)
{
    void *own = instance();
    bool forward = number();
    uint32_t unknown = (uint32_t)number(), known = (uint32_t)number();
    size_t n_seeds = size_of(forward ? known : unknown), n = size_of(forward ? unknown : known);
    double seeds[MOST_VALUES];
    for (size_t i = 0; i < n_seeds; i++)
        seeds[i] = 1.0 + (double)i;
    int status = importer_partial(own, forward, unknown, known, seeds, n_seeds, values, n);
    tell_all(status, status == 0 ? n : 0);
}

static void do_rates(void)
{
    void *own = instance();
    uint32_t references[64];
    size_t n = 0;
    for (size_t i = 0; i < description.n_variables && n < 64; i++)
        if (description.variables[i].bank == BANK_OUTPUT && description.variables[i].type == TYPE_FLOAT64)
            references[n++] = (uint32_t)i;
    int status = importer_rates(own, references, n, values, n);
    tell_all(status, status == 0 ? n : 0);
}

static void do_interval(void)
{
    void *own = instance();
    int qualifier = 0, status = importer_interval(own, (uint32_t)number(), values, &qualifier);
    printf("%d %d", status, qualifier);
    tell(status == 0 ? values[0] : 0.0);
}

static void do_debug(void)
{
    void *own = instance();
    bool on = number();
    char *category = text();
    printf("%d", importer_debug(own, on, category ? 1 : 0, (const char *const *)&category));
    own_free(category);
}

static void do_nulls(void)
{
    char letters[128];
    importer_nulls(instance(), letters, sizeof letters);
    printf("0 %s", letters);
}

/* ---- what is asked of the harness itself ---- */

static void do_fail(void)
{
    fail_after((long)number());
    printf("0");
}

static void do_memory(void)
{
    printf("%ld %ld", living(), allocations());
}

static void do_log(void)
{
    for (char *c = messages; *c; c++)
        if (*c == '\n')
            *c = ' ';
    printf("%s", messages);
    n_message_bytes = 0;
    messages[0] = '\0';
}

static void do_rounding(void)
{
    const char *which = word();
    fesetround(*which == 'u' ? FE_UPWARD : *which == 'd' ? FE_DOWNWARD : *which == 'z' ? FE_TOWARDZERO : FE_TONEAREST);
    printf("0");
}

static void do_locale(void)
{
    char shown[32];
    const char *set = setlocale(LC_ALL, word());
    snprintf(shown, sizeof shown, "%.1f", 1.5);
    printf("%d %s", set ? 0 : 3, shown);
}

static void do_threads(void)
{
    int n_threads = (int)number(), n_steps = (int)number();
    printf("%d", threads_agree(n_threads, n_steps, bits()) ? 0 : 3);
}

typedef enum { ALLOCATES, ALLOCATES_NOT, IS_NO_CALL } Manner;

static const struct {
    const char *name;
    void (*call)(void);
    Manner manner;
} CALLS[] = {
    {"new", do_new, ALLOCATES},          {"free", do_free, ALLOCATES_NOT},
    {"begin", do_begin, ALLOCATES_NOT},  {"plain", do_plain, ALLOCATES_NOT},
    {"get", do_get, ALLOCATES_NOT},      {"set", do_set, ALLOCATES_NOT},
    {"values", do_values, ALLOCATES_NOT}, {"step", do_step, ALLOCATES_NOT},
    {"update", do_update, ALLOCATES_NOT}, {"time", do_time, ALLOCATES_NOT},
    {"states", do_states, ALLOCATES_NOT}, {"vector", do_vector, ALLOCATES_NOT},
    {"completed", do_completed, ALLOCATES_NOT}, {"save", do_save, ALLOCATES},
    {"load", do_load, ALLOCATES_NOT},    {"drop", do_drop, ALLOCATES_NOT},
    {"bytes", do_bytes, ALLOCATES_NOT},  {"parse", do_parse, ALLOCATES},
    {"partial", do_partial, ALLOCATES_NOT}, {"rates", do_rates, ALLOCATES_NOT},
    {"interval", do_interval, ALLOCATES_NOT}, {"debug", do_debug, ALLOCATES_NOT},
    {"nulls", do_nulls, ALLOCATES_NOT},  {"showbytes", do_show_bytes, IS_NO_CALL},
    {"givebytes", do_give_bytes, IS_NO_CALL}, {"fail", do_fail, IS_NO_CALL},
    {"memory", do_memory, IS_NO_CALL},   {"log", do_log, IS_NO_CALL},
    {"rounding", do_rounding, IS_NO_CALL}, {"locale", do_locale, IS_NO_CALL},
    {"threads", do_threads, IS_NO_CALL}};

static void answer(const char *name)
{
    for (size_t i = 0; i < sizeof CALLS / sizeof *CALLS; i++) {
        if (strcmp(CALLS[i].name, name) != 0)
            continue;
        unsigned long before = environment_now();
        long asked = allocations();
        CALLS[i].call();
        if (CALLS[i].manner != IS_NO_CALL && environment_now() != before)
            broken("the floating-point environment is as it was");
        if (CALLS[i].manner == ALLOCATES_NOT && allocations() != asked)
            broken("nothing is allocated but at instantiation and for saved states");
        return;
    }
    broken("the harness knows the call");
}

int main(void)
{
    char *line = NULL;
    size_t room = 0;
    while (getline(&line, &room, stdin) > 0) {
        const char *name = strtok(line, " \n");
        if (!name)
            continue;
        answer(name);
        putchar('\n');
        fflush(stdout);
    }
    free(line);
    own_free(bytes);
    return 0;
}
