/* Between the runtime and the memory functions: the linker gives it every call (--wrap). */
#include <stdlib.h>

#include "harness.h"

void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *memory, size_t size);
void __real_free(void *memory);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_realloc(void *memory, size_t size);
void __wrap_free(void *memory);

static __thread long asked, alive, countdown;

void fail_after(long n)
{
    countdown = n;
}

long living(void)
{
    return alive;
}

long allocations(void)
{
    return asked;
}

static bool fails(void)
{
    asked++;
    return countdown > 0 && --countdown == 0;
}

static void *counted(void *memory)
{
    alive += memory != NULL;
    return memory;
}

void *__wrap_malloc(size_t size)
{
    return fails() ? NULL : counted(__real_malloc(size));
}

void *__wrap_calloc(size_t n, size_t size)
{
    return fails() ? NULL : counted(__real_calloc(n, size));
}

void *__wrap_realloc(void *memory, size_t size)
{
    if (fails())
        return NULL;
    void *grown = __real_realloc(memory, size);
    return memory ? grown : counted(grown);
}

void __wrap_free(void *memory)
{
    alive -= memory != NULL;
    __real_free(memory);
}

void *own_memory(size_t size)
{
    void *memory = __real_calloc(1, size > 0 ? size : 1);
    if (!memory)
        broken("no memory for the harness itself");
    return memory;
}

void own_free(void *memory)
{
    __real_free(memory);
}
