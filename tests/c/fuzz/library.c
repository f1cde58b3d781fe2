/* Fuzzer of the library's interface (libFuzzer): parameters, samples and saved bytes from the input.
 *
 * Small sizes, else any bits: a refusal is an answer, what a sanitizer finds is not. Positions are within what hsep.h
 * allows, and missing ones NaN.
 */
#include "hsep.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

typedef struct {
    const uint8_t *next;
    size_t left;
} source;

static uint8_t byte(source *from)
{
    if (from->left == 0) {
        return 0;
    }
    from->left--;
    return *from->next++;
}

/* A number within +- most. */
static double number(source *from, double most)
{
    const double high = byte(from), low = byte(from);
    return most * ((256.0 * high + low) / 32767.5 - 1.0);
}

static void choose(source *from, hsep_parameters *parameters, hsep_mode *mode)
{
    const double spread[4] = {1e-6, 1e-3, 1.0, 1000.0};
    hsep_defaults(parameters);
    parameters->predictor.Np = byte(from) % 24;
    parameters->predictor.p = byte(from) % 24;
    parameters->predictor.q = byte(from) % 8;
    parameters->predictor.input_hold = byte(from) % 2;
    parameters->predictor.measurement_delay = byte(from) % 5;
    parameters->predictor.dead_time = byte(from) % 5;
    parameters->averaging.averaging = byte(from) % 2;
    parameters->averaging.period = byte(from) % 2 ? 1e-3 : 0.0;
    parameters->averaging.forgetting = byte(from) % 2 ? 0.05 : 0.0;
    parameters->compensator.spacing = byte(from) % 5;
    parameters->compensator.preview = byte(from) % 64;
    parameters->compensator.compensate = byte(from) % 3;
    parameters->compensator.no_reversal = byte(from) % 2;
    parameters->compensator.change_max = fabs(number(from, spread[byte(from) % 4]));
    *mode = (hsep_mode){
        .f_n = fabs(number(from, 400.0)), .zeta = fabs(number(from, 3.0)), .alpha = number(from, 1e5), .beta = 0.0};
    parameters->n_modes = 1;
    parameters->modes = mode;
}

static double position(source *from)
{
    const double spread[4] = {1e-6, 1e-3, 1.0, 1000.0};
    return number(from, spread[byte(from) % 4]);
}

static void predict(source *from, const hsep_parameters *parameters)
{
    hsep_predictor_outputs outputs;
    const size_t size = hsep_predictor_size(parameters);
    if (size == 0) {
        return;
    }
    hsep_predictor *predictor = malloc(size), *copy = malloc(size);
    if (predictor != NULL && copy != NULL) {
        uint64_t k = 0;
        const double start = position(from);
        const size_t weights = byte(from) % 2 ? from->left : 0;
        (void)hsep_predictor_init(predictor, parameters, start, weights ? from->next : NULL, weights);
        for (; from->left > 0 && k < 400; k++) {
            const double x_d = position(from),
                         x = byte(from) % 16 == 0 && parameters->averaging.averaging ? NAN : position(from);
            (void)hsep_predictor_sample(predictor, x_d, x);
            hsep_predictor_read(predictor, &outputs);
        }
        if (!hsep_predictor_valid(predictor, size, parameters, k)) {
            abort(); /* a state that the library has made is valid */
        }
        memcpy(copy, predictor, size);
        for (int i = 0; i < 4; i++) { /* one that was changed is judged, whatever the answer */
            const size_t place = ((size_t)byte(from) << 8 | byte(from)) % size;
            ((unsigned char *)copy)[place] ^= byte(from);
        }
        if (hsep_predictor_valid(copy, size, parameters, k)) {
            (void)hsep_predictor_sample(copy, 0.0, 0.0);
        }
    }
    free(predictor);
    free(copy);
}

static void compensate(source *from, const hsep_parameters *parameters)
{
    hsep_compensator_outputs outputs;
    const size_t size = hsep_compensator_size(parameters);
    hsep_compensator *compensator = size == 0 ? NULL : malloc(size);
    if (compensator != NULL) {
        uint64_t k = 0;
        (void)hsep_compensator_init(compensator, parameters, position(from), NULL, 0);
        for (; from->left > 0 && k < 400; k++) {
            if (byte(from) == 0) {
                hsep_compensator_change(compensator, (hsep_sep_state)(byte(from) % 3), 1e-3, fabs(position(from)));
                hsep_compensator_reset(compensator, byte(from) % 2);
            }
            const double x_d = position(from);
            (void)hsep_compensator_sample(compensator, x_d, position(from));
            hsep_compensator_read(compensator, &outputs);
        }
        if (!hsep_compensator_valid(compensator, size, parameters, k)) {
            abort();
        }
    }
    free(compensator);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source from = {data, size};
    hsep_parameters parameters;
    hsep_mode mode;
    choose(&from, &parameters, &mode);
    if (byte(&from) % 2) {
        predict(&from, &parameters);
    } else {
        compensate(&from, &parameters);
    }
    return 0;
}
