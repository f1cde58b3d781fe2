#include "hsep_table_file.h"

#ifdef HSEP_TABLE_IN_RESOURCES

#include "hsep_check.h"
#include "hsep_crc.h"
#include "hsep_layout.h"
#include "hsep_library.h"
#include "hsep_resource.h"

#include <math.h>
#include <string.h>

#define TABLE_FILE "variables.bin"
#define TABLE_MAGIC "HSEPVAR2"

typedef struct {
    uint64_t size, kind, n_modes, angular, window;
    char guid[HSEP_GUID_SIZE];
} table_head;

HSEP_ASSERT_WORDS(table_head, 11);

/* What an instance keeps of the file. */
typedef struct {
    table_head head;
    double starts[]; /* of the single variables, then of the modes */
} table_content;

/* Whether a text is printable, as a GUID is, with zeros behind it. */
static int table_is_guid(const char guid[HSEP_GUID_SIZE])
{
    size_t length = 0;
    while (length < HSEP_GUID_SIZE && guid[length] >= ' ' && guid[length] <= '~') {
        length++;
    }
    int zeros = length > 0 && length < HSEP_GUID_SIZE;
    for (size_t i = length; i < HSEP_GUID_SIZE; i++) {
        zeros &= guid[i] == '\0';
    }
    return zeros;
}

/* Read the start values behind the head. 0 if the file ends before, goes on behind them, or has another checksum. */
static int table_read(FILE *file, table_content *content, size_t n_starts)
{
    uint64_t sum = 0;
    uint32_t crc = hsep_crc(0, TABLE_MAGIC, strlen(TABLE_MAGIC));
    crc = hsep_crc(crc, &content->head, sizeof content->head);
    if (fread(content->starts, sizeof(double), n_starts, file) != n_starts || fread(&sum, sizeof sum, 1, file) != 1) {
        return 0;
    }
    return sum == hsep_crc(crc, content->starts, n_starts * sizeof(double)) && fgetc(file) == EOF;
}

/* Check the start values, and fill the context with what the file tells. */
static hsep_status table_fill(hsep_context *context, const table_content *content, size_t n_starts, char message[])
{
    *context = (hsep_context){
        .variables = hsep_variables,
        .n_scalars = HSEP_N_SCALARS,
        .n_modes = (size_t)content->head.n_modes,
        .n_variables = n_starts, /* windows have no start values */
        .starts = content->starts,
        .guid = content->head.guid,
        .angular = content->head.angular != 0};
    for (size_t i = 0; i < n_starts; i++) {
        if (!isfinite(content->starts[i])) {
            return hsep_message_add(message, "a start value is not finite");
        }
    }
    if (hsep_check_parameters(context, content->starts, message) > 0) {
        return HSEP_REFUSED;
    }
    if (content->head.window > 0 &&
        (HSEP_N_WINDOWS == 0 || (double)content->head.window != content->starts[HSEP_VR_LENGTH])) {
        return hsep_message_add(message, "its windows must be of Np samples, or left out");
    }
    context->window = (size_t)content->head.window;
    context->n_variables += HSEP_N_WINDOWS * context->window;
    return HSEP_OK;
}

/* Take the table from a file that is open. reason: what is wrong with it. */
static hsep_status table_take(hsep_instance *instance, FILE *file, char reason[])
{
    table_head head;
    uint64_t words[sizeof head / sizeof(uint64_t)];
    const double left = hsep_resource_head(file, TABLE_MAGIC, words, sizeof words / sizeof *words);
    if (left < 0.0) {
        return hsep_message_add(reason, "it is no such file");
    }
    memcpy(&head, words, sizeof head);
    if (head.kind != HSEP_INTERFACE) {
        return hsep_message_add(reason, "it is of another kind of FMU or another version than this library");
    }
    const double n = HSEP_N_SCALARS + HSEP_MODE_NUMBERS * (double)head.n_modes; /* of the start values */
    const int modes_fit = HSEP_HAS_MODES ? head.n_modes > 0 : head.n_modes == 0;
    const double size = (double)strlen(TABLE_MAGIC) + (double)sizeof head + left;
    if (left != (n + 1.0) * (double)sizeof(double) || (double)head.size != size || !modes_fit || head.angular > 1 ||
        !table_is_guid(head.guid)) {
        return hsep_message_add(reason, "it is damaged or truncated");
    }
    table_content *content = hsep_new(instance, sizeof *content + (size_t)n * sizeof(double));
    if (content == NULL) {
        return hsep_message_add(reason, "there is no memory for its %.0f start values", n);
    }
    instance->table = content;
    content->head = head;
    if (!table_read(file, content, (size_t)n)) {
        return hsep_message_add(reason, "it is damaged: the checksum differs");
    }
    return table_fill(&instance->context, content, (size_t)n, reason);
}

/* The table's file in a folder; NULL if there is none. */
static FILE *table_find(const char *folder)
{
    return hsep_resource_open(&(hsep_context){.resources = folder}, TABLE_FILE);
}

HSEP_API hsep_status hsep_table_file_open(hsep_instance *instance, char message[])
{
    const char *call = instance->names->instantiate, *location = instance->names->location;
    char reason[HSEP_MESSAGE_SIZE] = "";
    hsep_status status = HSEP_OK;
    FILE *file = table_find(instance->resources);
    if (file == NULL) {
        char *beside = hsep_library_resources(instance);
        file = table_find(beside);
        if (file == NULL) {
            (void)hsep_message_add(
                message, "%s: there is no " TABLE_FILE ", which must be in the FMU's resources; beside the library: %s",
                call, beside != NULL ? beside : "none");
            (void)hsep_message_add(
                message, "%s: %s", location, instance->resources != NULL ? instance->resources : "none");
            hsep_delete(instance, beside);
            return HSEP_REFUSED;
        }
        if (instance->resources != NULL) {
            (void)hsep_message_add(
                message, "%s: there is no " TABLE_FILE " in %s, that beside the library is used; got %s", call,
                location, instance->resources);
            status = HSEP_WARNED;
        }
        hsep_delete(instance, instance->resources);
        instance->resources = beside;
    }
    const hsep_status taken = table_take(instance, file, reason);
    fclose(file);
    if (taken != HSEP_OK) {
        return hsep_message_add(
            message, "%s: " TABLE_FILE " must be the table of this FMU: %s; got %s", call, reason, instance->resources);
    }
    return status;
}

#else
typedef int hsep_no_table_file; /* a translation unit must not be empty */
#endif
