/* HybridPredictor, the look-ahead buffer that predicts the drive's position one window early, and SepCompensator, which
 * modifies the command too, so that the drive follows it. One of them is compiled into an FMU.
 *
 * Inputs are latched at the instants t_k that lie in a step, outputs belong to the last instant that was reached; the
 * core does the arithmetic. If the context has weights, it starts with them.
 */
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_HYBRID_PREDICTOR) || defined(HSEP_MODEL_SEP_COMPENSATOR)

#include "hsep_check.h"
#include "hsep_compensator.h"
#include "hsep_learned.h"
#include "hsep_table.h"
#include "hsep_windows.h"

#if defined(HSEP_MODEL_HYBRID_PREDICTOR)
#define ONLINE(function) hsep_predictor_##function
typedef hsep_predictor online_block;
#else
#define ONLINE(function) hsep_compensator_##function
typedef hsep_compensator online_block;
#endif

/* The clock, and the inputs of the sample in progress. */
typedef struct {
    hsep_clock clock;
    double x_d_ahead, x_meas, x_load; /* m */
    double padding;                   /* what follows the struct begins at a multiple of 16 bytes */
} online_inputs;
HSEP_ASSERT_WORDS(online_inputs, 9);

typedef struct {
    online_inputs inputs;
    online_block online; /* its arrays follow */
} online_state;

/* The arrays after the struct begin at a multiple of 16 bytes, as an importer's memory does. */
HSEP_ASSERT(alignment_of_online_state, sizeof(online_state) % 16 == 0);

/* Read a setting of the library. */
#define READ(of, type, name, ...) parameters->of.name = (type)values[HSEP_VR_##name];

/* Write the outputs that both models have. */
static void online_write_predicted(const hsep_predictor_outputs *outputs, double values[])
{
    values[HSEP_VR_x_d] = outputs->x_d;
    values[HSEP_VR_x_pb] = outputs->x_pb;
    values[HSEP_VR_x_h] = outputs->x_h;
    values[HSEP_VR_x_h_std] = outputs->x_h_std;
    /* The predicted servo error, of a compensator what is left */
    values[HSEP_VR_e_servo] = outputs->x_d - outputs->x_h;
    values[HSEP_VR_rms_pb] = outputs->rms_pb;
    values[HSEP_VR_rms_h] = outputs->rms_h;
    values[HSEP_VR_rms_hold] = outputs->rms_hold;
    values[HSEP_VR_batch] = (double)outputs->batch;
    values[HSEP_VR_n_rejected] = (double)outputs->n_rejected;
}

/* The model's own ---------------------------------------------------------------------------------------------------
 * online_check: of its settings together, each problem added to message. online_derive: its parameters, after all were
 * checked and the common ones read. online_tune: the tunable parameters, from when hsep.h says. online_begin: after
 * learned weights were loaded. online_x_load: the drive's load. online_sample: process a sample. */

#if defined(HSEP_MODEL_HYBRID_PREDICTOR)

static void online_check(const double values[], char message[]) { (void)values, (void)message; }
static void online_tune(hsep_predictor *self, const double values[]) { (void)self, (void)values; }
static void online_begin(hsep_predictor *self) { (void)self; }
static double online_x_load(const hsep_context *context, const double values[])
{
    (void)context, (void)values;
    return 0.0;
}
static void online_sample(hsep_predictor *self, const online_inputs *inputs)
{
    (void)hsep_predictor_sample(self, inputs->x_d_ahead, inputs->x_meas);
}
static hsep_predictor *online_predictor(hsep_predictor *self) { return self; }

static hsep_predictor_parameters online_derive(const double values[], hsep_parameters *parameters)
{
    (void)values;
    return hsep_predictor_derive(parameters);
}

static void online_write(const hsep_predictor *self, double values[])
{
    hsep_predictor_outputs outputs;
    hsep_predictor_read(self, &outputs);
    online_write_predicted(&outputs, values);
    values[HSEP_VR_hybrid_active] = outputs.hybrid_active;
}

HSEP_API void hsep_model_show_windows(const hsep_context *context, void *state, double values[])
{
    hsep_predictor *self = &((online_state *)state)->online;
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

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    const double start = values[HSEP_VR_x_d_ahead]; /* the drive rests there */
    online_write_predicted(&(hsep_predictor_outputs){.x_d = start, .x_pb = start, .x_h = start}, values);
    values[HSEP_VR_hybrid_active] = 0.0;
    for (size_t i = 0; i < context->window; i++) {
        const double position = (double)i < values[HSEP_VR_Np] ? start : 0.0;
        values[HSEP_VR_x_d_window(context) + i] = position;
        values[HSEP_VR_x_pb_window(context) + i] = position;
        values[HSEP_VR_x_h_window(context) + i] = position;
        values[HSEP_VR_x_h_std_window(context) + i] = 0.0;
    }
}

#else

static void online_check(const double values[], char message[])
{
    const double Np = values[HSEP_VR_Np], spacing = values[HSEP_VR_spacing], preview = values[HSEP_VR_preview];
    const double least = Np + 4.0 * spacing + 3.0;
    if (fmod(Np, spacing) != 0.0) {
        hsep_message_add(message, "spacing must be " HSEP_AT_LEAST " 1 and divide Np = %.0f, got %.0f", Np, spacing);
    }
    if (preview < least) {
        hsep_message_add(
            message, "preview must be " HSEP_AT_LEAST " Np + 4" HSEP_DOT "spacing + 3 = %.0f, got %.0f", least,
            preview);
    }
    if (values[HSEP_VR_measurement_delay] > 0.0 && values[HSEP_VR_averaging] == 0.0) {
        hsep_message_add(
            message,
            "measurement_delay of a compensator must be 0 with averaging = false, got %.0f: only the model with "
            "averaging plans from a late measurement",
            values[HSEP_VR_measurement_delay]);
    }
}

static void online_tune(hsep_compensator *self, const double values[])
{
    hsep_compensator_reset(self, values[HSEP_VR_reset] != 0.0);
    (void)hsep_compensator_change(
        self, (hsep_sep_state)values[HSEP_VR_compensate], values[HSEP_VR_change_max],
        values[HSEP_VR_following_error_max]);
}

static void online_begin(hsep_compensator *self) { hsep_compensator_begin(self); }
static double online_x_load(const hsep_context *context, const double values[])
{
    return values[HSEP_VR_x_load(context)];
}
static void online_sample(hsep_compensator *self, const online_inputs *inputs)
{
    hsep_compensator_load(self, inputs->x_load);
    (void)hsep_compensator_sample(self, inputs->x_d_ahead, inputs->x_meas);
}
static hsep_predictor *online_predictor(hsep_compensator *self) { return hsep_compensator_predictor(self); }

static hsep_predictor_parameters online_derive(const double values[], hsep_parameters *parameters)
{
    HSEP_COMPENSATOR_SETTINGS(READ)
    return hsep_compensator_derive(parameters);
}

static void online_write(const hsep_compensator *self, double values[])
{
    hsep_compensator_outputs outputs;
    hsep_compensator_read(self, &outputs);
    online_write_predicted(&outputs.predicted, values);
    values[HSEP_VR_x_dm] = outputs.x_dm;
    values[HSEP_VR_sep_state] = (double)outputs.state;
    values[HSEP_VR_rms_e] = outputs.predicted.rms_e;
    values[HSEP_VR_no_measurement] = (double)outputs.no_measurement;
    values[HSEP_VR_alarm] = (double)outputs.alarm;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    (void)context;
    const double start = values[HSEP_VR_x_d_ahead]; /* the drive rests there */
    /* The model with averaging predicts from the beginning, with the noise that is assumed. */
    const double noise = hsep_uncertainty_first_variance(values[HSEP_VR_lambda], values[HSEP_VR_noise_std]);
    const hsep_sep_state compensate = (hsep_sep_state)values[HSEP_VR_compensate];
    const int predicts = values[HSEP_VR_averaging] > 0.0 && compensate == HSEP_SEP_HYBRID;
    const double x_h_std = predicts && noise > 0.0 && noise < HUGE_VAL ? sqrt(noise) : 0.0;
    online_write_predicted(
        &(hsep_predictor_outputs){.x_d = start, .x_pb = start, .x_h = start, .x_h_std = x_h_std}, values);
    values[HSEP_VR_x_dm] = start;
    values[HSEP_VR_sep_state] = (double)(compensate == HSEP_SEP_OFF ? HSEP_SEP_OFF : HSEP_SEP_PHYSICS);
    values[HSEP_VR_rms_e] = values[HSEP_VR_no_measurement] = values[HSEP_VR_alarm] = 0.0;
}

#endif

/* Input at place, m, `after` s into the step; the importer may have set its time derivative. */
static double online_at(const hsep_context *context, const double values[], size_t place, double after)
{
    const double slope = values[context->n_variables + place];
    return slope == 0.0 ? values[place] : values[place] + slope * after;
}

/* Count a step from t by h, s, and check the inputs that it latches; self is unchanged. may_miss: whether x_meas may be
 * NaN, which is missing. Fails if one of them cannot be taken in, or t and h do not fit. HSEP_WARNED_LATE: an instant
 * is no communication point; HSEP_WARNED_MOVED: one was taken at a point beside it; or both. */
static hsep_status online_count(
    const hsep_context *context, const online_inputs *self, const double values[], int may_miss, double t, double h,
    hsep_clock_step *counted, char message[])
{
    if (hsep_check_step(&self->clock, t, h, counted, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (counted->n_latched == 0) {
        return hsep_check_moved(counted, message);
    }
    /* Inputs are linear in time, so the first and the last one, s after the step's start, bound them all. */
    const double last = counted->first + (double)(counted->n_latched - 1) * self->clock.T_s;
    const double after[2] = {counted->first, last};
    const double sample = (double)(self->clock.k + hsep_clock_latched(&self->clock));
    const double x_load = online_x_load(context, values); /* constant over the step */
    if (hsep_check_position(context, "x_load", x_load, " at sample %.0f", sample, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    for (int i = 0; i < 2; i++) {
        const double ahead = online_at(context, values, HSEP_VR_x_d_ahead, after[i]);
        const double measured = online_at(context, values, HSEP_VR_x_meas, after[i]);
        const int missing = may_miss && isnan(measured);
        if (hsep_check_position(context, "x_d_ahead", ahead, " at sample %.0f", sample, message) != HSEP_OK ||
            (!missing &&
             hsep_check_position(context, "x_meas", measured, " at sample %.0f", sample, message) != HSEP_OK)) {
            return HSEP_REFUSED;
        }
    }
    const hsep_status status = hsep_check_moved(counted, message);
    if (counted->inside) {
        hsep_message_add(
            message,
            "the step from %.9g s by %.9g s contains sampling instants of T_s = %g s between its ends: x_meas is read "
            "up to %g s late, so a closed loop needs steps of T_s",
            t, h, self->clock.T_s, fmin(last, h));
        return status == HSEP_OK ? HSEP_WARNED_LATE : HSEP_WARNED_BOTH;
    }
    return status;
}

/* Both models' ---------------------------------------------------------------------------------------------------- */

/* Check all parameters, and read them: the library's, whose modes stay in values, and the model's; size: in bytes. */
static hsep_status online_checked(
    const hsep_context *context, const double values[], hsep_parameters *parameters, hsep_predictor_parameters *derived,
    size_t *size, char message[])
{
    const double Np = values[HSEP_VR_Np], p = values[HSEP_VR_p], q = values[HSEP_VR_q];
    if (hsep_check_parameters(context, values, message) > 0) {
        return HSEP_REFUSED;
    }
    if (p > Np) {
        hsep_message_add(message, "p must be 1 " HSEP_TO " Np = %.0f, got %.0f; lower p or raise Np", Np, p);
    }
    if (q >= Np) {
        hsep_message_add(
            message, "q must be 0 " HSEP_TO " Np " HSEP_MINUS " 1 = %.0f, got %.0f; lower q or raise Np", Np - 1.0, q);
    }
    online_check(values, message);
    if (message[0] != '\0') {
        return HSEP_REFUSED;
    }
    *parameters = (hsep_parameters){.n_modes = context->n_modes, .modes = hsep_table_modes(context, values)};
    HSEP_PREDICTOR_SETTINGS(READ)
    HSEP_AVERAGING_SETTINGS(READ)
    *derived = online_derive(values, parameters);
    const double before = (double)(sizeof(online_state) - sizeof(online_block));
    return hsep_check_bytes(before + ONLINE(lay_out)(&(online_block){0}, derived), size, message);
}

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    hsep_parameters parameters;
    hsep_predictor_parameters derived;
    return online_checked(context, values, &parameters, &derived, size, message);
}

/* Add to message what differs from what the weights were learned with. */
static void online_compare(const char *name, double learned, double got, hsep_kind kind, char message[])
{
    char then[HSEP_NUMBER_SIZE], now[HSEP_NUMBER_SIZE];
    if (learned != got) {
        hsep_message_add(
            message, "%s must be %s, with which this FMU was trained (weights.bin), got %s", name,
            hsep_number(then, learned, kind), hsep_number(now, got, kind));
    }
}

/* Say which settings differ from those of weights that are whole. One that the table does not have counts as 0; modes
 * that only one side has show in the number of modes. */
static void online_name_others(const hsep_context *context, const double values[], char message[])
{
    hsep_learned_bytes from = {context->weights, context->weights_size};
    hsep_learned_head head;
    hsep_learned_setting setting;
    (void)hsep_learned_read(&from, &head, sizeof head);
    online_compare("the number of modes", (double)head.n_modes, (double)context->n_modes, HSEP_INTEGER, message);
    for (uint64_t i = 0; i < head.n_settings && hsep_learned_next(&from, &setting); i++) {
        const size_t place = hsep_table_place(context, setting.name);
        if (place < context->n_variables) {
            const hsep_kind kind = hsep_table_row(context, place)->kind;
            online_compare(setting.name, setting.value, values[place], kind, message);
        } else if (strncmp(setting.name, "mode[", 5) != 0) {
            online_compare(setting.name, setting.value, 0.0, HSEP_REAL, message);
        }
    }
}

/* Take over the weights of the context, if it has some. */
static hsep_status online_load(
    const hsep_context *context, const double values[], const hsep_parameters *parameters, hsep_predictor *predictor,
    char message[])
{
    const hsep_began began = hsep_learned_load(predictor, parameters, context->weights, context->weights_size);
    if (began == HSEP_BEGAN) {
        return HSEP_OK;
    }
    if (began == HSEP_WEIGHTS_OTHER) {
        online_name_others(context, values, message);
    }
    if (message[0] == '\0') {
        hsep_message_add(message, "weights.bin is damaged, truncated or from another version; train again");
    }
    return HSEP_REFUSED;
}

/* Refuse outputs of a window that diverges. */
static hsep_status online_converges(const hsep_predictor *predictor, char message[])
{
    static const char *const names[] = {"", "x_pb", "x_h", "x_dm"};
    if (predictor->divergence == HSEP_CONVERGES) {
        return HSEP_OK;
    }
    message[0] = '\0'; /* a warning of the step no longer matters */
    return hsep_message_add(
        message,
        "%s must stay within " HSEP_PLUS_MINUS "%g m: the learned recursion diverges; raise lambda, lower p or reset",
        names[predictor->divergence], HSEP_PREDICTION_MAX);
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    size_t needed = 0;
    online_state *self = state;
    hsep_parameters parameters;
    hsep_predictor_parameters derived;
    const double start = values[HSEP_VR_x_d_ahead];
    if (online_checked(context, values, &parameters, &derived, &needed, message) != HSEP_OK ||
        hsep_check_memory(needed, size, message) != HSEP_OK ||
        hsep_model_check_start(context, values, message) != HSEP_OK ||
        hsep_check_clock(&self->inputs.clock, t_start, values[HSEP_VR_T_s], message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    self->inputs.x_d_ahead = self->inputs.x_meas = start;
    self->inputs.x_load = online_x_load(context, values);
    ONLINE(block_init)(&self->online, &derived, start);
    hsep_predictor *predictor = online_predictor(&self->online);
    if (online_load(context, values, &parameters, predictor, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    online_begin(&self->online);
    if (online_converges(predictor, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    online_write(&self->online, values);
    if (predictor->early) {
        (void)hsep_message_add(
            message,
            "measurement_delay = -1 holds x_meas for a sample: set it under a sequential (Gauss-Seidel) master that "
            "carries one connection of the loop within a step; under any other leave 0, as -1 makes errors larger");
        return HSEP_WARNED;
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_model_check_start(const hsep_context *context, const double values[], char message[])
{
    return hsep_check_position(context, "the start value of x_d_ahead", values[HSEP_VR_x_d_ahead], "", 0.0, message);
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    online_state *self = state;
    hsep_predictor *predictor = online_predictor(&self->online);
    const int may_miss = hsep_predictor_averaged(predictor) != NULL;
    hsep_clock_step step;
    if (online_converges(predictor, message) != HSEP_OK) { /* of an earlier step */
        return HSEP_REFUSED;
    }
    const hsep_status status = online_count(context, &self->inputs, values, may_miss, t, h, &step, message);
    if (status == HSEP_REFUSED) {
        return HSEP_REFUSED;
    }
    online_tune(&self->online, values);
    online_inputs *inputs = &self->inputs;
    const int64_t latched = hsep_clock_latched(&inputs->clock); /* the first sample's inputs, by the last step */
    for (int64_t n = 0; n <= step.n_samples; n++) {
        if (n >= latched && n - latched < step.n_latched) {
            const double after = step.first + (double)(n - latched) * inputs->clock.T_s;
            inputs->x_d_ahead = online_at(context, values, HSEP_VR_x_d_ahead, after);
            inputs->x_meas = online_at(context, values, HSEP_VR_x_meas, after);
            inputs->x_load = online_x_load(context, values);
        }
        if (n == step.n_samples) {
            break;
        }
        inputs->clock.k++;
        online_sample(&self->online, inputs);
        if (online_converges(predictor, message) != HSEP_OK) {
            return HSEP_REFUSED;
        }
    }
    inputs->clock = step.after;
    online_write(&self->online, values);
    return status;
}

#endif
