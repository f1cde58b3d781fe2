/* Factor and solve with and without vectors: prints the bits of the results. */
#include "hsep_cholesky.h"
#include "hsep_solution.h"
#include "hsep_vector.h"

#include <stdio.h>
#include <stdlib.h>

static double next(void)
{
    static unsigned long long state = 1;
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(state >> 11) / 9007199254740992.0 - 0.5;
}

int main(void)
{
    enum { N = 23, HEAD = 13, LATE = 6 };
    hsep_gram *gram = malloc((size_t)hsep_gram_size(N));
    hsep_solution *solution = malloc((size_t)hsep_solution_size(HEAD, N - HEAD, LATE));
    double leverages[HSEP_SOLUTION_ABREAST];
    if (gram == NULL || solution == NULL) {
        return 1;
    }
    hsep_gram_init(gram, N);
    hsep_solution_init(solution, HEAD, N - HEAD, LATE);
    double *penalties = hsep_at(solution, solution->penalties), *least = hsep_at(solution, solution->least);
    for (int k = 0; k < 99; k++) {
        double *row = hsep_gram_row(gram);
        for (int i = 0; i <= N; i++) {
            row[i] = next();
        }
        hsep_gram_fold(gram);
    }
    for (int i = 0; i < N; i++) {
        penalties[i] = 1e-3;
    }
    hsep_gram_settle(gram);
    hsep_solution_begin(solution, gram, NULL, 1.0);
    for (int k = 0; k < LATE; k++) {
        double row[N];
        for (int i = 0; i < N; i++) {
            row[i] = next();
        }
        hsep_solution_row(solution, row, next());
    }
    printf("%a\n", hsep_solution_finish(solution, 1));
    for (int i = 0; i < (N + 1) * HSEP_SOLUTION_ABREAST; i++) {
        hsep_at(solution, solution->work)[i] = next();
    }
    hsep_solution_leverages(solution, HSEP_SOLUTION_ABREAST, leverages);
    hsep_cholesky_solve(hsep_at(solution, solution->factor), N + 1, least);
    for (int i = 0; i < N; i++) {
        printf("%a %a\n", hsep_at(solution, solution->weights)[i], least[i]);
    }
    for (int c = 0; c < HSEP_SOLUTION_ABREAST; c++) {
        printf("%a\n", leverages[c]);
    }
    printf("%d\n", HSEP_LANES);
    free(solution);
    free(gram);
    return 0;
}
