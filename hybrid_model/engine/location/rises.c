/* Where a margin rises through a threshold along the interpolation of a step.

   A piece of the step is sampled at Chebyshev points.  The polynomial through the samples has
   Bernstein coefficients that enclose it, and Chebyshev coefficients whose tail tells how well it
   represents the margin.  Both together exclude a rise, or show that the margin is monotone or bent one
   way so that the ends of the piece decide, or the piece is split and its first part looked at first.
   hybrid_model/reference/zero_crossings.py finds the same, with halvings. */
#include <math.h>

#include "method.h"
#include "search.h"

const double engine_points[N_SAMPLES] = {
    0.0, 0.038060233744356624, 0.14644660940672624, 0.30865828381745514, 0.5,
    0.6913417161825449, 0.8535533905932737, 0.9619397662556434, 1.0};

/* An even number, since processors take two at a time. */
#define N_BOUNDS (N_SAMPLES + 3)

/* What each sample contributes to the Bernstein coefficients of the polynomial through all of them, and
   to four times its last two Chebyshev coefficients: beside a kink the error of the polynomial is twice
   their size.  Lines are samples, so that the sums are independent. */
static const double CONTRIBUTION[N_SAMPLES][N_BOUNDS] = {
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
/* So many tails in a difference of the coefficients, and in a difference of differences, may be error. */
#define SLOPE_TAILS DEGREE
#define CURVE_TAILS 96.0
/* Four times (2 * 164 + 10 SLOPE_TAILS), and 28 times (4 * 164 + 10 CURVE_TAILS), and more. */
#define BEND_IN_SLOPE 2000.0
#define BEND_IN_CURVE 50000.0

/* What samples tell: whether they settle where the first rise of the piece is, and the samples around
   it.  Without a rise both indices are equal. */
typedef struct {
    bool settled;
    size_t low, high;
} Verdict;

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

/* What is known of the shape of a margin between its ends. */
typedef struct {
    bool below, above, rising, falling, convex, concave;
} Shape;

/* A margin that is monotone, convex from below zero or to below it, or concave from above or to above, rises once or
   never: its ends decide. */
static bool ends_decide(const Shape *shape, const double *samples, Verdict *verdict)
{
    bool begins_below = samples[0] < 0.0, ends_below = samples[DEGREE] < 0.0;
    bool never = shape->below || shape->above;
    *verdict = (Verdict){true, 0, !never && begins_below && !ends_below ? DEGREE : 0};
    return never || shape->rising || shape->falling || (shape->convex && (begins_below || ends_below)) ||
           (shape->concave && !(begins_below && ends_below));
}

/* The shape of most margins, those that are nearly a parabola, quickly: `polynomial` would find the same.  A parabola
   has three Bernstein coefficients, and its coefficients of degree eight lie between them, with differences of at
   least a quarter of theirs and differences of those of a 28th of theirs.  What bends away from it changes them and
   the tail by less than the largest deviation of a sample times the factors above. */
static Shape parabola(const double *samples)
{
    double a = samples[0], b = samples[DEGREE], middle = 2.0 * samples[DEGREE / 2] - 0.5 * (a + b), bend = 0.0;
    double first = middle - a, second = b - middle;
    for (size_t i = 1; i < DEGREE; i++) {
        double along = engine_points[i], of_parabola = a + along * (2.0 * first + along * (second - first));
        double deviation = fabs(samples[i] - of_parabola);
        bend = deviation > bend ? deviation : bend;
    }
    double least = a < b ? a : b, most = a > b ? a : b, slope = BEND_IN_SLOPE * bend, curve = BEND_IN_CURVE * bend;
    return (Shape){.below = (middle > most ? middle : most) + BEND_FACTOR * bend < 0.0,
                   .above = (middle < least ? middle : least) - BEND_FACTOR * bend >= 0.0,
                   .rising = first > slope && second > slope,
                   .falling = first < -slope && second < -slope,
                   .convex = second - first > curve,
                   .concave = second - first < -curve};
}

static Shape polynomial(const double *samples)
{
    double bounds[N_BOUNDS] = {0.0};
    Shape shape = {true, true, true, true, true, true};
    for (size_t k = 0; k < N_SAMPLES; k++)
        for (size_t i = 0; i < N_BOUNDS; i++)
            bounds[i] += CONTRIBUTION[k][i] * samples[k];
    double tail = fabs(bounds[N_SAMPLES]) + fabs(bounds[N_SAMPLES + 1]);
    for (size_t i = 0; i < N_SAMPLES; i++) {
        shape.below = shape.below && bounds[i] + tail < 0.0;
        shape.above = shape.above && bounds[i] - tail >= 0.0;
    }
    /* That decides by itself. */
    if (shape.below || shape.above)
        return shape;
    /* The derivative of the polynomial is off by up to the degree squared times the tail, its coefficients are the
       differences times the degree; and so on. */
    for (size_t i = 0; i < DEGREE; i++) {
        double slope = bounds[i + 1] - bounds[i];
        shape.rising = shape.rising && slope > SLOPE_TAILS * tail;
        shape.falling = shape.falling && slope < -SLOPE_TAILS * tail;
    }
    for (size_t i = 1; i < DEGREE; i++) {
        double curve = bounds[i + 1] - 2.0 * bounds[i] + bounds[i - 1];
        shape.convex = shape.convex && curve > CURVE_TAILS * tail;
        shape.concave = shape.concave && curve < -CURVE_TAILS * tail;
    }
    return shape;
}

static Verdict judge(const double *samples, bool is_exact)
{
    Verdict verdict;
    if (!all_finite(samples))
        return between_samples(true, samples);
    Shape shape = parabola(samples);
    bool settled = ends_decide(&shape, samples, &verdict);
    if (!settled) {
        shape = polynomial(samples);
        settled = ends_decide(&shape, samples, &verdict);
    }
    /* A step that is known at its ends only is looked at between them, another one between the nearest samples. */
    bool nearest = !settled || (is_exact && verdict.low < verdict.high);
    return nearest ? between_samples(settled, samples) : verdict;
}

/* Where a piece that is not settled is split, as a part of it: where it has a kink, if it has one, so that what is left
   of the kink lies at an end and weighs little.  That is where the parabolas through neighbouring samples on both sides
   meet, at the place where the lines through them differ most in slope. */
static double split_point(const double *samples)
{
    double slopes[DEGREE], most = 0.0, at = 0.5;
    size_t gap = 0;
    for (size_t i = 0; i < DEGREE; i++)
        slopes[i] = (samples[i + 1] - samples[i]) / (engine_points[i + 1] - engine_points[i]);
    for (size_t i = 2; i + 2 < DEGREE; i++) {
        double turn = fabs(slopes[i + 1] - slopes[i - 1]);
        gap = turn > most ? i : gap;
        most = turn > most ? turn : most;
    }
    if (gap == 0)
        return at;
    const double *x = engine_points + gap;
    double left_bend = (slopes[gap - 1] - slopes[gap - 2]) / (x[0] - x[-2]);
    double right_bend = (slopes[gap + 2] - slopes[gap + 1]) / (x[3] - x[1]);
    double left = slopes[gap - 1] + (x[0] - x[-1]) * left_bend, right = slopes[gap + 1] - (x[2] - x[1]) * right_bend;
    at = 0.5 * (x[0] + x[1]);
    for (int i = 0; i < 2; i++) {
        double a = at - x[0], b = at - x[1];
        double apart = samples[gap] + a * (left + a * left_bend) - (samples[gap + 1] + b * (right + b * right_bend));
        at -= apart / (left + 2.0 * a * left_bend - (right + 2.0 * b * right_bend));
        at = fmin(fmax(at, x[0]), x[1]);
    }
    return at;
}

static void begin(Rises *rises, Search *search, size_t row, double threshold, double start, double value)
{
    rises->search = search;
    rises->row = row;
    rises->threshold = threshold;
    rises->sampled = false;
    rises->begin = start;
    rises->value = value - threshold;
    rises->ends[0] = search->end;
    rises->n_ends = 1;
    rises->splits = 0;
}

void engine_begin_rises(Rises *rises, Search *search, size_t row, double threshold)
{
    begin(rises, search, row, threshold, search->begin, engine_sample(search, 0, row));
    rises->sampled = true;
}

void engine_begin_rises_of_step(Rises *rises, Search *search, size_t row, double threshold)
{
    double t0 = search->engine->step.t0;
    begin(rises, search, row, threshold, t0, engine_look_at(search, ON_INTERPOLATION, t0, row));
}

/* The row at the points of the piece from rises->begin to `end`. */
static void sample_piece(const Rises *rises, double end, double *samples)
{
    Search *search = rises->search;
    bool whole = rises->sampled && rises->begin == search->begin && end == search->end;
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
        Verdict verdict = judge(samples, rises->search->engine->method->is_exact);
        double shortest = DEGREE * DEGREE * fmax(engine_time_ulp(begin), engine_time_ulp(end));
        if (!verdict.settled && rises->splits < SPLITS && end - begin > shortest) {
            double part = rises->splits++ % 4 < 3 ? split_point(samples) : 0.5;
            rises->ends[rises->n_ends++] = begin + part * (end - begin);
            continue;
        }
        rises->search->unsettled = rises->search->unsettled || (!verdict.settled && rises->splits == SPLITS);
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
