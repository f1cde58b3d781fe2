#include "hsep_opening.h"

#include "hsep_check.h"
#include "hsep_table.h"
#include "hsep_table_file.h"
#include "hsep_uri.h"

#include <string.h>

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

/* Take the table from the resources if the header has none. */
static hsep_status opening_table(hsep_instance *instance, char message[])
{
#ifdef HSEP_TABLE_IN_RESOURCES
    return hsep_table_file_open(instance, message);
#else
    (void)message;
    instance->context = hsep_table;
    return HSEP_OK;
#endif
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
    const hsep_status table = opening_table(instance, message);
    if (table == HSEP_REFUSED) {
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
