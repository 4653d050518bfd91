/* Inside network*.c: one part of a network at a time.

   Every part's states, parameters and outputs are consecutive in the vectors of the network, so that its functions
   read them where they are.  Only inputs are gathered: over wires, from states and outputs of other parts. */
#ifndef HYBRID_NETWORK_PART_H
#define HYBRID_NETWORK_PART_H

#include "network.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* The values of the network at one instant, or their tangents, or their adjoints.  A vector may be NULL: zeros. */
typedef struct {
    const double *t, *x, *z, *u, *p, *y;
} NetworkInstant;

typedef struct {
    double *t, *x, *z, *u, *p, *y;
} NetworkVectors;

/* What a call hands to the functions of the parts. */
typedef struct {
    const Network *network;
    const double **arg;
    double **res;
    long long *iw;
    double *w;
    double *x, *z, *y;           /* states at the start and outputs on the way, complete */
    NetworkVectors seeds;        /* their tangents, or all adjoints */
    double *tape;
    double *inputs, *seed_inputs;
    NetworkVectors part;         /* results for one part */
} NetworkWork;

/* The arrays that a function of the engine was called with, laid out. */
NetworkWork network_part_work(const Network *network, const double **arg, double **res, long long *iw, double *w);
NetworkInstant network_part_instant(const double *const *arg);

/* `count` numbers; without a source zeros, without a target nothing. */
void network_part_copy(size_t count, const double *source, double *target);
void network_part_clear(size_t count, double *target);
void network_part_add(size_t count, const double *source, double *target);

/* From an element of a vector on; nothing of no vector. */
const double *network_part_from(const double *vector, size_t first);

/* Where an input comes from: the vector (x, z, u, y) and the place in it. */
NetworkSource network_part_bank(uint32_t source);
size_t network_part_place(uint32_t source);

/* Hand t, x, z, u, p of a member to the function that is called next, or the tangents of these behind them. */
void network_part_bind(const NetworkWork *work, const NetworkMember *member, const NetworkInstant *values);
void network_part_bind_tangents(const NetworkWork *work, const NetworkMember *member, const NetworkInstant *tangents);
int network_part_call(const NetworkWork *work, ModelFunction function, double *first, double *second);

/* One piece of the outputs of a member, on the way; `tangents` may be NULL. */
int network_part_outputs(const NetworkWork *work, const NetworkCall *now, const NetworkInstant *values,
                         const NetworkInstant *tangents);

/* Complete an instant by the outputs that inputs are wired to. */
int network_part_wire(const NetworkWork *work, NetworkInstant *values, NetworkInstant *tangents);

/* Adjoints: set them to zero; pull those of a map's results to its arguments, into `work->part`; add these to the
   network's, except those of the states; pull those of a piece of outputs, and use them up; give all to the caller. */
void network_part_clear_adjoints(const NetworkWork *work);
int network_part_pull(const NetworkWork *work, const NetworkMember *member, const NetworkMap *map,
                      const NetworkInstant *values, const double *first, const double *second);
void network_part_give_back(const NetworkWork *work, const NetworkMember *member);
int network_part_pull_outputs(const NetworkWork *work, const NetworkCall *now, const NetworkInstant *values);
void network_part_hand_out(const NetworkWork *work, double **res);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
