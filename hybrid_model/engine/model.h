/* What a generated model tells the engine: mathematics, and names for messages.

   hybrid_model/native writes the C of `const Model model` and of the tables behind it.  Every expression in it is
   traced from the automaton's Python declaration; nothing about a model is written by hand. */
#ifndef HYBRID_MODEL_H
#define HYBRID_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The names of an FMU's inside stay inside, whatever flags it is compiled with. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Calling convention of the generated functions (CasADi): arg[i] is input i (NULL: zeros), res[i] output i
   (NULL: not wanted), iw and w are work arrays of n_iw integers and n_w doubles; 0 means success. */
typedef int (*ModelFunction)(const double **arg, double **res, long long *iw, double *w, int mem);
/* Inputs of each of them, in this order: t (1), x (n_states), z (n_discrete), u (n_inputs), p (n_parameters). */
#define MODEL_N_ARG 5
/* Most inputs and outputs of a function, with the seeds of derivatives. */
#define MODEL_MAX_ARG 10
#define MODEL_MAX_RES 5
/* The state after a jump: x+ (n_states), z+ (n_discrete). */
typedef int (*ModelReset)(size_t jump, const double **arg, double **res, long long *iw, double *w);

/* Whether time scales of the flow differ so much that an explicit method would go by the fastest. */
typedef enum { STIFFNESS_UNKNOWN, STIFFNESS_DECLARED, STIFFNESS_DENIED } Stiffness;

typedef enum { JUMP_ON_STATE, JUMP_ON_TIME } JumpKind;

/* Names are two places in one text, of what comes up to the last dot and of the rest: large models have tens of
   thousands of variables, whose names begin alike and end alike. */
typedef struct {
    uint32_t head, tail;
} ModelName;

typedef struct {
    ModelName name;
    JumpKind kind;
    uint32_t index;         /* of its margin among the jump margins, or of its time among the times */
    bool internal;         /* a breakpoint of the flow (on time only): depends on t, z, p alone, invisible outside */
} ModelJump;

#define N_REACH_AT 4
#define N_PROBE_PARTS 3
#define N_AWAY 3
/* The numbers of the semantics, none of which is in seconds or in the unit of a state: see
   hybrid_model/scales.py, from which the generator takes them. */
typedef struct {
    double roundings, instant, instant_in_gap, border, absolute, rounding_level, unknown, probe, overshoot;
    double jumps_at_once, jumps_in_window, accumulation, spread, crowd, resolved, chatter, pause;
    double euler_part, blind_part, first_growth, first_least, reach_step, reach_at[N_REACH_AT];
    double probe_parts[N_PROBE_PARTS], steady;
    double sliding_after, sliding_looks, sliding_found, sliding_left, sliding_ahead;
    double retained, halvings_least, halvings_most, away[N_AWAY], pace_steps, most_compiled_steps;
    double seen_part, left_by_rounding;
} ModelScales;

typedef struct {
    const char *name;                  /* model name, for messages */
    size_t n_states, n_discrete, n_inputs, n_parameters, n_outputs;
    size_t n_margins, n_times;         /* jump margins (without the flow set's), times */
    size_t n_jumps;
    size_t n_arg, n_res, n_iw, n_w;    /* sizes of the work arrays that the functions need (maximum over all) */
    bool flow_priority;                /* flow wins where flow set and jump set overlap (default: jump) */
    bool has_flow_set;                 /* false: flow is allowed everywhere */
    Stiffness stiffness;
    bool predictable;                  /* all inputs discrete: the next event follows from the state */
    size_t quadratures;                /* levels of the flow, if rates depend on states of lower levels only; else 0 */
    const double *x, *z, *u, *p;       /* start values; NULL where whoever runs the model has them */
    const double *nominals;            /* a usual size of each continuous state, 0 if none is declared */
    const bool *whole;                 /* of each discrete state: whether it is declared integer */
    ModelScales scales;
    ModelFunction start;               /* (t,x,z,u,p) -> x0, z0: start values that are computed; copies the others */
    ModelFunction flow;                /* -> dx/dt (n_states) */
    ModelFunction flow_set;            /* -> margin (1); used when has_flow_set */
    ModelFunction margins;             /* -> jump margins (n_margins) */
    ModelFunction times;               /* -> absolute times of the time events (n_times) */
    ModelFunction outputs;             /* -> y (n_outputs) */
    ModelReset reset;
    /* Derivatives along directions; after t, x, z, u, p come the seeds.
       forward: changes of t, x, z, u, p -> changes of dx/dt (n_states), y (n_outputs)
       reverse: weights of dx/dt, y -> sensitivities to t, x, z, u, p
       start_forward, start_reverse: the same of x0, z0 in place of dx/dt, y */
    ModelFunction forward, reverse, start_forward, start_reverse;
    /* -> d(dx/dt)/dx (n_states^2, by columns), d(dx/dt)/dt (n_states); NULL where `forward` is to do. */
    ModelFunction jacobian;
    /* Rates of quadratures that are affine in values which only jumps change, those at the places `held` in z and u,
       one after the other: -> the rates without them (n_states), n_factors functions of time, each a part of the rate
       `factor_rows` when multiplied by the value number `factor_columns` of those held.  They depend on nothing else
       than what is at the places `factor_keys` in z, u and p.  NULL, and no factors, where there are none. */
    ModelFunction factors;
    size_t n_factors, n_factor_keys;
    const uint32_t *held, *factor_rows, *factor_columns, *factor_keys;
    const ModelJump *jumps;            /* in the fixed order in which simultaneous ones are taken */
    const ModelName *state_names, *discrete_names, *margin_names;
    const char *names;                 /* heads and tails one after the other, each with its end */
} Model;

/* A name as a text that lives as long as the block in which this stands. */
#define NAME_SIZE 256
#define NAME_AT(names, name) engine_name((names), (name), (char[NAME_SIZE]){0})
const char *engine_name(const char *names, ModelName name, char text[NAME_SIZE]);

extern const Model model;

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
