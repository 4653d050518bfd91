/* Rodas5P: a Rosenbrock-Wanner method of order 5(4), A-stable and stiffly accurate, for flows with widely different
   time scales.

   G. Steinebach, "Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia
   Differential Equations package", BIT Numerical Mathematics 63:27, 2023; in the form without products of matrix and
   vector of E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", section IV.7:

       (I/(gamma h) - J) u_i = f(t0 + c_i h, x0 + sum_j a_ij u_j) + sum_j (C_ij/h) u_j + d_i h df/dt,

   where J is the Jacobian of the flow at the start of the step.  The last stage is the difference to the solution of
   order 4, and its argument that solution. */
#include <math.h>

#include "method.h"

static const double GAMMA = 0.21193756319429014;
static const double NODE[STAGES_OF_RODAS] = {
    0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0,
};
static const double DRIFT[STAGES_OF_RODAS] = {
    0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0.0, 0.0,
    0.0,
};
static const double STATE[STAGES_OF_RODAS][STAGES_OF_RODAS - 1] = {
    {0.0},
    {3.0},
    {2.849394379747939, 0.45842242204463923},
    {-6.954028509809101, 2.489845061869568, -10.358996098473584},
    {2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641},
    {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946},
    {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0},
    {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0, 1.0},
};
static const double COUPLING[STAGES_OF_RODAS][STAGES_OF_RODAS - 1] = {
    {0.0},
    {-14.155112264123755},
    {-17.97296035885952, -2.859693295451294},
    {147.12150275711716, -1.41221402718213, 71.68940251302358},
    {165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306},
    {24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471},
    {30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
     -28.087943162872662},
    {37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
     -54.66780262877968, -9.48861652309627},
};
/* Of the interpolation x0 + a (change + b (e1 + a (e2 + a e3))), b = 1 - a. */
static const double DENSE[3][STAGES_OF_RODAS] = {
    {25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
     1.1241088310450404, 0.4272876194431874, -0.17202221070155493},
    {-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044,
     15.98066361424651, -6.789040303419874, -6.710236069923372},
    {11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654,
     -59.78993625266729, -0.15582684282751913, 4.883087185713722},
};

/* Factors of I/(gamma h) - J; false if there are none. */
static bool factorize(Engine *engine, double h)
{
    Implicit *of = &engine->implicit;
    size_t n = engine->model->n_states;
    if (of->factorized_for == h)
        return true;
    of->factorized_for = 0.0;
    for (size_t i = 0; i < n * n; i++)
        of->matrix[i] = -of->jacobian[i];
    for (size_t i = 0; i < n; i++)
        of->matrix[i * (n + 1)] += 1.0 / (GAMMA * h);
    if (!engine_factorize(n, of->matrix, of->pivots))
        return false;
    of->factorized_for = h;
    return true;
}

/* sum += (sum of the first `count` vectors of u with the weights) * factor. */
static void add(size_t n, double *sum, const double *u, const double *weights, size_t count, double factor)
{
    for (size_t j = 0; j < count; j++) {
        double weight = weights[j] * factor;
        for (size_t i = 0; i < n; i++)
            sum[i] += weight * u[j * n + i];
    }
}

/* The stages of a step from the start of the present one into u, and its end into x; the factors must be there. */
static bool stages(Engine *engine, const double *z, double t1, double *u, double *x)
{
    const Step *step = &engine->step;
    const Implicit *of = &engine->implicit;
    size_t n = engine->model->n_states;
    double h = t1 - step->t0;
    for (size_t s = 0; s < STAGES_OF_RODAS; s++) {
        double *stage = u + s * n, t = NODE[s] == 1.0 ? t1 : step->t0 + NODE[s] * h;
        engine_copy(x, step->x0, n);
        add(n, x, u, STATE[s], s, 1.0);
        if (s == 0)
            engine_copy(stage, step->k[0], n);
        else if (!engine_rates(engine, t, x, z, stage))
            return false;
        add(n, stage, u, COUPLING[s], s, 1.0 / h);
        for (size_t i = 0; i < n; i++)
            stage[i] += DRIFT[s] * h * of->drift[i];
        engine_solve(n, of->matrix, of->pivots, stage);
    }
    for (size_t i = 0; i < n; i++)
        x[i] += u[(STAGES_OF_RODAS - 1) * n + i];
    return true;
}

/* The error in units of the tolerance, infinite if anything is not finite. */
static double step_error(Engine *engine, const Point *point)
{
    const Step *step = &engine->step;
    size_t n = engine->model->n_states;
    const double *difference = engine->implicit.stages + (STAGES_OF_RODAS - 1) * n;
    double worst = 0.0;
    for (size_t i = 0; i < n; i++) {
        double size = fmax(fabs(step->x0[i]), fabs(step->x1[i]));
        double error = fabs(difference[i]) / engine_error_scale(engine, point, i, size);
        if (!isfinite(error) || !isfinite(step->x1[i])) {
            engine->suspect = i;
            return INFINITY;
        }
        if (error > worst) {
            worst = error;
            engine->suspect = i;
        }
    }
    return worst;
}

static bool trial(Engine *engine, const Point *point, double *error)
{
    Step *step = &engine->step;
    *error = INFINITY;
    if (!engine_jacobian(engine, point))
        return false;
    if (!factorize(engine, step->t1 - step->t0))
        return true;
    if (!stages(engine, point->z, step->t1, engine->implicit.stages, step->x1))
        return false;
    engine->largest = engine_largest_state(engine, point, step->x1);
    *error = step_error(engine, point);
    return *error > 1.0 || engine_rates(engine, step->t1, step->x1, point->z, step->k[N_STAGES - 1]);
}

static bool probe(Engine *engine, const Point *point, double t)
{
    double h = t - engine->step.t0;
    if (h == 0.0)
        engine_copy(engine->probe_x, engine->step.x0, engine->model->n_states);
    if (h == 0.0)
        return true;
    if (!engine_jacobian(engine, point))
        return false;
    if (!factorize(engine, h))
        return engine_fail(engine, ENDED_FAILED,
                           "The linear equations of a step of %g s of '%s' have no solution at t = %.17g. Remedy: "
                           "check the flow map for a pole.",
                           h, engine->model->name, engine->step.t0);
    return stages(engine, point->z, t, engine->implicit.probe_stages, engine->probe_x);
}

static void prepare(Engine *engine)
{
    const Step *step = &engine->step;
    const double *u = engine->implicit.stages;
    size_t n = engine->model->n_states;
    double *of = step->vectors;
    for (size_t i = 0; i < n; i++) {
        double e[3] = {0.0, 0.0, 0.0};
        for (size_t s = 0; s < STAGES_OF_RODAS; s++)
            for (size_t k = 0; k < 3; k++)
                e[k] += DENSE[k][s] * u[s * n + i];
        of[i] = step->x0[i];
        of[n + i] = step->x1[i] - step->x0[i];
        of[2 * n + i] = e[0];
        of[3 * n + i] = e[1] + e[2];
        of[4 * n + i] = -e[2];
        for (size_t k = 5; k < NESTED_VECTORS; k++)
            of[k * n + i] = 0.0;
    }
}

const Method engine_rodas = {
    .n_vectors = NESTED_VECTORS,
    .order = 5.0,
    .finest_tolerance = 1e-12,
    /* The error of the interpolation is some ten times that of the step, and falls with the fifth power. */
    .segment_part = 0.35,
    .trial = trial,
    .probe = probe,
    .prepare = prepare,
    .interpolate = engine_interpolate_nested,
    .straight = engine_straight_nested,
};
