#include "hsep_weights.h"

#include "hsep_check.h"
#include "hsep_layout.h"
#include "hsep_resource.h"
#include "hsep_table.h"

#include <string.h>

#define WEIGHTS_FILE "weights.bin"
#define WEIGHTS_MAGIC "HSEPWG13"
#define WEIGHTS_CHUNK 512 /* bytes that are summed up at once, a multiple of 8 */

typedef struct {
    char magic[8];
    uint64_t n_settings, n_modes, n_samples, n_learned;
} weights_head;

HSEP_ASSERT_WORDS(weights_head, 5);

typedef struct {
    char name[24]; /* filled with 0 */
    double value;
} weights_setting;

HSEP_ASSERT_WORDS(weights_setting, 4);

/* The bytes of weights.bin, in memory or in the resources. */
typedef struct {
    FILE *file; /* NULL: in memory */
    const unsigned char *bytes;
    size_t left;
} weights_source;

/* Read up to so many bytes; return how many there were. */
static size_t weights_read_some(weights_source *source, void *to, size_t size)
{
    if (source->file != NULL) {
        return fread(to, 1, size, source->file);
    }
    const size_t read = size < source->left ? size : source->left;
    memcpy(to, source->bytes, read);
    source->bytes += read;
    source->left -= read;
    return read;
}

static int weights_read(weights_source *source, void *to, size_t size)
{
    return weights_read_some(source, to, size) == size;
}

/* Whether it is whole: its last 8 bytes are the checksum of the others. size: of all of it, bytes. It is put back to
 * its beginning. */
static int weights_whole(weights_source *source, double *size)
{
    unsigned char bytes[WEIGHTS_CHUNK + sizeof(uint64_t)];
    uint32_t crc = 0;
    uint64_t sum = 0;
    size_t held = 0; /* of the bytes: the last 8 so far may be the checksum */
    const weights_source begin = *source;
    *size = 0.0;
    for (;;) {
        const size_t read = weights_read_some(source, bytes + held, sizeof bytes - held);
        *size += (double)read;
        held += read;
        if (held < sizeof bytes) {
            break;
        }
        crc = hsep_crc(crc, bytes, WEIGHTS_CHUNK);
        held -= WEIGHTS_CHUNK;
        memcpy(bytes, bytes + WEIGHTS_CHUNK, held);
    }
    *source = begin;
    if (held < sizeof sum || (source->file != NULL && fseek(source->file, 0, SEEK_SET) != 0)) {
        return 0;
    }
    memcpy(&sum, bytes + held - sizeof sum, sizeof sum);
    return sum == hsep_crc(crc, bytes, held - sizeof sum);
}

static void weights_compare(const char *name, double learned, double got, hsep_kind kind, char message[])
{
    char then[HSEP_NUMBER_SIZE], now[HSEP_NUMBER_SIZE];
    if (learned != got) {
        hsep_message_add(
            message, "%s must be %s, with which this FMU was trained (" WEIGHTS_FILE "), got %s", name,
            hsep_number(then, learned, kind), hsep_number(now, got, kind));
    }
}

/* Read the settings of the file and compare them with those of the table: 0 if it is damaged. A setting that the table
 * has not is 0 here; modes that only one side has are told by their number. */
static int weights_compare_settings(
    weights_source *source, const hsep_context *context, const double values[], uint64_t n_settings, char message[])
{
    uint64_t n_missing = 0;
    for (size_t i = 0; i < context->n_variables; i++) {
        n_missing += hsep_table_row(context, i)->learned != 0;
    }
    for (uint64_t i = 0; i < n_settings; i++) {
        weights_setting setting;
        if (!weights_read(source, &setting, sizeof setting) || setting.name[sizeof setting.name - 1] != '\0') {
            return 0;
        }
        const size_t place = hsep_table_place(context, setting.name);
        if (place < context->n_variables) {
            const hsep_variable *variable = hsep_table_row(context, place);
            weights_compare(setting.name, setting.value, values[place], variable->kind, message);
            n_missing -= variable->learned != 0;
        } else if (strncmp(setting.name, "mode[", 5) != 0) {
            const hsep_kind kind = strcmp(setting.name, "trust") == 0 ? HSEP_BOOLEAN : HSEP_REAL;
            weights_compare(setting.name, setting.value, 0.0, kind, message);
        }
    }
    return n_missing == 0 || message[0] != '\0';
}

/* Read what has been learned besides the factors, by the residual model and of the errors. 0 if it is damaged. */
static int weights_take_learned(weights_source *source, hsep_residual_model *model, hsep_uncertainty *uncertainty)
{
    for (uint64_t i = 0; i < hsep_residual_n_learned(model); i++) {
        if (!weights_read(source, hsep_residual_learned(model, i), sizeof(double))) {
            return 0;
        }
    }
    double *errors = hsep_uncertainty_learned(uncertainty);
    return weights_read(source, errors, HSEP_N_UNCERTAINTY * sizeof(double)) && hsep_uncertainty_sound(uncertainty) &&
           hsep_residual_sound(model);
}

/* Read a factor row after row through the regression's own row: 0 if it is damaged. */
static int weights_take_factor(weights_source *source, hsep_regression *regression, uint64_t n_samples)
{
    for (uint64_t i = 0; i <= regression->n; i++) {
        const size_t left = (size_t)(regression->n + 1 - i);
        if (!weights_read(source, hsep_regression_row(regression), left * sizeof(double)) ||
            !hsep_regression_load(regression, i)) {
            return 0;
        }
    }
    regression->n_samples = n_samples;
    return 1;
}

/* Bytes of a file with this head. */
static double weights_size(const weights_head *head, hsep_residual_model *model)
{
    double words = 4.0 * (double)head->n_settings + (double)head->n_learned + 1.0;
    for (uint64_t i = 0; i < hsep_residual_n_factors(model); i++) {
        const double n = (double)hsep_residual_factor(model, i)->n;
        words += 0.5 * (n + 1.0) * (n + 2.0);
    }
    return (double)sizeof *head + words * (double)sizeof(double);
}

/* Read the file: 0 if it is damaged; with a message, if it was learned with other settings. */
static int weights_take(
    weights_source *source, const hsep_context *context, const double values[], uint64_t n_modes,
    hsep_predictor *predictor, char message[])
{
    hsep_residual_model *model = hsep_predictor_model(predictor);
    weights_head head;
    double size = 0.0;
    if (!weights_whole(source, &size) || !weights_read(source, &head, sizeof head) ||
        memcmp(head.magic, WEIGHTS_MAGIC, sizeof head.magic) != 0) {
        return 0;
    }
    weights_compare("the number of modes", (double)head.n_modes, (double)n_modes, HSEP_INTEGER, message);
    if (!weights_compare_settings(source, context, values, head.n_settings, message) || message[0] != '\0') {
        return 0;
    }
    if (head.n_learned != HSEP_N_UNCERTAINTY + hsep_residual_n_learned(model) || size != weights_size(&head, model) ||
        !weights_take_learned(source, model, hsep_predictor_uncertainty(predictor))) {
        return 0;
    }
    for (uint64_t i = 0; i < hsep_residual_n_factors(model); i++) {
        if (!weights_take_factor(source, hsep_residual_factor(model, i), head.n_samples)) {
            return 0;
        }
    }
    hsep_residual_restart(model);
    return 1;
}

HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, const double values[], uint64_t n_modes, hsep_predictor *predictor, char message[])
{
    weights_source source = {.bytes = context->weights, .left = context->weights_size};
    if (source.bytes == NULL) {
        source.file = hsep_resource_open(context, WEIGHTS_FILE);
        if (source.file == NULL) {
            return HSEP_OK;
        }
    }
    const int taken = weights_take(&source, context, values, n_modes, predictor, message);
    if (source.file != NULL) {
        fclose(source.file);
    }
    if (!taken && message[0] == '\0') {
        hsep_message_add(message, WEIGHTS_FILE " must be a factor of learned rows; it is damaged or truncated");
    }
    return taken ? HSEP_OK : HSEP_REFUSED;
}
