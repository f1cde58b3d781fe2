/* SepCompensator: the look-ahead buffer that modifies the command so that the drive follows it. */
#include "hsep_online.h"

#if defined(HSEP_MODEL_SEP_COMPENSATOR)

#include "hsep_check.h"
#include "hsep_model.h"
#include "hsep_parameters.h"

#include <math.h>

HSEP_API int hsep_online_check(const double values[], char message[])
{
    const double Np = values[HSEP_VR_Np], spacing = values[HSEP_VR_spacing], preview = values[HSEP_VR_preview];
    const double least = Np + 4.0 * spacing + 3.0;
    int problems = 0;
    if (fmod(Np, spacing) != 0.0) {
        hsep_message_add(message, "spacing must be " HSEP_AT_LEAST " 1 and divide Np = %.0f, got %.0f", Np, spacing);
        problems++;
    }
    if (preview < least) {
        hsep_message_add(
            message, "preview must be " HSEP_AT_LEAST " Np + 4" HSEP_DOT "spacing + 3 = %.0f, got %.0f", least,
            preview);
        problems++;
    }
    if (values[HSEP_VR_measurement_delay] > 0.0 && values[HSEP_VR_averaging] == 0.0) {
        hsep_message_add(
            message,
            "measurement_delay of a compensator must be 0 with averaging = false, got %.0f: only the model with "
            "averaging "
            "plans from a late measurement",
            values[HSEP_VR_measurement_delay]);
        problems++;
    }
    return problems;
}

HSEP_API hsep_online_parameters hsep_online_derive(const double values[], hsep_parameters *common)
{
#define READ(type, name) common->compensator.name = (type)values[HSEP_VR_##name];
    HSEP_COMPENSATOR_SETTINGS(READ)
#undef READ
    return hsep_compensator_derive(common);
}

HSEP_API void hsep_online_tune(hsep_online *self, const double values[])
{
    hsep_compensator_reset(self, values[HSEP_VR_reset] != 0.0);
    (void)hsep_compensator_change(
        self, (hsep_sep_state)values[HSEP_VR_compensate], values[HSEP_VR_change_max],
        values[HSEP_VR_following_error_max]);
}

HSEP_API void hsep_online_begin(hsep_online *self) { hsep_compensator_begin(self); }

HSEP_API hsep_predictor *hsep_online_predictor(hsep_online *self) { return hsep_compensator_predictor(self); }

HSEP_API void hsep_online_write(const hsep_online *self, double values[])
{
    hsep_compensator_outputs outputs;
    hsep_compensator_read(self, &outputs);
    const hsep_predictor_outputs *predicted = &outputs.predicted;
    values[HSEP_VR_x_dm] = outputs.x_dm;
    values[HSEP_VR_x_d] = predicted->x_d;
    values[HSEP_VR_x_pb] = predicted->x_pb;
    values[HSEP_VR_x_h] = predicted->x_h;
    values[HSEP_VR_x_h_std] = predicted->x_h_std;
    values[HSEP_VR_e_servo] = predicted->x_d - predicted->x_h; /* the predicted servo error that is left */
    values[HSEP_VR_sep_state] = (double)outputs.state;
    values[HSEP_VR_rms_e] = predicted->rms_e;
    values[HSEP_VR_rms_pb] = predicted->rms_pb;
    values[HSEP_VR_rms_h] = predicted->rms_h;
    values[HSEP_VR_rms_hold] = predicted->rms_hold;
    values[HSEP_VR_batch] = (double)predicted->batch;
    values[HSEP_VR_n_rejected] = (double)predicted->n_rejected;
    values[HSEP_VR_no_measurement] = (double)outputs.no_measurement;
    values[HSEP_VR_alarm] = (double)outputs.alarm;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    (void)context;
    const double start = values[HSEP_VR_x_d_ahead]; /* the drive rests there */
    values[HSEP_VR_x_dm] = values[HSEP_VR_x_d] = values[HSEP_VR_x_pb] = values[HSEP_VR_x_h] = start;
    /* The model with averaging predicts from the beginning, with the noise that is assumed. */
    const double noise = hsep_uncertainty_first_variance(values[HSEP_VR_lambda], values[HSEP_VR_noise_std]);
    const int predicts = values[HSEP_VR_averaging] > 0.0 && values[HSEP_VR_compensate] > 1.0;
    values[HSEP_VR_x_h_std] = predicts && noise > 0.0 && noise < HUGE_VAL ? sqrt(noise) : 0.0;
    values[HSEP_VR_e_servo] = values[HSEP_VR_rms_e] = 0.0;
    values[HSEP_VR_rms_pb] = values[HSEP_VR_rms_h] = values[HSEP_VR_rms_hold] = 0.0;
    values[HSEP_VR_batch] = values[HSEP_VR_n_rejected] = values[HSEP_VR_no_measurement] = values[HSEP_VR_alarm] = 0.0;
    values[HSEP_VR_sep_state] = values[HSEP_VR_compensate] > 0.0 ? 1.0 : 0.0;
}

#else
typedef int hsep_no_sep_compensator; /* a translation unit must not be empty */
#endif
