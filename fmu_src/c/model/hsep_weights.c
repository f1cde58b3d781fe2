#include "hsep_weights.h"

#include "hsep_check.h"
#include "hsep_learned.h"
#include "hsep_resource.h"
#include "hsep_table.h"

#include <string.h>

#define WEIGHTS_FILE "weights.bin"

static void weights_compare(const char *name, double learned, double got, hsep_kind kind, char message[])
{
    char then[HSEP_NUMBER_SIZE], now[HSEP_NUMBER_SIZE];
    if (learned != got) {
        hsep_message_add(
            message, "%s must be %s, with which this FMU was trained (" WEIGHTS_FILE "), got %s", name,
            hsep_number(then, learned, kind), hsep_number(now, got, kind));
    }
}

/* Read the settings of the file and compare them with the table's; return 0 if the file is damaged. A setting that the
 * table does not have counts as 0; modes that only one side has show in the number of modes. */
static int weights_compare_settings(
    hsep_learned_source *source, const hsep_context *context, const double values[], uint64_t n_settings,
    char message[])
{
    uint64_t n_missing = 0;
    for (size_t i = 0; i < context->n_variables; i++) {
        n_missing += hsep_table_row(context, i)->learned != 0;
    }
    for (uint64_t i = 0; i < n_settings; i++) {
        hsep_learned_setting setting;
        if (!hsep_learned_read(source, &setting, sizeof setting) || setting.name[sizeof setting.name - 1] != '\0') {
            return 0;
        }
        const size_t place = hsep_table_place(context, setting.name);
        if (place < context->n_variables) {
            const hsep_variable *variable = hsep_table_row(context, place);
            weights_compare(setting.name, setting.value, values[place], variable->kind, message);
            n_missing -= variable->learned != 0;
        } else if (strncmp(setting.name, "mode[", 5) != 0) {
            const hsep_kind kind = strcmp(setting.name, "averaging") == 0 ? HSEP_BOOLEAN : HSEP_REAL;
            weights_compare(setting.name, setting.value, 0.0, kind, message);
        }
    }
    return n_missing == 0 || message[0] != '\0';
}

/* Read a whole source, of so many bytes: 0 if it is damaged; with a message, if it was learned with other settings. */
static int weights_take(
    hsep_learned_source *source, double size, const hsep_context *context, const double values[], uint64_t n_modes,
    hsep_predictor *predictor, char message[])
{
    hsep_learned_head head;
    if (!hsep_learned_read(source, &head, sizeof head) ||
        memcmp(head.magic, HSEP_LEARNED_MAGIC, sizeof head.magic) != 0) {
        return 0;
    }
    weights_compare("the number of modes", (double)head.n_modes, (double)n_modes, HSEP_INTEGER, message);
    if (!weights_compare_settings(source, context, values, head.n_settings, message) || message[0] != '\0') {
        return 0;
    }
    return hsep_learned_take(source, &head, size, predictor);
}

#ifndef HSEP_NO_FILES

/* As hsep_learned_source's: from a file. */
static size_t weights_read_file(hsep_learned_source *self, void *to, size_t size)
{
    return fread(to, 1, size, self->file);
}

#endif

/* Begin to read the weights of the context, or else the file; 0: there are none. */
static int weights_open(hsep_learned_source *source, const hsep_context *context)
{
    if (context->weights != NULL) {
        *source = hsep_learned_in_memory(context->weights, context->weights_size);
        return 1;
    }
#ifdef HSEP_NO_FILES
    return 0;
#else
    *source = (hsep_learned_source){.read = weights_read_file, .file = hsep_resource_open(context, WEIGHTS_FILE)};
    return source->file != NULL;
#endif
}

/* Read a source from its beginning again. */
static int weights_rewind(hsep_learned_source *source, const hsep_context *context)
{
#ifndef HSEP_NO_FILES
    if (source->file != NULL) {
        return fseek(source->file, 0, SEEK_SET) == 0;
    }
#endif
    return weights_open(source, context);
}

HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, const double values[], uint64_t n_modes, hsep_predictor *predictor, char message[])
{
    hsep_learned_source source;
    double size = 0.0;
    if (!weights_open(&source, context)) {
        return HSEP_OK;
    }
    const int taken = hsep_learned_whole(&source, &size) && weights_rewind(&source, context) &&
                      weights_take(&source, size, context, values, n_modes, predictor, message);
#ifndef HSEP_NO_FILES
    if (source.file != NULL) {
        fclose(source.file);
    }
#endif
    if (!taken && message[0] == '\0') {
        hsep_message_add(
            message, WEIGHTS_FILE " must be what this version has learned; "
                                  "it is damaged, truncated or another version's: train again");
    }
    return taken ? HSEP_OK : HSEP_REFUSED;
}
