/* Directional derivatives at a communication point, where there are windows.
 *
 * No output depends on an input of the same instant: with respect to inputs they are 0, but in Initialization Mode, in
 * which outputs follow from x_d_ahead. What came by x_d_ahead is in x_d_window: with respect to it x_h and its window
 * have the paper's model's, x_h = G_h x_d + free response; eq. (3).
 */
#include "hsep_check.h"
#include "hsep_fmi3_calls.h"
#include "hsep_windows.h"

#if HSEP_N_WINDOWS > 0

/* Refuse what are no inputs, commands of the window or outputs of them. window: whether there are commands. */
static hsep_status derivative_check(
    const hsep_instance *instance, const hsep_access *of, const hsep_access *by, int *window, char message[])
{
    const hsep_context *context = &instance->context;
    const hsep_fmi_names *names = instance->names;
    char name[HSEP_NAME_SIZE];
    for (size_t i = 0; i < by->n_references; i++) {
        const hsep_found found = names->find(context, by->references[i]);
        const int is_window = instance->state != NULL && found.place == HSEP_VR_x_d_window(context);
        *window |= is_window;
        if (!is_window && found.row->causality != HSEP_INPUT) {
            return hsep_message_add(
                message, "%s must be inputs or, in Step Mode, x_d_window, got %s", by->call,
                names->name(context, by->references[i], name));
        }
    }
    for (size_t i = 0; i < of->n_references; i++) {
        const hsep_found found = names->find(context, of->references[i]);
        const int is_output = found.row->causality == HSEP_OUTPUT || found.row->causality == HSEP_LOCAL;
        const int is_x_h = found.place == HSEP_VR_x_h || found.place == HSEP_VR_x_h_window(context);
        if (!(*window ? is_x_h : is_output)) {
            return hsep_message_add(
                message, "%s must be %s, got %s", of->call,
                *window ? "x_h or x_h_window where x_d_window is known" : "outputs",
                names->name(context, of->references[i], name));
        }
    }
    return HSEP_OK;
}

/* Write the derivatives; memory: (3, Np), zeros. */
static hsep_status derivative_take(
    hsep_instance *self, const hsep_access *of, const hsep_access *by, int window, double memory[],
    double sensitivity[], char message[])
{
    const hsep_context *context = &self->context;
    const double *seed = by->values, before = self->values[HSEP_VR_x_d_ahead];
    double *direction = memory, *x_h = memory + context->window, now = 0.0, start = 0.0;
    for (size_t i = 0; i < by->n_references; i++) {
        const hsep_found found = self->names->find(context, by->references[i]);
        for (size_t j = 0; j < found.count; j++, seed++) {
            start += found.place == HSEP_VR_x_d_ahead ? *seed : 0.0;
            direction[j] += found.place == HSEP_VR_x_d_window(context) ? *seed : 0.0;
        }
    }
    if (window && hsep_model_derivative(self->state, direction, x_h, &now, x_h + context->window, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (self->state == NULL) { /* outputs are the start of x_d_ahead, or 0 */
        self->values[HSEP_VR_x_d_ahead] = start;
        hsep_model_start_values(context, self->values);
    }
    for (size_t i = 0; i < of->n_references; i++) {
        const hsep_found found = self->names->find(context, of->references[i]);
        const double *source = self->state == NULL ? &self->values[found.place] : found.count > 1 ? x_h : &now;
        for (size_t j = 0; j < found.count; j++) {
            *sensitivity++ = source[j];
        }
    }
    if (self->state == NULL) {
        self->values[HSEP_VR_x_d_ahead] = before;
        hsep_model_start_values(context, self->values);
    }
    return HSEP_OK;
}

fmi3Status fmi3GetDirectionalDerivative(
    fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],
    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    const hsep_call *call = HSEP_FMI3(fmi3GetDirectionalDerivative);
    const char *type = "Float64";
    const hsep_access of = {
        "fmi3GetDirectionalDerivative: unknowns", type, unknowns, nUnknowns, sensitivity, nSensitivity};
    const hsep_access by = {"fmi3GetDirectionalDerivative: knowns", type, knowns, nKnowns, seed, nSeed};
    hsep_instance *self = hsep_begin(instance, call);
    char message[HSEP_MESSAGE_SIZE] = "";
    int window = 0;
    if (self == NULL) {
        return fmi3Error;
    }
    if (self->context.window == 0) {
        return fmi3_status(hsep_refuse(
            self, "%s is not supported: providesDirectionalDerivatives is false in modelDescription.xml", call->name));
    }
    double *memory = hsep_new(self, 3 * self->context.window * sizeof(double));
    if (memory == NULL) {
        return fmi3_status(hsep_refuse(self, "%s: no memory for a window", call->name));
    }
    if (hsep_values_check(self, &of, message) != HSEP_OK || hsep_values_check(self, &by, message) != HSEP_OK ||
        derivative_check(self, &of, &by, &window, message) != HSEP_OK) {
        (void)hsep_refuse(self, "%s", message);
        self = NULL;
    } else if (derivative_take(self, &of, &by, window, memory, sensitivity, message) != HSEP_OK) {
        (void)hsep_refuse(self, "%s: %s", call->name, message);
        self = NULL;
    }
    hsep_delete(instance, memory);
    return self == NULL ? fmi3Error : fmi3OK;
}

#else
typedef int hsep_no_derivative; /* a translation unit must not be empty */
#endif
