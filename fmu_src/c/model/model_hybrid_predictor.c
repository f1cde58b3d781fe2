/* HybridPredictor: the look-ahead buffer that predicts the drive's position one window early. */
#include "hsep_online.h"

#if defined(HSEP_MODEL_HYBRID_PREDICTOR)

#include "hsep_check.h"
#include "hsep_model.h"
#include "hsep_parameters.h"
#include "hsep_windows.h"

HSEP_API int hsep_online_check(const double values[], char message[])
{
    (void)values, (void)message;
    return 0;
}

HSEP_API hsep_online_parameters hsep_online_derive(const double values[], hsep_parameters *common)
{
    (void)values;
    return hsep_predictor_derive(common);
}

HSEP_API void hsep_online_tune(hsep_online *self, const double values[]) { (void)self, (void)values; } /* it has none */

HSEP_API void hsep_online_begin(hsep_online *self) { (void)self; }

HSEP_API hsep_predictor *hsep_online_predictor(hsep_online *self) { return self; }

HSEP_API void hsep_online_write(const hsep_online *self, double values[])
{
    hsep_predictor_outputs outputs;
    hsep_predictor_read(self, &outputs);
    values[HSEP_VR_x_d] = outputs.x_d;
    values[HSEP_VR_x_pb] = outputs.x_pb;
    values[HSEP_VR_x_h] = outputs.x_h;
    values[HSEP_VR_x_h_std] = outputs.x_h_std;
    values[HSEP_VR_e_servo] = outputs.x_d - outputs.x_h; /* the predicted servo error */
    values[HSEP_VR_hybrid_active] = outputs.hybrid_active;
    values[HSEP_VR_rms_pb] = outputs.rms_pb;
    values[HSEP_VR_rms_h] = outputs.rms_h;
    values[HSEP_VR_rms_hold] = outputs.rms_hold;
    values[HSEP_VR_batch] = (double)outputs.batch;
    values[HSEP_VR_n_rejected] = (double)outputs.n_rejected;
}

HSEP_API void hsep_model_show_windows(const hsep_context *context, void *state, double values[])
{
    hsep_predictor *self = hsep_model_predictor(state);
    hsep_predictor_complete(self);
    /* Entries past a smaller Np are 0, of a larger Np the first ones are shown. */
    for (size_t i = 0; self->divergence == HSEP_CONVERGES && i < context->window; i++) {
        const int shown = i < self->Np;
        values[HSEP_VR_x_d_window(context) + i] = shown ? hsep_at_const(self, self->x_d)[i] : 0.0;
        values[HSEP_VR_x_pb_window(context) + i] = shown ? hsep_at_const(self, self->x_pb)[i] : 0.0;
        values[HSEP_VR_x_h_window(context) + i] = shown ? hsep_at_const(self, self->x_h)[i] : 0.0;
        values[HSEP_VR_x_h_std_window(context) + i] = shown ? hsep_predictor_std(self, i) : 0.0;
    }
}

HSEP_API hsep_status
hsep_model_derivative(void *state, const double direction[], double x_h[], double *now, double work[], char message[])
{
    hsep_predictor *self = hsep_model_predictor(state);
    if (hsep_residual_paper(hsep_predictor_model(self)) == NULL) {
        return hsep_message_add(
            message, "x_h is linear in x_d_window with averaging = false alone, got averaging = true");
    }
    hsep_predictor_respond(self, direction, work, x_h);
    *now = x_h[self->k % self->Np];
    return HSEP_OK;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    const double start = values[HSEP_VR_x_d_ahead]; /* the drive rests there */
    values[HSEP_VR_x_d] = values[HSEP_VR_x_pb] = values[HSEP_VR_x_h] = start;
    values[HSEP_VR_x_h_std] = values[HSEP_VR_e_servo] = 0.0;
    values[HSEP_VR_rms_pb] = values[HSEP_VR_rms_h] = values[HSEP_VR_rms_hold] = 0.0;
    values[HSEP_VR_hybrid_active] = values[HSEP_VR_batch] = values[HSEP_VR_n_rejected] = 0.0;
    for (size_t i = 0; i < context->window; i++) {
        const double position = (double)i < values[HSEP_VR_Np] ? start : 0.0;
        values[HSEP_VR_x_d_window(context) + i] = position;
        values[HSEP_VR_x_pb_window(context) + i] = position;
        values[HSEP_VR_x_h_window(context) + i] = position;
        values[HSEP_VR_x_h_std_window(context) + i] = 0.0;
    }
}

#else
typedef int hsep_no_hybrid_predictor; /* a translation unit must not be empty */
#endif
