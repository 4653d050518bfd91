/* Where a margin rises through a threshold along the interpolation of a step.

   A piece of the step is sampled at Chebyshev points.  The polynomial through the samples has
   Bernstein coefficients that enclose it, and Chebyshev coefficients whose tail tells how well it
   represents the margin.  Both together exclude a rise, or show that the margin is monotone so that
   the ends of the piece decide, or the piece is halved and its first half looked at first.  The
   decisions are those of hybrid_model/reference/zero_crossings.py. */
#include <math.h>

#include "search.h"

/* Chebyshev-Lobatto points on [0, 1]. */
static const double POINTS[N_SAMPLES] = {
    0.0, 0.038060233744356624, 0.14644660940672624, 0.30865828381745514, 0.5,
    0.6913417161825449, 0.8535533905932737, 0.9619397662556434, 1.0};

/* What each sample contributes to the Bernstein coefficients of the polynomial through all of them, and
   to four times its last two Chebyshev coefficients: beside a kink the error of the polynomial is twice
   their size.  Lines are samples, so that the sums are independent. */
static const double CONTRIBUTION[N_SAMPLES][N_SAMPLES + 2] = {
    {1.0, -4.375, 9.75, -12.767857142857142, 10.214285714285714,
     -4.875, 1.25, -0.125, 0.0,
     -0.5, 0.25},
    {0.0, 6.568535592272045, -18.25275486114713, 25.51152560426028, -20.91764997160261,
     10.084413377918832, -2.5959773527034806, 0.259891532474145, 0.0,
     0.9238795325112867, -0.5},
    {0.0, -1.7071067811865475, 14.22828282092095, -25.112909700267398, 22.4,
     -11.172804585446888, 2.914574321936191, -0.2928932188134525, 0.0,
     -0.7071067811865476, 0.5},
    {0.0, 0.8099572022108875, -7.581239029125371, 23.09799209414256, -24.7966357426831,
     13.306068923678326, -3.570028757024018, 0.3616156730429224, 0.0,
     0.3826834323650898, -0.5},
    {0.0, -0.5, 4.857142857142857, -17.071428571428573, 27.2,
     -17.071428571428573, 4.857142857142857, -0.5, 0.0,
     0.0, 0.5},
    {0.0, 0.3616156730429224, -3.570028757024018, 13.306068923678326, -24.7966357426831,
     23.09799209414256, -7.581239029125371, 0.8099572022108875, 0.0,
     -0.3826834323650898, -0.5},
    {0.0, -0.2928932188134525, 2.914574321936191, -11.172804585446888, 22.4,
     -25.112909700267398, 14.22828282092095, -1.7071067811865475, 0.0,
     0.7071067811865476, 0.5},
    {0.0, 0.259891532474145, -2.5959773527034806, 10.084413377918832, -20.91764997160261,
     25.51152560426028, -18.25275486114713, 6.568535592272045, 0.0,
     -0.9238795325112867, -0.5},
    {0.0, -0.125, 1.25, -4.875, 10.214285714285714,
     -12.767857142857142, 9.75, -4.375, 1.0,
     0.5, 0.25},
};

/* Above the sum of the weights' sizes in any Bernstein coefficient, 164, and in both of the tail, 10. */
#define BEND_FACTOR 200.0

/* What samples tell: whether they settle where the first rise of the piece is, and the samples around
   it.  Without a rise both indices are equal. */
typedef struct {
    bool settled;
    size_t low, high;
} Verdict;

double engine_sample_time(double a, double b, size_t i)
{
    return i + 1 == N_SAMPLES ? b : a + (b - a) * POINTS[i];
}

static Verdict between_samples(bool settled, const double *samples)
{
    for (size_t i = 0; i + 1 < N_SAMPLES; i++)
        if (samples[i] < 0.0 && samples[i + 1] >= 0.0)
            return (Verdict){settled, i, i + 1};
    return (Verdict){settled, 0, 0};
}

static bool all_finite(const double *samples)
{
    size_t i = 0;
    while (i < N_SAMPLES && isfinite(samples[i]))
        i++;
    return i == N_SAMPLES;
}

/* A quick exclusion, which implies that of judge: most margins are nearly straight and far below zero.
   The Bernstein coefficients of a straight line lie between its ends, and what bends away from the line
   changes them and the tail by less than BEND_FACTOR times the largest deviation of a sample. */
static bool far_below(const double *samples)
{
    double a = samples[0], b = samples[DEGREE], bend = 0.0;
    for (size_t i = 1; i < DEGREE; i++) {
        double deviation = fabs(samples[i] - (a + (b - a) * POINTS[i]));
        bend = deviation > bend ? deviation : bend;
    }
    return (a > b ? a : b) + BEND_FACTOR * bend < 0.0;
}

static Verdict judge(const double *samples)
{
    double bounds[N_SAMPLES + 2] = {0.0};
    bool below = true, above = true, rising = true, falling = true;
    if (!all_finite(samples))
        return between_samples(true, samples);
    if (far_below(samples))
        return (Verdict){true, 0, 0};
    for (size_t k = 0; k < N_SAMPLES; k++)
        for (size_t i = 0; i < N_SAMPLES + 2; i++)
            bounds[i] += CONTRIBUTION[k][i] * samples[k];
    double tail = fabs(bounds[N_SAMPLES]) + fabs(bounds[N_SAMPLES + 1]);
    for (size_t i = 0; i < N_SAMPLES; i++) {
        below = below && bounds[i] + tail < 0.0;
        above = above && bounds[i] - tail >= 0.0;
    }
    if (below || above)
        return (Verdict){true, 0, 0};
    /* The derivative of the polynomial is off by up to the degree squared times the tail, its
       coefficients are the differences times the degree. */
    for (size_t i = 0; i < DEGREE; i++) {
        double difference = bounds[i + 1] - bounds[i];
        rising = rising && difference > DEGREE * tail;
        falling = falling && difference < -DEGREE * tail;
    }
    if (rising || falling)
        return (Verdict){true, 0, samples[0] < 0.0 && samples[DEGREE] >= 0.0 ? DEGREE : 0};
    return between_samples(false, samples);
}

void engine_begin_rises(Rises *rises, Search *search, size_t row, double threshold)
{
    const Step *step = &search->engine->step;
    rises->search = search;
    rises->row = row;
    rises->threshold = threshold;
    rises->begin = step->t0;
    rises->value = engine_sample(search, 0, row) - threshold;
    rises->ends[0] = step->t1;
    rises->n_ends = 1;
    rises->halvings = 0;
}

/* The row at the points of the piece from rises->begin to `end`. */
static void sample_piece(const Rises *rises, double end, double *samples)
{
    Search *search = rises->search;
    const Step *step = &search->engine->step;
    bool whole = rises->begin == step->t0 && end == step->t1;
    samples[0] = rises->value;
    for (size_t i = 1; i < N_SAMPLES; i++) {
        double value =
            whole ? engine_sample(search, i, rises->row)
                  : engine_look_at(search, ON_INTERPOLATION, engine_sample_time(rises->begin, end, i), rises->row);
        samples[i] = value - rises->threshold;
    }
}

bool engine_next_rise(Rises *rises, double latest, Bracket *bracket)
{
    double samples[N_SAMPLES];
    while (rises->n_ends > 0 && rises->begin <= latest) {
        double begin = rises->begin, end = rises->ends[rises->n_ends - 1];
        sample_piece(rises, end, samples);
        if (rises->search->failed)
            return false;
        Verdict verdict = judge(samples);
        double shortest = DEGREE * DEGREE * fmax(engine_time_ulp(begin), engine_time_ulp(end));
        if (!verdict.settled && rises->halvings < HALVINGS && end - begin > shortest) {
            rises->halvings++;
            rises->ends[rises->n_ends++] = 0.5 * (begin + end);
            continue;
        }
        rises->n_ends--;
        rises->begin = end;
        rises->value = samples[DEGREE];
        if (verdict.low < verdict.high) {
            *bracket = (Bracket){engine_sample_time(begin, end, verdict.low), samples[verdict.low],
                                 engine_sample_time(begin, end, verdict.high), samples[verdict.high]};
            return true;
        }
    }
    return false;
}
