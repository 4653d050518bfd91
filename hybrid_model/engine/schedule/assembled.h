/* What the files of assemblies share. */
#ifndef HYBRID_ASSEMBLED_H
#define HYBRID_ASSEMBLED_H

#include "schedule.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

struct Assembled {
    const Assembly *of;
    Schedule *schedule;
    Engine *whole;
    double target;               /* of the present advance */
    bool filled;                 /* the whole holds states of the parts, */
    bool mirrored;               /* their present ones */
    JumpHook jump_hook;
    void *jump_context;
    StepHook hook;
    void *hook_context;
};

/* The run is over: the whole says why; always false. */
bool assembled_over(Assembled *assembled);
/* Receptions and breakpoints that are due without a jump; the part whose jump comes next, NOBODY if none does, and the
   instant is over. */
bool assembled_settle(Assembled *assembled, uint32_t *next);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
