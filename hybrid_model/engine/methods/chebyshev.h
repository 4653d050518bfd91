/* Chebyshev series on a step: of rates at its nodes, of the states that they lead to, and their values.

   C. W. Clenshaw, A. R. Curtis, "A method for numerical integration on an automatic computer", Numerische Mathematik 2,
   1960; L. N. Trefethen, "Approximation Theory and Approximation Practice", 2013, chapters 3, 4 and 19.

   A series of vectors lies as its coefficients one after the other, each of n numbers; T_k is taken at 2 a - 1 where a
   goes from 0 to 1 on the step. */
#ifndef HYBRID_CHEBYSHEV_H
#define HYBRID_CHEBYSHEV_H

#include "parts.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Nodes are the Chebyshev-Lobatto points, from the start of the step to its end: of every coarser grid, each second
   node of the next finer one. */
#define FINEST 16
#define N_NODES (FINEST + 1)
/* Coefficients of the integral of a series through all nodes. */
#define N_SERIES (FINEST + 2)

/* Where node j of the finest grid lies, from 0 to 1. */
double engine_node(size_t j);
/* The integral from x0, in `states` (N_SERIES vectors), of the polynomial through the rates at each `stride`th node of
   a step of h; `rates` holds N_NODES vectors.  Returns the number of its terms, behind which there are zeros: what no
   state shows is dropped.  Returns in `tails` (one vector) the size of the integrals of the last two terms of the
   rates, without what cancels in them, or of a part of those before: far more than is neglected where coefficients
   fall, and about as much where the rates have a kink or jump. */
size_t engine_integrate_series(size_t n, size_t stride, double h, const double *x0, const double *rates, double *states,
                               double *tails);
/* Values of a series at each `stride`th node but the first. */
void engine_series_at_nodes(const double *series, size_t n_terms, size_t n, size_t stride, double *values);
/* The value of a series at its end, where the step began with x0. */
void engine_series_at_end(const double *series, size_t n_terms, size_t n, const double *x0, double *x);
/* The value of a series at the part a of the step. */
void engine_series_at(const double *series, size_t n_terms, size_t n, double a, double *x);
/* The values of a series at N_SAMPLES - 1 parts of the step, one vector after the other: each as by
   engine_series_at. */
void engine_series_at_samples(const double *series, size_t n_terms, size_t n, const double *parts, double *x);
/* The straight way from x0 to x1 as a series. */
void engine_straight_series(const double *x0, const double *x1, size_t n, double *series);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
