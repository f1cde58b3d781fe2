/* What a predictor has learned, read and written; its size, and its beginning with it. */
#include "hsep_learned.h"

#include "hsep_cholesky.h"
#include "hsep_crc.h"

#include <float.h>

#ifdef HSEP_FLOAT32
#define LEARNED_ROUNDING FLT_EPSILON
#else
#define LEARNED_ROUNDING DBL_EPSILON
#endif

HSEP_API int hsep_learned_read(hsep_learned_bytes *from, void *to, size_t size)
{
    if (size > from->left) {
        return 0;
    }
    memcpy(to, from->bytes, size);
    from->bytes += size;
    from->left -= size;
    return 1;
}

HSEP_API int hsep_learned_next(hsep_learned_bytes *from, hsep_learned_setting *setting)
{
    return hsep_learned_read(from, setting, sizeof *setting) && setting->name[sizeof setting->name - 1] == '\0';
}

/* Read n numbers, which a file has in 8 bytes each; 0 if there are less, or one is not finite. */
static int learned_numbers(hsep_learned_bytes *from, hsep_real to[], uint64_t n)
{
    for (uint64_t i = 0; i < n; i++) {
        double number;
        if (!hsep_learned_read(from, &number, sizeof number) || !isfinite((hsep_real)number)) {
            return 0;
        }
        to[i] = (hsep_real)number;
    }
    return 1;
}

/* Factors that are learned: the first one has the rows of the physics model's residual. */
static hsep_int learned_n_factors(const hsep_averaged *averaged) { return averaged != NULL ? HSEP_N_RESIDUALS : 1; }

static hsep_gram *learned_gram(hsep_averaged *averaged, hsep_int factor)
{
    return hsep_warm_start_of_run(hsep_averaged_evidence(averaged, factor));
}

/* Features of a factor. */
static hsep_int learned_n_features(hsep_predictor *predictor, hsep_int factor)
{
    hsep_averaged *averaged = hsep_predictor_averaged(predictor);
    return averaged != NULL ? learned_gram(averaged, factor)->n
                            : hsep_paper_regression(hsep_predictor_paper(predictor))->n;
}

/* Numbers learned besides them; none without averaging. */
static hsep_int learned_n_numbers(const hsep_averaged *averaged)
{
    return averaged != NULL ? HSEP_LEARNED_WORDS + averaged->n_static : 0;
}

/* Read the number of rows of a factor, and it row after row through the model's own row: 0 if it is damaged. */
static int learned_take_factor(hsep_learned_bytes *from, hsep_predictor *predictor, hsep_int factor)
{
    hsep_averaged *averaged = hsep_predictor_averaged(predictor);
    const hsep_int n = learned_n_features(predictor, factor);
    hsep_real n_rows = 0.0;
    int taken = learned_numbers(from, &n_rows, 1);
    if (averaged == NULL) {
        hsep_regression *regression = hsep_paper_regression(hsep_predictor_paper(predictor));
        for (hsep_int i = 0; taken && i <= n; i++) {
            taken = learned_numbers(from, hsep_regression_row(regression), n + 1 - i);
            hsep_regression_load(regression, i);
        }
        regression->n_rows = n_rows;
        return taken;
    }
    hsep_gram *gram = learned_gram(averaged, factor);
    for (hsep_int i = 0; taken && i <= n; i++) { /* a factor's rows stand for those it was made from */
        hsep_real *row = hsep_gram_row(gram);
        hsep_zero(row, n + 1);
        for (hsep_int j = i; taken && j <= n; j++) {
            taken = learned_numbers(from, row + hsep_gram_place(gram, hsep_averaged_lags(averaged, factor), j), 1);
        }
        hsep_gram_fold(gram);
    }
    hsep_gram_settle(gram);
    gram->n_rows = n_rows;
    return taken;
}

/* Take what follows the settings, up to the checksum: 0 if it is not what these settings learn. */
static int learned_take(hsep_learned_bytes *from, const hsep_learned_head *head, hsep_predictor *predictor)
{
    hsep_averaged *averaged = hsep_predictor_averaged(predictor);
    const hsep_int n_numbers = learned_n_numbers(averaged);
    if (head->n_learned != HSEP_N_UNCERTAINTY + n_numbers ||
        (averaged != NULL && !learned_numbers(from, &averaged->learned.velocity_scale, n_numbers)) ||
        !learned_numbers(from, hsep_predictor_uncertainty(predictor)->theta, HSEP_N_UNCERTAINTY)) {
        return 0;
    }
    for (hsep_int i = 0; i < learned_n_factors(averaged); i++) {
        if (!learned_take_factor(from, predictor, i)) {
            return 0;
        }
    }
    if (averaged != NULL) {
        hsep_averaged_restart(averaged);
    }
    return from->left == sizeof(uint64_t);
}

/* A setting as a file has it under its name: of the predictor with mode = 0, or of one of its modes, from 1 on. */
static hsep_learned_setting learned_setting(uint64_t mode, const char *name, double value)
{
    hsep_learned_setting setting = {{0}, value};
    size_t at = 0;
    if (mode > 0) {
        uint64_t place = 1;
        memcpy(setting.name, "mode[", 5);
        for (at = 5; place <= mode / 10; place *= 10) {}
        for (; place > 0; place /= 10) {
            setting.name[at++] = (char)('0' + mode / place % 10);
        }
        memcpy(setting.name + at, "].", 2);
        at += 2;
    }
    for (; *name != '\0'; name++) {
        setting.name[at++] = *name;
    }
    return setting;
}

#define COUNT(of, type, own, usual, least, most, nonzero, automatic, learned) +(learned)
enum { LEARNED_OWN = 0 HSEP_PREDICTOR_SETTINGS(COUNT) HSEP_AVERAGING_SETTINGS(COUNT) };
#undef COUNT

/* Write the settings that weights depend on: the predictor's own with mode = 0, or a mode's; return how many. */
static uint64_t learned_settings(const hsep_parameters *parameters, uint64_t mode, hsep_learned_setting to[LEARNED_OWN])
{
    uint64_t n = 0;
    if (mode > 0) {
#define OF_MODE(of, type, own, ...) to[n++] = learned_setting(mode, #own, (double)parameters->modes[mode - 1].own);
        HSEP_MODE_SETTINGS(OF_MODE)
#undef OF_MODE
        return n;
    }
#define OWN(of, type, own, usual, least, most, nonzero, automatic, learned) \
    if (learned) { \
        to[n++] = learned_setting(0, #own, (double)parameters->of.own); \
    }
    HSEP_PREDICTOR_SETTINGS(OWN)
    HSEP_AVERAGING_SETTINGS(OWN)
#undef OWN
    return n;
}

/* Settings that weights depend on, the modes' numbers among them. */
static uint64_t learned_n_settings(const hsep_parameters *parameters)
{
    hsep_learned_setting own[LEARNED_OWN];
    return LEARNED_OWN + parameters->n_modes * learned_settings(parameters, 1, own);
}

/* Whether a setting of the file is one that weights depend on, and has this value now. */
static int learned_agrees(const hsep_learned_setting *setting, const hsep_parameters *parameters)
{
    hsep_learned_setting own[LEARNED_OWN];
    for (uint64_t mode = 0; mode <= parameters->n_modes; mode++) {
        for (uint64_t i = learned_settings(parameters, mode, own); i-- > 0;) {
            if (strcmp(setting->name, own[i].name) == 0) {
                return (hsep_real)setting->value == (hsep_real)own[i].value;
            }
        }
    }
    return 0;
}

HSEP_API hsep_began
hsep_learned_load(hsep_predictor *predictor, const hsep_parameters *parameters, const void *bytes, size_t size)
{
    hsep_learned_bytes from = {bytes, size};
    hsep_learned_head head;
    if (bytes == NULL) {
        return HSEP_BEGAN;
    }
    if (!hsep_is_sealed(bytes, size) || !hsep_learned_read(&from, &head, sizeof head) ||
        memcmp(head.magic, HSEP_LEARNED_MAGIC, sizeof head.magic) != 0) {
        return HSEP_WEIGHTS_DAMAGED;
    }
    if (head.n_modes != parameters->n_modes || head.n_settings != learned_n_settings(parameters)) {
        return HSEP_WEIGHTS_OTHER;
    }
    for (uint64_t i = 0; i < head.n_settings; i++) {
        hsep_learned_setting setting;
        if (!hsep_learned_next(&from, &setting)) {
            return HSEP_WEIGHTS_DAMAGED;
        }
        if (!learned_agrees(&setting, parameters)) {
            return HSEP_WEIGHTS_OTHER;
        }
    }
    return learned_take(&from, &head, predictor) ? HSEP_BEGAN : HSEP_WEIGHTS_DAMAGED;
}

/* Write a factor of all that was learned, of this run and earlier ones, a triangle of n + 1 rows; return the rows that
 * it is from, weighted. Cost: with averaging n^3 / 6 multiply-adds. */
static hsep_real learned_factor(hsep_predictor *predictor, hsep_int factor, hsep_real triangle[])
{
    const hsep_int width = learned_n_features(predictor, factor) + 1;
    if (hsep_predictor_averaged(predictor) == NULL) {
        hsep_regression *regression = hsep_paper_regression(hsep_predictor_paper(predictor));
        hsep_regression_write(regression, triangle);
        return regression->n_rows;
    }
    hsep_averaged *averaged = hsep_predictor_averaged(predictor);
    hsep_warm_start *evidence = hsep_averaged_evidence(averaged, factor);
    const hsep_int n_lags = hsep_averaged_lags(averaged, factor);
    hsep_gram *of_run = hsep_warm_start_of_run(evidence), *earlier = hsep_warm_start_earlier(evidence);
    hsep_real *least = hsep_gram_row(of_run), *diagonal = triangle; /* work */
    memset(triangle, 0, (size_t)hsep_triangle(width) * sizeof(hsep_real));
    hsep_gram_add_to(of_run, n_lags, triangle);
    if (earlier->n_rows > 0.0) {
        hsep_gram_add_to(earlier, n_lags, triangle);
    }
    for (hsep_int i = 0; i < width; i++) { /* what rounding leaves of a pivot where rows are few or alike */
        least[i] = LEARNED_ROUNDING * *diagonal + HSEP_TINY(1e-40);
        diagonal += width - i;
    }
    (void)hsep_cholesky_rows(triangle, width, 0, width, least);
    return hsep_warm_start_n_rows(evidence);
}

/* Write n numbers as doubles; they may lie at the end of where they go. */
static double *learned_put(double to[], const hsep_real from[], hsep_int n)
{
    for (hsep_int i = 0; i < n; i++) {
        to[i] = (double)from[i];
    }
    return to + n;
}

HSEP_API size_t
hsep_predictor_weights(hsep_predictor *self, const hsep_parameters *parameters, void *bytes, size_t size)
{
    hsep_averaged *averaged = hsep_predictor_averaged(self);
    const hsep_int n_learned = learned_n_numbers(averaged);
    hsep_learned_head head = {{0}, learned_n_settings(parameters), parameters->n_modes, HSEP_N_UNCERTAINTY + n_learned};
    memcpy(head.magic, HSEP_LEARNED_MAGIC, sizeof head.magic);
    size_t numbers = (size_t)head.n_learned + 1;
    for (hsep_int i = 0; i < learned_n_factors(averaged); i++) {
        numbers += 1 + (size_t)hsep_triangle(learned_n_features(self, i) + 1);
    }
    const size_t needed =
        sizeof head + (size_t)head.n_settings * sizeof(hsep_learned_setting) + numbers * sizeof(double);
    if (bytes == NULL || size < needed) {
        return needed;
    }
    memcpy(bytes, &head, sizeof head);
    hsep_learned_setting *setting = (hsep_learned_setting *)((unsigned char *)bytes + sizeof head);
    for (uint64_t mode = 0; mode <= parameters->n_modes; mode++) {
        setting += learned_settings(parameters, mode, setting);
    }
    double *to = (double *)(void *)setting;
    if (averaged != NULL) {
        to = learned_put(to, &averaged->learned.velocity_scale, n_learned);
    }
    to = learned_put(to, hsep_predictor_uncertainty(self)->theta, HSEP_N_UNCERTAINTY);
    for (hsep_int i = 0; i < learned_n_factors(averaged); i++) {
        const hsep_int count = (hsep_int)hsep_triangle(learned_n_features(self, i) + 1);
        hsep_real *triangle = (hsep_real *)(void *)(to + 1 + count) - count; /* at the end of where it goes */
        *to = (double)learned_factor(self, i, triangle);
        to = learned_put(to + 1, triangle, count);
    }
    const uint64_t sum = hsep_crc(bytes, needed - sizeof sum);
    memcpy(to, &sum, sizeof sum);
    return needed;
}

HSEP_API size_t hsep_predictor_size(const hsep_parameters *parameters)
{
    if (hsep_predictor_refused(parameters) != NULL) {
        return 0;
    }
    const hsep_predictor_parameters derived = hsep_predictor_derive(parameters);
    return hsep_block_bytes(hsep_predictor_lay_out(&(hsep_predictor){0}, &derived));
}

HSEP_API hsep_began hsep_predictor_init(
    hsep_predictor *self, const hsep_parameters *parameters, hsep_real start, const void *weights, size_t weights_size)
{
    const hsep_predictor_parameters derived = hsep_predictor_derive(parameters);
    hsep_predictor_block_init(self, &derived, start);
    const hsep_began began = hsep_learned_load(self, parameters, weights, weights_size);
    if (began != HSEP_BEGAN) {
        hsep_predictor_block_init(self, &derived, start);
    }
    return began;
}
