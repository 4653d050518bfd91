/* Saved states in memory, and as bytes that can be kept and moved. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "instance.h"

/* A mark to recognise a saved state by, and the engine's block with what evolves in parts behind it. */
typedef struct {
    const Model *model;
    size_t size;
    unsigned char block[];
} Saved;

/* The bytes: magic, version, length of what follows, checksum of it, token of the model; then the block. */
enum {
    MAGIC_SIZE = 8,
    TOKEN_SIZE = 32,
    AT_VERSION = 8,
    AT_LENGTH = 16,
    AT_CHECKSUM = 24,
    AT_TOKEN = 32,
    HEADER_SIZE = AT_TOKEN + TOKEN_SIZE
};
static const unsigned char MAGIC[MAGIC_SIZE] = {'H', 'Y', 'B', 'R', 'I', 'D', 'S', '\n'};
#define FORMAT_VERSION 1

/* The engine's block, up to where that of parts may begin. */
static size_t whole_size(const Instance *instance)
{
    return (engine_block_size(instance->engine) + 15) / 16 * 16;
}

static size_t state_size(const Instance *instance)
{
    return whole_size(instance) + (instance->parts ? assembled_state_size(instance->parts) : 0);
}

static bool is_own(const Instance *instance, const Saved *saved)
{
    return saved->model == &model && saved->size == state_size(instance);
}

static Answer foreign_state(const Instance *instance, const char *function)
{
    return instance_refuse(instance, "%s: %s: this is not a state of this FMU.", instance->name, function);
}

static Saved *new_state(const Instance *instance)
{
    size_t size = state_size(instance);
    Saved *saved = calloc(1, sizeof *saved + size);
    if (saved) {
        saved->model = &model;
        saved->size = size;
    }
    return saved;
}

Answer instance_save(void *handle, const char *function, void **state)
{
    Instance *instance = instance_enter(handle, function, MODE_OUTSIDE);
    if (!instance)
        return ANSWER_ERROR;
    if (!state)
        return instance_null_argument(instance, function);
    Saved *saved = *state;
    if (saved && !is_own(instance, saved))
        return foreign_state(instance, function);
    if (!saved)
        saved = new_state(instance);
    if (!saved)
        return instance_refuse(instance, "%s: %s: out of memory.", instance->name, function);
    if (instance->parts)
        assembled_before_save(instance->parts);
    engine_save(instance->engine, saved->block);
    if (instance->parts)
        assembled_save(instance->parts, saved->block + whole_size(instance));
    *state = saved;
    return ANSWER_OK;
}

/* The modes that an instance of this kind can be in. */
static int own_modes(const Instance *instance)
{
    int modes = MODE_INSTANTIATED | MODE_CONFIGURATION | MODE_INITIALIZATION | MODE_TERMINATED;
    if (instance->interface == MODEL_EXCHANGE)
        return modes | MODE_EVENT | MODE_CONTINUOUS;
    return modes | MODE_STEP | (instance->event_mode_used ? MODE_EVENT : 0);
}

static bool is_one_of(int mode, int modes)
{
    return mode > 0 && (mode & (mode - 1)) == 0 && (mode & modes) != 0;
}

static Answer check_state(const Instance *instance, const char *function, Saved *saved)
{
    if (!saved)
        return instance_null_argument(instance, function);
    return is_own(instance, saved) ? ANSWER_OK : foreign_state(instance, function);
}

Answer instance_restore(void *handle, const char *function, const void *state)
{
    Instance *instance = instance_enter(handle, function, MODE_OUTSIDE);
    Saved *saved = (Saved *)state;
    if (!instance || check_state(instance, function, saved) != ANSWER_OK)
        return ANSWER_ERROR;
    const Run *run = engine_wrapper_in(instance->engine, saved->block);
    if (!is_one_of(run->mode, own_modes(instance)))
        return instance_refuse(instance,
                               "%s: %s: the saved state is one of '%s', which this instance cannot be in. Remedy: "
                               "restore it in an instance that was made in the same way.",
                               instance->name, function, instance_mode_name(run->mode));
    engine_restore(instance->engine, saved->block);
    if (instance->parts)
        assembled_restore(instance->parts, saved->block + whole_size(instance));
    return ANSWER_OK;
}

Answer instance_forget(void *handle, const char *function, void **state)
{
    if (!instance_enter(handle, function, MODE_ANY))
        return ANSWER_ERROR;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return ANSWER_OK;
}

/* ---- bytes ---- */

static void put_number(unsigned char *bytes, uint64_t number)
{
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(number >> (8 * i) & 0xFFu);
}

static uint64_t get_number(const unsigned char *bytes)
{
    uint64_t number = 0;
    for (int i = 0; i < 8; i++)
        number |= (uint64_t)bytes[i] << (8 * i);
    return number;
}

/* FNV-1a. */
static uint64_t checksum(const unsigned char *bytes, size_t n)
{
    uint64_t sum = 14695981039346656037u;
    for (size_t i = 0; i < n; i++)
        sum = (sum ^ bytes[i]) * 1099511628211u;
    return sum;
}

static void put_token(unsigned char *bytes)
{
    size_t size = strlen(description.token);
    memset(bytes, 0, TOKEN_SIZE);
    memcpy(bytes, description.token, size < TOKEN_SIZE ? size : TOKEN_SIZE);
}

Answer instance_serialized_size(void *handle, const char *function, const void *state, size_t *size)
{
    Instance *instance = instance_enter(handle, function, MODE_ANY);
    if (!instance || check_state(instance, function, (Saved *)state) != ANSWER_OK)
        return ANSWER_ERROR;
    if (!size)
        return instance_null_argument(instance, function);
    *size = HEADER_SIZE + ((const Saved *)state)->size;
    return ANSWER_OK;
}

Answer instance_serialize(void *handle, const char *function, const void *state, unsigned char bytes[], size_t size)
{
    Instance *instance = instance_enter(handle, function, MODE_ANY);
    const Saved *saved = state;
    if (!instance || check_state(instance, function, (Saved *)state) != ANSWER_OK)
        return ANSWER_ERROR;
    if (!bytes)
        return instance_null_argument(instance, function);
    if (size < HEADER_SIZE + saved->size)
        return instance_refuse(instance, "%s: %s: %zu bytes are too few; the state needs %zu.", instance->name,
                               function, size, HEADER_SIZE + saved->size);
    memset(bytes, 0, HEADER_SIZE);
    memcpy(bytes, MAGIC, MAGIC_SIZE);
    put_number(bytes + AT_VERSION, FORMAT_VERSION);
    put_number(bytes + AT_LENGTH, saved->size);
    put_token(bytes + AT_TOKEN);
    memcpy(bytes + HEADER_SIZE, saved->block, saved->size);
    put_number(bytes + AT_CHECKSUM, checksum(bytes + HEADER_SIZE, saved->size));
    return ANSWER_OK;
}

static bool is_sound(const Run *run)
{
    return is_one_of(run->mode, MODE_ANY) && isfinite(run->time) && !isnan(run->stop_time) && !isnan(run->next_event);
}

/* What is wrong with the bytes, NULL if nothing is. */
static const char *fault(const Instance *instance, const unsigned char *bytes, size_t size)
{
    unsigned char token[TOKEN_SIZE];
    put_token(token);
    if (size < HEADER_SIZE)
        return "they are too few for a header";
    if (memcmp(bytes, MAGIC, MAGIC_SIZE) != 0)
        return "they do not begin as a state of such an FMU does";
    if (get_number(bytes + AT_VERSION) != FORMAT_VERSION)
        return "they are of another version of the format";
    if (memcmp(bytes + AT_TOKEN, token, TOKEN_SIZE) != 0)
        return "they are a state of another FMU";
    if (get_number(bytes + AT_LENGTH) != state_size(instance) || size != HEADER_SIZE + state_size(instance))
        return "their number is not that of a state";
    if (get_number(bytes + AT_CHECKSUM) != checksum(bytes + HEADER_SIZE, size - HEADER_SIZE))
        return "their checksum is wrong";
    return NULL;
}

Answer instance_deserialize(void *handle, const char *function, const unsigned char bytes[], size_t size, void **state)
{
    Instance *instance = instance_enter(handle, function, MODE_ANY);
    if (!instance)
        return ANSWER_ERROR;
    if (!bytes || !state)
        return instance_null_argument(instance, function);
    if (*state && !is_own(instance, *state))
        return foreign_state(instance, function);
    const char *wrong = fault(instance, bytes, size);
    Saved *saved = wrong ? NULL : new_state(instance);
    if (!wrong && !saved)
        return instance_refuse(instance, "%s: %s: out of memory.", instance->name, function);
    if (saved) {
        memcpy(saved->block, bytes + HEADER_SIZE, saved->size);
        const Run *run = engine_wrapper_in(instance->engine, saved->block);
        if (!engine_block_is_sound(instance->engine, saved->block) || !is_sound(run) ||
            (instance->parts &&
             !assembled_state_is_sound(instance->parts, saved->block + whole_size(instance))))
            wrong = "what they hold cannot be a state";
    }
    if (wrong) {
        free(saved);
        return instance_refuse(instance,
                               "%s: %s: the %zu bytes are refused: %s. Remedy: give all the bytes that this FMU "
                               "serialised.",
                               instance->name, function, size, wrong);
    }
    free(*state);
    *state = saved;
    return ANSWER_OK;
}
