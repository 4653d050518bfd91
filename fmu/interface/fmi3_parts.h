/* What the files of the FMI 3.0 layer share. */
#ifndef HYBRID_FMI3_PARTS_H
#define HYBRID_FMI3_PARTS_H

#include "fmi3Functions.h"
#include "instance.h"

/* An answer as a status of FMI 3.0: the numbers are the same. */
static inline fmi3Status status_of(Answer answer)
{
    return (fmi3Status)answer;
}

#endif
