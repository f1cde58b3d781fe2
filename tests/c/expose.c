/* What the tests reach through ctypes besides the models' own functions. */
#include "hsep_fmu.h"
#include "hsep_predictor.h"

#include <stddef.h>
#include <string.h>

const hsep_context *test_table(void);

const hsep_context *test_table(void) { return &hsep_table; }

/* test_fold, test_fold_gram: fold rows, (n_rows, n + 1), over and over. */
#define FOLD(name, kind) \
    void name(hsep_##kind *self, const double rows[], size_t n_rows, size_t repetitions); \
    void name(hsep_##kind *self, const double rows[], size_t n_rows, size_t repetitions) \
    { \
        const size_t width = (size_t)self->n + 1; \
        for (size_t i = 0; i < repetitions * n_rows; i++) { \
            memcpy(hsep_##kind##_row(self), rows + (i % n_rows) * width, width * sizeof(double)); \
            hsep_##kind##_fold(self); \
        } \
    }
FOLD(test_fold, regression)
FOLD(test_fold_gram, gram)
