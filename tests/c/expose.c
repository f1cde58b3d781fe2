/* What the tests reach through ctypes besides the models' own functions. */
#include "hsep_fmu.h"
#include "hsep_predictor.h"

#include <stddef.h>
#include <string.h>

const hsep_variable *test_variables(void);
void test_fold(hsep_regression *regression, const double rows[], size_t n_rows, size_t repetitions);

const hsep_context *test_table(void) { return &hsep_table; }

/* Fold rows, (n_rows, n + 1), over and over. */
void test_fold(hsep_regression *regression, const double rows[], size_t n_rows, size_t repetitions)
{
    const size_t width = (size_t)regression->n + 1;
    for (size_t i = 0; i < repetitions * n_rows; i++) {
        memcpy(hsep_regression_row(regression), rows + (i % n_rows) * width, width * sizeof(double));
        hsep_regression_fold(regression);
    }
}

void test_fold_gram(hsep_gram *gram, const double rows[], size_t n_rows, size_t repetitions);

/* The same into a Gram matrix. */
void test_fold_gram(hsep_gram *gram, const double rows[], size_t n_rows, size_t repetitions)
{
    const size_t width = (size_t)gram->n + 1;
    for (size_t i = 0; i < repetitions * n_rows; i++) {
        memcpy(hsep_gram_row(gram), rows + (i % n_rows) * width, width * sizeof(double));
        hsep_gram_fold(gram);
    }
}
