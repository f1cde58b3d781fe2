/* Opening of an instance: its name, its resources, the table of its variables and what was learned. */
#include "hsep_instance.h"

#include "hsep_check.h"
#include "hsep_crc.h"
#include "hsep_resource.h"

#ifdef HSEP_TABLE_IN_RESOURCES
#ifdef HSEP_NO_FILES
#error "the table of this FMU is in its resources, which HSEP_NO_FILES leaves out: take the header of a source FMU"
#endif
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h> /* dladdr, which is no part of POSIX: _GNU_SOURCE is defined by the compiler's options */
#endif
#endif

#ifdef _WIN32
enum { OPENING_WINDOWS = 1 };
#else
enum { OPENING_WINDOWS = 0 };
#endif

/* Take the folder of a URI or path, or NULL. HSEP_WARNED: it is none. */
static hsep_status opening_folder(hsep_instance *instance, const char *uri, char message[])
{
    const hsep_fmi_names *names = instance->names;
    if (uri == NULL) {
        return HSEP_OK;
    }
    instance->resources = hsep_new(instance, HSEP_FOLDER_SIZE(strlen(uri)));
    if (instance->resources == NULL) {
        return hsep_message_add(message, "%s: no memory for the path of the resources", names->instantiate);
    }
    if (hsep_uri_folder(uri, OPENING_WINDOWS, instance->resources)) {
        return HSEP_OK;
    }
    hsep_message_add(
        message, "%s: %s must be %s on this machine, got %.300s; it is not used", names->instantiate, names->location,
        names->location_form, uri);
    hsep_delete(instance, instance->resources);
    instance->resources = NULL;
    return HSEP_WARNED;
}

#ifndef HSEP_NO_FILES

/* Read a whole file of a folder into the importer's memory; *bytes is NULL if there is none. Fails without memory. */
static hsep_status opening_read(
    const hsep_instance *instance, const char *folder, const char *name, void **bytes, size_t *size, char message[])
{
    FILE *file = hsep_resource_open(folder, name);
    *bytes = NULL;
    if (file == NULL) {
        return HSEP_OK;
    }
    const size_t left = hsep_resource_left(file);
    *bytes = hsep_new(instance, left + 1); /* of an empty file too */
    *size = *bytes == NULL ? 0 : fread(*bytes, 1, left, file);
    fclose(file);
    return *bytes != NULL ? HSEP_OK
                          : hsep_message_add(message, "%s: no memory for %s", instance->names->instantiate, name);
}

#endif

#ifdef HSEP_TABLE_IN_RESOURCES

#define OPENING_PATH_SIZE 4096 /* bytes, and characters */
#define OPENING_UP "../../resources/"

static const char opening_here = 0; /* an address in this library */

/* Write the library's own path to path; 0 if the system does not tell. */
static int opening_path(char path[OPENING_PATH_SIZE])
{
#ifdef _WIN32
    wchar_t wide[OPENING_PATH_SIZE];
    HMODULE module = NULL;
    const DWORD flags = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT;
    if (!GetModuleHandleExW(flags, (const wchar_t *)(const void *)&opening_here, &module)) {
        return 0;
    }
    const DWORD length = GetModuleFileNameW(module, wide, OPENING_PATH_SIZE);
    return length > 0 && length < OPENING_PATH_SIZE &&
           WideCharToMultiByte(CP_UTF8, 0, wide, -1, path, OPENING_PATH_SIZE, NULL, NULL) > 0;
#else
    Dl_info info;
    if (dladdr(&opening_here, &info) == 0 || info.dli_fname == NULL || strlen(info.dli_fname) >= OPENING_PATH_SIZE) {
        return 0;
    }
    (void)strcpy(path, info.dli_fname);
    return 1;
#endif
}

/* The folder resources/ of an FMU whose library is in binaries/<platform>/, with a trailing slash, UTF-8, in the
 * importer's memory; NULL if the system does not tell where the library is, or there is no memory. */
static char *opening_beside(const hsep_instance *instance)
{
    char path[OPENING_PATH_SIZE];
    if (!opening_path(path)) {
        return NULL;
    }
    size_t end = strlen(path);
    while (end > 0 && path[end - 1] != '/' && !(OPENING_WINDOWS && path[end - 1] == '\\')) {
        end--;
    }
    char *folder = hsep_new(instance, end + sizeof OPENING_UP);
    if (folder != NULL) {
        memcpy(folder, path, end);
        memcpy(folder + end, OPENING_UP, sizeof OPENING_UP);
    }
    return folder;
}

#define OPENING_TABLE "variables.bin"

/* That file, little-endian. Names, kinds and ranges are the binary's own: no file can allow what the models do not. */
typedef struct {
    char magic[8];
    uint64_t size; /* of the file, bytes */
    uint64_t kind; /* HSEP_INTERFACE */
    uint64_t n_modes;
    uint64_t angular;          /* whether the axis is rotary */
    uint64_t window;           /* samples of each window, 0 if there is none */
    char guid[HSEP_GUID_SIZE]; /* padded with zeros */
    double starts[];           /* of all but the windows; the CRC-32 of all before as uint64 */
} opening_table;
HSEP_ASSERT_WORDS(opening_table, 12);

/* Whether a text is ASCII, so that a message may quote it. */
static int opening_is_plain(const char *text)
{
    while (*text != '\0' && (unsigned char)*text < 128) {
        text++;
    }
    return *text == '\0';
}

/* Check a table of size bytes, and fill the context with what it tells. reason: what is wrong with it. */
static hsep_status opening_fill(hsep_context *context, const opening_table *table, size_t size, char reason[])
{
    if (size < sizeof *table || memcmp(table->magic, "HSEPVAR2", sizeof table->magic) != 0) {
        return hsep_message_add(reason, "it is no such file");
    }
    if (table->kind != HSEP_INTERFACE) {
        return hsep_message_add(reason, "it is of another kind of FMU or another version than this library");
    }
    const double n =
        HSEP_N_SCALARS + HSEP_MODE_NUMBERS * (double)table->n_modes + HSEP_N_LAST; /* of the start values */
    const int modes_fit = HSEP_HAS_MODES ? table->n_modes > 0 : table->n_modes == 0;
    if ((double)size != (double)sizeof *table + (n + 1.0) * (double)sizeof(double) || table->size != size ||
        !modes_fit || table->angular > 1 || table->guid[HSEP_GUID_SIZE - 1] != '\0' || !opening_is_plain(table->guid)) {
        return hsep_message_add(reason, "it is damaged or truncated");
    }
    if (!hsep_is_sealed(table, size)) {
        return hsep_message_add(reason, "it is damaged: the checksum differs");
    }
    *context = (hsep_context){
        .variables = hsep_variables,
        .n_scalars = HSEP_N_SCALARS,
        .n_modes = (size_t)table->n_modes,
        .n_last = HSEP_N_LAST,
        .n_variables = (size_t)n, /* windows have no start values */
        .starts = table->starts,
        .guid = table->guid,
        .angular = table->angular != 0};
    for (size_t i = 0; i < context->n_variables; i++) {
        if (!isfinite(table->starts[i])) {
            return hsep_message_add(reason, "a start value is not finite");
        }
    }
    if (hsep_check_parameters(context, table->starts, reason) > 0) {
        return HSEP_REFUSED;
    }
    if (table->window > 0 && (HSEP_N_WINDOWS == 0 || (double)table->window != table->starts[HSEP_VR_LENGTH])) {
        return hsep_message_add(reason, "its windows must be of Np samples, or left out");
    }
    context->window = (size_t)table->window;
    context->n_variables += HSEP_N_WINDOWS * context->window;
    return HSEP_OK;
}

/* Take the table from the instance's resources; where there is none, from the resources beside the library, which then
 * become the instance's. HSEP_WARNED: the instance's resources had none. */
static hsep_status opening_take_table(hsep_instance *instance, char message[])
{
    const char *call = instance->names->instantiate, *location = instance->names->location;
    char reason[HSEP_MESSAGE_SIZE] = "";
    size_t size = 0;
    hsep_status status = opening_read(instance, instance->resources, OPENING_TABLE, &instance->table, &size, message);
    if (status == HSEP_OK && instance->table == NULL) {
        char *beside = opening_beside(instance);
        status = opening_read(instance, beside, OPENING_TABLE, &instance->table, &size, message);
        if (status == HSEP_OK && instance->table == NULL) {
            (void)hsep_message_add(
                message,
                "%s: there is no " OPENING_TABLE ", which must be in the FMU's resources; beside the library: %s", call,
                beside != NULL ? beside : "none");
            status = hsep_message_add(
                message, "%s: %s", location, instance->resources != NULL ? instance->resources : "none");
        } else if (status == HSEP_OK && instance->resources != NULL) {
            (void)hsep_message_add(
                message, "%s: there is no " OPENING_TABLE " in %s, that beside the library is used; got %s", call,
                location, instance->resources);
            status = HSEP_WARNED;
        }
        hsep_delete(instance, instance->resources);
        instance->resources = beside;
    }
    if (status != HSEP_REFUSED && opening_fill(&instance->context, instance->table, size, reason) != HSEP_OK) {
        return hsep_message_add(
            message, "%s: " OPENING_TABLE " must be the table of this FMU: %s; got %s", call, reason,
            instance->resources);
    }
    return status;
}

#else

/* Take the table of the header. */
static hsep_status opening_take_table(hsep_instance *instance, char message[])
{
    (void)message;
    instance->context = hsep_table;
    return HSEP_OK;
}

#endif

/* Take what was learned from the resources if the header has none. */
static hsep_status opening_take_weights(hsep_instance *instance, char message[])
{
#ifdef HSEP_NO_FILES
    (void)instance, (void)message;
#else
    hsep_context *context = &instance->context;
    if (context->weights == NULL) {
        const hsep_status status = opening_read(
            instance, instance->resources, "weights.bin", &instance->weights, &context->weights_size, message);
        context->weights = instance->weights;
        return status;
    }
#endif
    return HSEP_OK;
}

HSEP_API hsep_status hsep_open(hsep_instance *instance, const char *name, const char *resources, char message[])
{
    const char *call = instance->names->instantiate;
    instance->name = hsep_new(instance, strlen(name) + 1);
    if (instance->name == NULL) {
        return hsep_message_add(message, "%s: no memory for the instance's name", call);
    }
    (void)strcpy(instance->name, name);
    const hsep_status folder = opening_folder(instance, resources, message);
    if (folder == HSEP_REFUSED) {
        return HSEP_REFUSED;
    }
    const hsep_status table = opening_take_table(instance, message);
    if (table == HSEP_REFUSED || opening_take_weights(instance, message) == HSEP_REFUSED) {
        return HSEP_REFUSED;
    }
    instance->context.resources = instance->resources;
    instance->values = hsep_new(instance, hsep_instance_n_values(instance) * sizeof(double));
    if (instance->values == NULL) {
        return hsep_message_add(
            message, "%s: no memory for %lu values", call, (unsigned long)hsep_instance_n_values(instance));
    }
    instance->room = instance->context.window;
    return table == HSEP_WARNED ? table : folder;
}
