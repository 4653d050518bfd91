/* Which flows are stiff: those declared so, and those on which an explicit method steps as stability allows and not as
   accuracy does.  After E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", section IV.2: once in a
   thousand steps the step is compared to the fastest time scale; where it is near the border of stability, so are the
   next ones.  A flow that was found to be stiff stays so: a run does not go back and forth between methods. */
#include "method.h"

/* In units of the fastest time scale Dormand-Prince 8(5, 3) is stable up to 6.1, about which the control of its steps
   keeps them; where accuracy decides about them, at tolerances of 1e-10 and less, they are mostly below 1. */
#define AT_BORDER 1.5
/* Twice before a run is given up for its pace, see PACE_STEPS in hybrid_model/scales.py. */
#define STEPS_BETWEEN_LOOKS 1000
#define SIGNS 15
#define SIGNS_AGAINST 6

void engine_choose_method(Engine *engine)
{
    const Model *m = engine->model;
    double wish = engine->options.stiff;
    /* Where no rate depends on its own state, nothing is stiff. */
    if (m->quadratures > 0)
        return;
    bool stiff = wish > 0.0 || (wish == 0.0 && (m->stiffness == STIFFNESS_DECLARED || engine->status->is_stiff));
    if (stiff && engine->implicit.jacobian)
        engine->method = &engine_rodas;
    else if (engine->method == &engine_rodas)
        engine->method = &engine_dormand_prince;
    engine->implicit.has_jacobian = false;
}

/* Looks at an accepted step of an explicit method; whether there are signs that it will be changed. */
static bool signs_of_stiffness(Engine *engine, const Point *point)
{
    Status *status = engine->status;
    if (engine->options.stiff != 0.0 || !engine_may_show_stiffness(engine->model))
        return false;
    if (status->signs_of_stiffness == 0 && ++status->steps_to_look < STEPS_BETWEEN_LOOKS)
        return false;
    status->steps_to_look = 0;
    if (engine->method->stiffness(engine, point) > AT_BORDER) {
        status->signs_against = 0;
        status->is_stiff = ++status->signs_of_stiffness >= SIGNS;
    } else if (++status->signs_against >= SIGNS_AGAINST || status->signs_of_stiffness == 0) {
        status->signs_of_stiffness = status->signs_against = 0;
    }
    return status->signs_of_stiffness > 0 && engine->implicit.jacobian;
}

void engine_watch_stiffness(Engine *engine, const Point *point)
{
    if (!engine->method->stiffness || signs_of_stiffness(engine, point))
        engine_begin_pace(point);
}
