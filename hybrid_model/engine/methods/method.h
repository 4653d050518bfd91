/* What a method of integration does with a step; the control of its length is the same for all, in integrate.c. */
#ifndef HYBRID_METHOD_H
#define HYBRID_METHOD_H

#include "parts.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Of an interpolation that meets the step at both ends: x0 + a (c + b (d0 + a (d1 + b (d2 + ...)))) with a from 0 to 1
   on the step and b = 1 - a, after E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I",
   section II.6. */
#define NESTED_VECTORS 8
#define STAGES_OF_RODAS 8

/* engine->step goes from (t0, x0), where its rates are in k[0].  The vectors of an interpolation lie one after the
   other, each of n_states numbers. */
struct Method {
    size_t n_vectors;         /* of its interpolation */
    double order;             /* the error of a step of h falls like h to this power */
    double finest_tolerance;  /* relative: below, rounding would decide about steps, or cost grows without use */
    bool is_exact;            /* the interpolation is the step itself */
    bool remembers;           /* steps need not begin short after a jump */
    double segment_part;      /* a step that communication points are read from is so much shorter than it may be */
    /* Whether a step from the point may be known without its rates; makes that step, at most to `limit`, with its
       states in step->x1.  NULL for methods that know none. */
    bool (*knows)(const Engine *engine, const Point *point);
    bool (*known)(Engine *engine, const Point *point, double limit);
    /* Makes the step to step->t1: the state there in step->x1, the rates there in step->k[N_STAGES - 1], and the error
       in units of the tolerance (engine_error_scale), infinite where anything is not finite, with the state that is to
       blame in engine->suspect.  False if a map cannot be evaluated. */
    bool (*trial)(Engine *engine, const Point *point, double *error);
    /* The state at any time of the accepted step, or a little beyond, into engine->probe_x: as exact as its end. */
    bool (*probe)(Engine *engine, const Point *point, double t);
    /* Makes the vectors of the interpolation of the accepted step: step->vectors. */
    void (*prepare)(Engine *engine);
    /* Evaluates vectors, of which those behind n_terms are zero, at the part a of a step, from 0 to 1. */
    void (*interpolate)(const double *vectors, size_t n_terms, size_t n_states, double a, double *x);
    /* The same for N_SAMPLES - 1 parts at once, whose states are put one after the other.  NULL where that spares
       nothing. */
    void (*interpolate_samples)(const double *vectors, size_t n_terms, size_t n_states, const double *parts, double *x);
    /* The vectors of the straight way from x0 to x1. */
    void (*straight)(const double *x0, const double *x1, size_t n_states, double *vectors);
    /* How many times the accepted step is longer than the fastest time scale that shows in it; NULL for methods whose
       steps that does not shorten. */
    double (*stiffness)(const Engine *engine, const Point *point);
};

extern const Method engine_dormand_prince, engine_rodas, engine_quadrature;

/* linear_equations.c */
/* Replaces a matrix, whose columns lie one after the other, by its factors; false if they are not finite or there are
   none. */
bool engine_factorize(size_t n, double *matrix, size_t *pivots);
/* Replaces a right-hand side by the solution. */
void engine_solve(size_t n, const double *factors, const size_t *pivots, double *x);

/* jacobian.c */
/* The derivatives of the flow at the start of the present step, if they are not there: engine->implicit. */
bool engine_jacobian(Engine *engine, const Point *point);

/* held_factors.c: steps of engine_quadrature that are known */
bool engine_knows_factors(const Engine *engine, const Point *point);
bool engine_step_of_factors(Engine *engine, const Point *point, double limit);

/* dense.c */
void engine_interpolate_nested(const double *vectors, size_t n_terms, size_t n_states, double a, double *x);
void engine_straight_nested(const double *x0, const double *x1, size_t n_states, double *vectors);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
