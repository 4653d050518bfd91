/* Chebyshev series on a step: see chebyshev.h. */
#include <float.h>
#include <math.h>

#include "chebyshev.h"

/* Terms of smooth rates fall from one to the next by no more than that, where a step is as long as they allow. */
#define FALLS 0.03

/* cos(pi m / FINEST) for m from 0 to FINEST. */
static const double COSINE[N_NODES] = {
    1.0, 0.9807852804032304, 0.9238795325112867, 0.8314696123025452, 0.7071067811865476, 0.5555702330196022,
    0.3826834323650898, 0.19509032201612828, 0.0, -0.19509032201612828, -0.3826834323650898, -0.5555702330196022,
    -0.7071067811865476, -0.8314696123025452, -0.9238795325112867, -0.9807852804032304, -1.0};

/* cos(pi m / FINEST) for any m. */
static double cosine(size_t m)
{
    size_t turned = m % (2 * FINEST);
    return COSINE[turned <= FINEST ? turned : 2 * FINEST - turned];
}

double engine_node(size_t j)
{
    return 0.5 * (1.0 - COSINE[j]);
}

static bool all_zero(const double *values, size_t n)
{
    size_t i = 0;
    while (i < n && values[i] == 0.0)
        i++;
    return i == n;
}

static void set_zero(double *values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        values[i] = 0.0;
}

/* Chebyshev coefficients of the polynomial through the values at the nodes of a grid: 2/degree times sums of them,
   weighted by cosines.  `even` holds the sums of values that lie opposite to each other, `odd` their differences. */
static void fit(const double *values, size_t degree, double *coefficients)
{
    size_t half = degree / 2, stride = FINEST / degree;
    double even[FINEST / 2 + 1], odd[FINEST / 2];
    even[half] = values[half];
    for (size_t j = 0; j < half; j++) {
        double share = j == 0 ? 0.5 : 1.0;
        even[j] = share * (values[degree - j] + values[j]);
        odd[j] = share * (values[degree - j] - values[j]);
    }
    for (size_t k = 0; k <= degree; k += 2) {
        double sum = 0.0;
        for (size_t j = 0; j <= half; j++)
            sum += even[j] * cosine(stride * j * k);
        coefficients[k] = 2.0 / (double)degree * sum;
    }
    for (size_t k = 1; k < degree; k += 2) {
        double sum = 0.0;
        for (size_t j = 0; j < half; j++)
            sum += odd[j] * cosine(stride * j * k);
        coefficients[k] = 2.0 / (double)degree * sum;
    }
    coefficients[0] *= 0.5;
    coefficients[degree] *= 0.5;
}

/* The last term that is no rounding of the others, nor of a state of that size. */
static size_t last_term(const double *terms, size_t last, double size)
{
    for (size_t k = 1; k <= last; k++)
        size = fmax(size, fabs(terms[k]));
    while (isfinite(size) && last > 0 && fabs(terms[last]) <= 0.125 * DBL_EPSILON * size)
        last--;
    return last;
}

/* The last two terms; those of rates that jump to and fro may both be zero, where some before them are larger than
   those of smooth rates can be. */
static double tail(const double *terms, size_t degree)
{
    double size = fabs(terms[degree - 1]) + fabs(terms[degree]), weight = 1.0;
    for (size_t k = degree - 1; k-- > degree / 2;) {
        weight *= FALLS;
        size = fmax(size, weight * fabs(terms[k]));
    }
    return size;
}

size_t engine_integrate_series(size_t n, size_t stride, double h, const double *x0, const double *rates, double *states,
                               double *tails)
{
    size_t degree = FINEST / stride, n_terms = 1;
    double of[N_SERIES + 1] = {0.0}, values[N_NODES], terms[N_SERIES];
    for (size_t i = 0; i < n; i++) {
        /* The rate at the start apart: what is constant stays so. */
        double first = rates[i];
        for (size_t j = 0; j <= degree; j++)
            values[j] = rates[j * stride * n + i] - first;
        if (all_zero(values, degree + 1))
            set_zero(of, degree + 1);
        else
            fit(values, degree, of);
        of[0] += first;
        of[degree + 1] = of[degree + 2] = 0.0;
        for (size_t k = 1; k <= degree + 1; k++) {
            double before = k == 1 ? of[0] : 0.5 * of[k - 1];
            terms[k] = 0.5 * h * (before - 0.5 * of[k + 1]) / (double)k;
        }
        size_t last = last_term(terms, degree + 1, fabs(x0[i]));
        n_terms = last >= n_terms ? last + 1 : n_terms;
        double constant = x0[i];
        for (size_t k = 1; k <= last; k++)
            constant += k % 2 == 1 ? terms[k] : -terms[k];
        states[i] = constant;
        for (size_t k = 1; k < N_SERIES; k++)
            states[k * n + i] = k <= last ? terms[k] : 0.0;
        tails[i] = 0.5 * fabs(h) * tail(of, degree);
    }
    return n_terms;
}

void engine_series_at_nodes(const double *series, size_t n_terms, size_t n, size_t stride, double *values)
{
    for (size_t j = stride; j <= FINEST; j += stride)
        for (size_t i = 0; i < n; i++) {
            double sum = series[i];
            for (size_t k = 1; k < n_terms; k++)
                sum += (k % 2 == 1 ? -1.0 : 1.0) * series[k * n + i] * cosine(j * k);
            values[j * n + i] = sum;
        }
}

void engine_series_at_end(const double *series, size_t n_terms, size_t n, const double *x0, double *x)
{
    for (size_t i = 0; i < n; i++) {
        double sum = 0.0;
        for (size_t k = 1; k < n_terms; k += 2)
            sum += series[k * n + i];
        x[i] = x0[i] + 2.0 * sum;
    }
}

/* Clenshaw's recurrence for the even and for the odd terms, side by side: T_2k(s) is T_k(y) with y = 2 s^2 - 1, and
   T_2k+1(s) is s times a polynomial in y that obeys the same recurrence. */
void engine_series_at(const double *series, size_t n_terms, size_t n, double a, double *x)
{
    double s = 2.0 * a - 1.0, y = 2.0 * s * s - 1.0, twice = 2.0 * y;
    for (size_t i = 0; i < n; i++) {
        double even1 = 0.0, even2 = 0.0, odd1 = 0.0, odd2 = 0.0;
        const double *of = series + i;
        for (size_t k = (n_terms + 1) / 2; k-- > 1;) {
            double even = twice * even1 + (of[2 * k * n] - even2), odd = twice * odd1 + (of[(2 * k + 1) * n] - odd2);
            even2 = even1, even1 = even;
            odd2 = odd1, odd1 = odd;
        }
        x[i] = of[0] + y * even1 - even2 + s * (of[n] + (twice - 1.0) * odd1 - odd2);
    }
}

/* Samples side by side, an even number of them, since processors take two at a time. */
#define SIDE_BY_SIDE (N_SAMPLES - 1)

static void series_side_by_side(const double *of, size_t n_terms, size_t n, const double *parts, double *x)
{
    double s[SIDE_BY_SIDE], twice[SIDE_BY_SIDE];
    double even1[SIDE_BY_SIDE] = {0.0}, even2[SIDE_BY_SIDE] = {0.0};
    double odd1[SIDE_BY_SIDE] = {0.0}, odd2[SIDE_BY_SIDE] = {0.0};
    for (size_t i = 0; i < SIDE_BY_SIDE; i++) {
        s[i] = 2.0 * parts[i] - 1.0;
        twice[i] = 2.0 * (2.0 * s[i] * s[i] - 1.0);
    }
    for (size_t k = (n_terms + 1) / 2; k-- > 1;) {
        double even_term = of[2 * k * n], odd_term = of[(2 * k + 1) * n];
        for (size_t i = 0; i < SIDE_BY_SIDE; i++) {
            double even = twice[i] * even1[i] + (even_term - even2[i]);
            double odd = twice[i] * odd1[i] + (odd_term - odd2[i]);
            even2[i] = even1[i];
            odd2[i] = odd1[i];
            even1[i] = even;
            odd1[i] = odd;
        }
    }
    for (size_t i = 0; i < SIDE_BY_SIDE; i++)
        x[i * n] = of[0] + 0.5 * twice[i] * even1[i] - even2[i] +
                   s[i] * (of[n] + (twice[i] - 1.0) * odd1[i] - odd2[i]);
}

void engine_series_at_samples(const double *series, size_t n_terms, size_t n, const double *parts, double *x)
{
    for (size_t state = 0; state < n; state++) {
        if (n_terms > 1)
            series_side_by_side(series + state, n_terms, n, parts, x + state);
        for (size_t i = 0; n_terms == 1 && i < SIDE_BY_SIDE; i++)
            x[i * n + state] = series[state];
    }
}

void engine_straight_series(const double *x0, const double *x1, size_t n, double *series)
{
    for (size_t i = 0; i < n; i++) {
        series[i] = x0[i] + 0.5 * (x1[i] - x0[i]);
        series[n + i] = 0.5 * (x1[i] - x0[i]);
        for (size_t k = 2; k < N_SERIES; k++)
            series[k * n + i] = 0.0;
    }
}
