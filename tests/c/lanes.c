/* Factor and solve with and without vectors: prints the bits of the results. */
#include "hsep_cholesky.h"
#include "hsep_gram.h"
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
    enum { N = 23 };
    hsep_gram *gram = malloc((size_t)hsep_gram_size(N));
    double penalties[N], factor[(N + 1) * (N + 2) / 2], least[N + 1], w[N], side_by_side[N * HSEP_GRAM_ABREAST];
    double leverages[HSEP_GRAM_ABREAST];
    if (gram == NULL) {
        return 1;
    }
    hsep_gram_init(gram, N);
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
    printf("%a\n", hsep_gram_solve(gram, NULL, 1.0, penalties, N, factor, least, w));
    for (int i = 0; i < N * HSEP_GRAM_ABREAST; i++) {
        side_by_side[i] = next();
    }
    hsep_gram_leverages(factor, N, side_by_side, leverages);
    hsep_cholesky_solve(factor, N + 1, least);
    for (int i = 0; i < N; i++) {
        printf("%a %a\n", w[i], least[i]);
    }
    printf("%a %d\n", leverages[0] + leverages[3], HSEP_LANES);
    free(gram);
    return 0;
}
