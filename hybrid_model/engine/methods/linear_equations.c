/* Systems of linear equations by factors L and U of a dense matrix with partial pivoting, in the order of columns.

   G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition, section 3.4. */
#include <math.h>

#include "method.h"

/* The row, from k on, with the largest element of a column. */
static size_t pivot_row(size_t n, const double *column, size_t k)
{
    size_t best = k;
    for (size_t i = k + 1; i < n; i++)
        if (fabs(column[i]) > fabs(column[best]))
            best = i;
    return best;
}

static void swap(double *a, double *b)
{
    double kept = *a;
    *a = *b;
    *b = kept;
}

/* column -= factor * lower from row k + 1 on; most columns of large systems have zeros there. */
static void eliminate(size_t n, double *column, const double *lower, size_t k)
{
    double factor = column[k];
    if (factor == 0.0)
        return;
    for (size_t i = k + 1; i < n; i++)
        column[i] -= factor * lower[i];
}

bool engine_factorize(size_t n, double *matrix, size_t *pivots)
{
    for (size_t k = 0; k < n; k++) {
        double *column = matrix + k * n;
        size_t row = pivots[k] = pivot_row(n, column, k);
        if (!isfinite(column[row]) || column[row] == 0.0)
            return false;
        for (size_t j = 0; j < n && row != k; j++)
            swap(&matrix[j * n + k], &matrix[j * n + row]);
        for (size_t i = k + 1; i < n; i++)
            column[i] /= column[k];
        for (size_t j = k + 1; j < n; j++)
            eliminate(n, matrix + j * n, column, k);
    }
    return true;
}

void engine_solve(size_t n, const double *factors, const size_t *pivots, double *x)
{
    for (size_t k = 0; k < n; k++) {
        if (pivots[k] != k)
            swap(&x[k], &x[pivots[k]]);
        eliminate(n, x, factors + k * n, k);
    }
    for (size_t k = n; k-- > 0;) {
        const double *column = factors + k * n;
        x[k] /= column[k];
        for (size_t i = 0; i < k; i++)
            x[i] -= x[k] * column[i];
    }
}
