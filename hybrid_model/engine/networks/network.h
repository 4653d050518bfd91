/* Networks as loops over tables: many parts with few different maps.

   The parts of one group share their functions; what tells the members of a group apart are the places of their
   vectors in those of the network, the sources of their inputs, and constants.  Only the tables are generated. */
#ifndef HYBRID_NETWORK_H
#define HYBRID_NETWORK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "model.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* A map and its derivatives.  Arguments of `value`: t, x, z, u, p of the part, and its constants; `forward` takes the
   tangents of t, x, z, u, p after them and gives those of the results; `reverse` takes the adjoints of the results
   after them and gives those of t, x, z, u, p. */
typedef struct {
    ModelFunction value, forward, reverse;
} NetworkMap;

typedef struct {
    size_t n_states, n_discrete, n_inputs, n_parameters, n_outputs, n_margins, n_times;
    bool starts;                 /* some start value is computed */
    bool has_flow_set;
    NetworkMap start, flow, outputs;
    ModelFunction flow_set, margins, times;
    const ModelFunction *resets;
} NetworkGroup;

/* Places in the vectors of the network, each of the first element that is the part's. */
typedef struct {
    uint32_t group, x, z, p, y, margin, time, jump;
    uint32_t input;              /* in `sources` */
    uint32_t constant;           /* in `constants` */
} NetworkMember;

/* Consecutive outputs of the parts of a group that can be computed together. */
typedef struct {
    uint32_t first, count;
    NetworkMap map;
} NetworkPiece;

/* Evaluate a piece for a member, or, with NETWORK_START in place of a piece, its start values. */
typedef struct {
    uint32_t piece, member;
} NetworkCall;
#define NETWORK_START UINT32_MAX

/* A source of an input: a vector of the network, and the place in it. */
#define NETWORK_SOURCE_BITS 30
typedef enum { SOURCE_STATE, SOURCE_DISCRETE, SOURCE_INPUT, SOURCE_OUTPUT } NetworkSource;

typedef struct {
    size_t n_states, n_discrete, n_inputs, n_parameters, n_outputs;
    size_t n_members, n_calls, n_start_calls;
    size_t n_tape;               /* outputs that the calls of `start_calls` write */
    size_t most_states, most_discrete, most_inputs, most_parameters; /* of one part */
    const NetworkGroup *groups;
    const NetworkMember *members;
    const NetworkPiece *pieces;
    const NetworkCall *calls;       /* the outputs that inputs are wired to, sources first */
    const NetworkCall *start_calls; /* start values part by part, each after the outputs that it needs */
    const uint32_t *sources;
    const uint32_t *jump_member;
    const double *constants;
} Network;

/* Work arrays: arg holds NETWORK_ARG places and those of the parts' functions, res NETWORK_RES and theirs; w holds
   2 (n_states + n_discrete + n_outputs) + 1 + n_inputs + n_parameters + n_tape
   + 1 + most_states + most_discrete + 2 most_inputs + most_parameters places and those of the parts' functions. */
enum { NETWORK_ARG = 10, NETWORK_RES = 5 };

int network_start(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_flow(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_flow_set(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_margins(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_times(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_outputs(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_reset(const Network *network, size_t jump, const double **arg, double **res, long long *iw, double *w);
int network_forward(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_reverse(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_start_forward(const Network *network, const double **arg, double **res, long long *iw, double *w);
int network_start_reverse(const Network *network, const double **arg, double **res, long long *iw, double *w);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
