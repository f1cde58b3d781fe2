/* ReferenceTrajectory: a source of commands, to be wired to HybridPredictor.x_d_ahead.
 *
 * The samples come from the resource trajectory_<n>.bin, n being the parameter trajectory: a head, then the samples as
 * doubles, m, all little-endian. Sample k is the output from instant k on (hsep_clock.h); after the last one it stays.
 * The samples are part of the state, so a state's size follows from the file.
 */
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_REFERENCE_TRAJECTORY)

#ifdef HSEP_NO_FILES
#error "ReferenceTrajectory plays files of its resources, which HSEP_NO_FILES leaves out"
#endif

#include "hsep_check.h"
#include "hsep_resource.h"
#include "hsep_text.h"

#include <stdio.h>

#define TRAJECTORY_NAME_SIZE 32

static const double trajectory_tolerance = 1e-6; /* of T_s */

typedef struct {
    hsep_clock clock;
    uint64_t count;   /* samples, >= 1 */
    double samples[]; /* m */
} trajectory_state;

typedef struct {
    char magic[8]; /* HSEPTRJ1 */
    uint64_t count;
    double T_s; /* s */
} trajectory_head;
HSEP_ASSERT_WORDS(trajectory_head, 3);

/* Position at sample k >= 0, m: the last sample is held. */
static double trajectory_position(const trajectory_state *self, int64_t k)
{
    return self->samples[(uint64_t)k < self->count ? (uint64_t)k : self->count - 1];
}

/* Check the parameters, open the chosen trajectory's file, read up to its first sample, and return the number of
 * samples. The caller closes it; NULL with a message if something does not fit. */
static FILE *trajectory_open(const hsep_context *context, const double values[], uint64_t *count, char message[])
{
    char name[TRAJECTORY_NAME_SIZE];
    trajectory_head head;
    if (hsep_check_parameters(context, values, message) > 0) {
        return NULL;
    }
    hsep_text(name, sizeof name, "trajectory_%.0f.bin", values[HSEP_VR_trajectory]);
    FILE *file = hsep_resource_open(context->resources, name);
    if (file == NULL) {
        hsep_message_add(
            message, "%s must be in the resources (%s) and readable", name,
            context->resources == NULL ? "none" : context->resources);
        return NULL;
    }
    if (fread(&head, sizeof head, 1, file) != 1 || memcmp(head.magic, "HSEPTRJ1", sizeof head.magic) != 0 ||
        head.count < 1 || (double)head.count * (double)sizeof(double) != (double)hsep_resource_left(file)) {
        hsep_message_add(message, "%s must be samples of a trajectory, at least one; it is damaged or truncated", name);
    } else if (!(fabs(head.T_s - values[HSEP_VR_T_s]) <= trajectory_tolerance * values[HSEP_VR_T_s])) {
        hsep_message_add(
            message, "T_s must be %s s, the interval of %s, got %s", HSEP_SHOWN(head.T_s), name,
            HSEP_SHOWN(values[HSEP_VR_T_s]));
    } else {
        *count = head.count;
        return file;
    }
    fclose(file);
    return NULL;
}

/* Size of a state with count samples, bytes. */
static hsep_status trajectory_bytes(uint64_t count, size_t *size, char message[])
{
    return hsep_check_bytes((double)sizeof(trajectory_state) + (double)count * (double)sizeof(double), size, message);
}

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    uint64_t count = 0;
    FILE *file = trajectory_open(context, values, &count, message);
    if (file == NULL) {
        return HSEP_REFUSED;
    }
    fclose(file);
    return trajectory_bytes(count, size, message);
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    trajectory_state *self = state;
    size_t needed = 0;
    uint64_t count = 0;
    if (hsep_check_clock(&self->clock, t_start, values[HSEP_VR_T_s], message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    FILE *file = trajectory_open(context, values, &count, message);
    if (file == NULL) {
        return HSEP_REFUSED;
    }
    /* Memory was taken for the samples that were there when hsep_model_size looked. */
    if (trajectory_bytes(count, &needed, message) != HSEP_OK || hsep_check_memory(needed, size, message) != HSEP_OK) {
        fclose(file);
        return HSEP_REFUSED;
    }
    self->count = count;
    const size_t n_read = fread(self->samples, sizeof self->samples[0], (size_t)count, file);
    fclose(file);
    for (uint64_t k = 0; k < count; k++) {
        if (k >= n_read || !isfinite(self->samples[k])) {
            return hsep_message_add(
                message, "trajectory_%.0f.bin must be finite, got %s at sample %.0f", values[HSEP_VR_trajectory],
                k < n_read ? HSEP_SHOWN(self->samples[k]) : "nothing", (double)k);
        }
    }
    values[HSEP_VR_r] = trajectory_position(self, 0);
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    (void)context;
    trajectory_state *self = state;
    hsep_clock_step step;
    if (hsep_check_step(&self->clock, t, h, &step, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    self->clock = step.after;
    values[HSEP_VR_r] = trajectory_position(self, self->clock.k);
    return hsep_check_moved(&step, message);
}

HSEP_API hsep_status hsep_model_check_start(const hsep_context *context, const double values[], char message[])
{
    (void)context, (void)values, (void)message; /* it has no input */
    return HSEP_OK;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    char message[HSEP_MESSAGE_SIZE] = "";
    uint64_t count = 0;
    double first = 0.0;
    values[HSEP_VR_r] = 0.0;
    FILE *file = trajectory_open(context, values, &count, message);
    if (file == NULL) {
        return;
    }
    if (fread(&first, sizeof first, 1, file) == 1 && isfinite(first)) {
        values[HSEP_VR_r] = first;
    }
    fclose(file);
}

#endif
