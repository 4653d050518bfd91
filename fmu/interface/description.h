/* What the description of an FMU says of its variables, clocks and kinds: what the interface needs beside the model.

   fmu/build writes the C of `const Description description` next to that of the model. */
#ifndef HYBRID_DESCRIPTION_H
#define HYBRID_DESCRIPTION_H

#include "assembly.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Where a variable's value is beside the banks of the engine.  SIZE is the length of arrays, CLOCK one that ticks with
   a jump, COUNTDOWN that of the next event, OPTION a switch of the interface. */
enum { BANK_TIME = N_BANKS, BANK_SIZE, BANK_CLOCK, BANK_COUNTDOWN, BANK_OPTION };
typedef enum { TYPE_FLOAT64, TYPE_INT32, TYPE_UINT64, TYPE_BOOLEAN, TYPE_CLOCK } Type;

typedef struct {
    ModelName name;
    uint32_t index;        /* of its first element in its bank; of a clock that of its jump, of a size the length */
    uint32_t size;         /* number of its elements */
    uint8_t type, bank;
    bool discrete;         /* variability discrete (inputs, outputs) */
    bool calculated;       /* its start value is computed by the start map, so it cannot be set */
    bool tunable;          /* a parameter that may be set at events and communication points */
} Variable;

typedef struct {
    const char *token;                 /* instantiation token */
    bool co_simulation, model_exchange;    /* the kinds that the description offers */
    size_t n_variables;
    const Variable *variables;         /* value reference = index in this table; 0 is the time */
    const char *names;                 /* of the variables, as in a model */
    const Assembly *assembly;          /* of a network whose parts meet only at events, for Co-Simulation; else NULL */
} Description;

extern const Description description;

/* A variable's name, as long as the block in which this stands. */
#define NAME_OF(variable) NAME_AT(description.names, (variable)->name)

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
