/* The functions of chebyshev.c, where a test can call them. */
#include "chebyshev.c"

#define SEEN __attribute__((visibility("default")))

SEEN double node(size_t j)
{
    return engine_node(j);
}

SEEN size_t integrated(size_t n, size_t stride, double h, const double *x0, const double *rates, double *states,
                       double *tails)
{
    return engine_integrate_series(n, stride, h, x0, rates, states, tails);
}

SEEN void at_nodes(const double *series, size_t n_terms, size_t n, size_t stride, double *values)
{
    engine_series_at_nodes(series, n_terms, n, stride, values);
}

SEEN void at_end(const double *series, size_t n_terms, size_t n, const double *x0, double *x)
{
    engine_series_at_end(series, n_terms, n, x0, x);
}

SEEN void at(const double *series, size_t n_terms, size_t n, double a, double *x)
{
    engine_series_at(series, n_terms, n, a, x);
}

SEEN void straight(const double *x0, const double *x1, size_t n, double *series)
{
    engine_straight_series(x0, x1, n, series);
}
