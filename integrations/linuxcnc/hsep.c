/* HAL component for LinuxCNC: servo error pre-compensation, or only prediction, of one axis each in a servo thread.
 *
 *     loadrt hsep axes=/home/me/x,/home/me/y
 *     addf hsep.x servo-thread              after motion-controller, before what writes to the drive
 *
 * An axis is a folder that hybridsep hal has written: variables.bin, and weights.bin if it starts with what an earlier
 * run has learned. Both are read when the component is loaded. It is named after its folder.
 *
 * In each period the pins take the outputs of this sample, which were computed in the period before, then the sample
 * (cmd, fb) is processed: cmd is the command that the drive is to have in `look-ahead` periods, fb the position
 * measured at the begin of this period. So a log of out and fb, sampled in one thread, is what hybridsep fit expects.
 *
 * Never a step: out is the command of look-ahead periods ago plus a change, in every branch but inactive, where it is
 * fb. The line of commands goes on in all of them. The change is the model's, which keeps the drive's limits, or, where
 * there is no model, what is left of it fades within them. A run of the model begins only at rest: when the command
 * has stood for look-ahead periods, and no change is left. What ends one in motion (reset, another period) ends its
 * plans, and the model follows the remainder of the last one until then. A trip of its following-error monitor ends
 * none: reset ends the trip, and the model plans on.
 *
 * Real time: axis_step allocates nothing, locks nothing and opens no file; it costs as much as hsep_compensator_sample
 * (hsep.h). A begin costs some 100 us more: the state is filled anew.
 */
#pragma GCC optimize("O3") /* LinuxCNC compiles for size */

#include "hal.h"
#include "rtapi.h"
#include "rtapi_app.h"
#include "rtapi_math.h"

#include "sources/all.c"

#include <stdlib.h>

MODULE_AUTHOR("the authors of hybridsep");
MODULE_DESCRIPTION("Servo error pre-compensation with a linear hybrid model");
MODULE_LICENSE("Dual BSD/GPL");

/* The component is named as its module: loadrt waits for it */
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
#define HSEP_COMPONENT "hsep"
#define HSEP_WRITTEN_BY ""
#else
#define HSEP_COMPONENT "hsep_predictor"
#define HSEP_WRITTEN_BY " --predictor"
#endif

#define HSEP_PATH_SIZE 4096 /* characters */
#define HSEP_AXES 9         /* as many joints as LinuxCNC has */
#define HSEP_TURN 6.283185307179586
#define HSEP_FAST 1.000001   /* of the largest velocity: a command above it is faster, for more than its rounding */
#define HSEP_ORIGIN 1.5      /* of the largest step: cmd and fb that both step by more are at another origin */
#define HSEP_ALIKE 0.25      /* of such a step: what fb may differ by from cmd, and out may have moved by itself */
#define HSEP_REMEMBERED 0.97 /* of a step of out, a period later: the drive may still be on its way */
#define HSEP_FADE 0.2        /* 1/periods, rate at which a change without a model fades, if the limits allow it */
#define HSEP_GONE 1e-3       /* of the largest acceleration and jerk: a change that may end by a step */
#define HSEP_NOISE 4.0       /* of the largest acceleration, a period: what a command at rest may move by */
#define HSEP_OTHER_T_S 0.01  /* deviation of the period, relative to the sampling interval, that is another one */

static char *axes[HSEP_AXES];
RTAPI_MP_ARRAY_STRING(axes, HSEP_AXES, "folders of the axes, written by hybridsep hal");

/* Values of the pin state. */
enum {
    AXIS_NO_MEASUREMENT = -3,
    AXIS_WRONG_PERIOD = -2,
    AXIS_FAULT = -1,
    AXIS_INACTIVE = 0,
    AXIS_DELAYS = 1,
    AXIS_PHYSICS = 2,
    AXIS_HYBRID = 3,
    AXIS_TRIPPED = 4
};

/* Pins and parameters, in HAL's memory. Positions are in machine units. */
typedef struct {
    hal_float_t *cmd, *fb;                                               /* in */
    hal_bit_t *active, *enable, *reset;                                  /* in */
    hal_float_t *out, *delayed, *fb_joint, *predicted, *error, *std_dev; /* out */
    hal_s32_t *state;                                                    /* out */
    hal_float_t scale;    /* parameter: machine units in a metre, or a radian */
    hal_u32_t model;      /* parameter: 1 physics, 2 hybrid */
    hal_u32_t look_ahead; /* parameter: periods */
    hal_u32_t rejected;   /* parameter: measurements not believed */
} axis_pins;

/* Positions are in m, of a rotary axis in rad, and relative to an origin; the newest first where there are several. */
typedef struct {
    axis_pins *pins;
    hsep_instance instance; /* the model and its memory */
    double *ring;           /* (n_ring,) the last commands */
    size_t n_ring, at;
    double limit[3];                       /* m, of the differences of the change of orders 1 to 3 */
    double scale;                          /* machine units in a metre */
    double origin;                         /* of a rotary axis whole turns, and what cmd and fb jumped by */
    double command, step;                  /* the last one, and what it moved by */
    double feedback[2], measured;          /* the last ones: NaN, and held, where it is missing */
    double out, moved;                     /* the last one; its largest step, which is forgotten by and by */
    double change, velocity, acceleration; /* of the command, out - delayed, a period */
    size_t still;                          /* periods since the command has moved, n_ring at most */
    size_t fast;    /* periods until the model's preview holds no command that is faster than the limits */
    size_t missing; /* measurements, one after another */
    uint64_t k;     /* sample of this run */
    int begun;      /* whether there was a command */
    int runs;       /* whether the model does */
    int ending;     /* whether it makes no more plans, to begin anew at rest */
    int faulty;     /* whether it has refused a sample: it does not begin until reset or inactive */
    int held;       /* whether the command is no position, so that the last one is held */
    int said;       /* whether that was said */
    int was_reset, was_active;
} axis_data;

static const hsep_fmi_names axis_words = {
    .instantiate = "loadrt " HSEP_COMPONENT, .location = "axes", .location_form = "a folder written by hybridsep hal"};

static axis_data axis_all[HSEP_AXES];
static int axis_component = -1;
static char axis_message[HSEP_MESSAGE_SIZE];

static double *axis_value(axis_data *self, size_t place) { return &self->instance.values[place]; }

/* What the two components differ in: the model's change of the command in this sample; the model that may plan until
 * the parameter is set, the machine file's; the pin state while the model has measurements; the time without a
 * measurement, s, after which the change fades, 0: never; which model may plan the next windows, and the reset, which
 * ends a trip; and limits of the drive, of which a predictor, that changes nothing, knows none: a slow drive's. */
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
static double axis_planned(axis_data *self) { return *axis_value(self, HSEP_VR_x_dm) - *axis_value(self, HSEP_VR_x_d); }
static unsigned axis_first_model(axis_data *self) { return *axis_value(self, HSEP_VR_compensate) > 1.0 ? 2 : 1; }
static int axis_state(axis_data *self) { return AXIS_DELAYS + (int)*axis_value(self, HSEP_VR_sep_state); }
static double axis_timeout(axis_data *self) { return *axis_value(self, HSEP_VR_measurement_timeout); }
static void axis_choose(axis_data *self, int plans)
{
    const hsep_sep_state model = self->pins->model == 1 ? HSEP_SEP_PHYSICS : HSEP_SEP_HYBRID;
    *axis_value(self, HSEP_VR_compensate) = plans ? (double)model : (double)HSEP_SEP_OFF;
    *axis_value(self, HSEP_VR_reset) = *self->pins->reset ? 1.0 : 0.0;
}
#define HSEP_LIMIT(self, name, slow) *axis_value(self, HSEP_VR_##name)
#else
static double axis_planned(axis_data *self) { return (void)self, 0.0; }
static unsigned axis_first_model(axis_data *self) { return (void)self, 1; }
static int axis_state(axis_data *self)
{
    return *axis_value(self, HSEP_VR_hybrid_active) > 0.0 ? AXIS_HYBRID : AXIS_PHYSICS;
}
static double axis_timeout(axis_data *self) { return (void)self, 0.0; }
static void axis_choose(axis_data *self, int plans) { (void)self, (void)plans; }
#define HSEP_LIMIT(self, name, slow) slow
#endif

/* Whether no measurement came for so long that the change fades. */
static int axis_lost(axis_data *self)
{
    const double timeout = axis_timeout(self);
    return timeout > 0.0 && (double)self->missing * *axis_value(self, HSEP_VR_T_s) >= timeout;
}

/* Whether the model may make plans. */
static int axis_plans(axis_data *self)
{
    return *self->pins->enable && !self->ending && self->fast == 0 && !axis_lost(self);
}

static double axis_within(double value, double limit) { return fmax(-limit, fmin(limit, value)); }

/* The model refuses a sample, or to begin: it is not used until reset, or until the axis becomes active again. */
static void axis_fail(axis_data *self)
{
    rtapi_print_msg(RTAPI_MSG_ERR, HSEP_COMPONENT ".%s: %s\n", self->instance.name, axis_message);
    self->runs = 0;
    self->faulty = 1;
}

/* Let the axis be where the command is, at rest since look-ahead periods. */
static void axis_rest(axis_data *self)
{
    for (size_t i = 0; i < self->n_ring; i++) {
        self->ring[i] = self->command;
    }
    self->out = self->command;
    self->still = self->n_ring;
}

/* Become active. LinuxCNC's command was the feedback until then: if it moved by no more than noise, it rested. */
static void axis_activate(axis_data *self)
{
    double low = self->command, high = low;
    for (size_t i = 0; i < self->n_ring; i++) {
        low = fmin(low, self->ring[i]);
        high = fmax(high, self->ring[i]);
    }
    if (high - low <= HSEP_NOISE * self->limit[1]) {
        const double out = self->out;
        axis_rest(self);
        self->out = out;
        self->change = out - self->command;
    }
}

/* Begin a run at rest at the last command, whole turns taken off; what the weights hold is kept. */
static void axis_begin(axis_data *self)
{
    hsep_instance *instance = &self->instance;
    const double turns = rint((self->command + self->origin) / HSEP_TURN);
    const double origin = instance->context.angular ? HSEP_TURN * turns : 0.0, by = origin - self->origin;
    self->origin = origin;
    self->command -= by;
    self->measured -= by;
    self->feedback[0] = self->feedback[1] = self->feedback[0] - by;
    axis_rest(self);
    self->k = 0;
    self->ending = 0;
    *axis_value(self, HSEP_VR_x_d_ahead) = *axis_value(self, HSEP_VR_x_meas) = self->command;
    axis_choose(self, axis_plans(self));
    memset(instance->state, 0, instance->state_size);
    axis_message[0] = '\0';
    self->runs = hsep_model_initialise(
                     &instance->context, instance->state, instance->state_size, instance->values, 0.0, axis_message) !=
                 HSEP_REFUSED;
    if (!self->runs) {
        axis_fail(self);
    }
}

/* Process the sample of this period. The paper's model misses no measurement: it is given what it predicts. */
static void axis_process(axis_data *self)
{
    const double T_s = *axis_value(self, HSEP_VR_T_s), t = (double)self->k++ * T_s;
    const int predicted = isnan(self->feedback[0]) && !(*axis_value(self, HSEP_VR_averaging) > 0.0);
    *axis_value(self, HSEP_VR_x_d_ahead) = self->command;
    *axis_value(self, HSEP_VR_x_meas) = predicted ? *axis_value(self, HSEP_VR_x_h) : self->feedback[0];
    axis_choose(self, axis_plans(self));
    axis_message[0] = '\0';
    if (hsep_model_step(&self->instance.context, self->instance.state, self->instance.values, t, T_s, axis_message) ==
        HSEP_REFUSED) {
        axis_fail(self);
    }
}

/* Change the command by so much in this period. */
static void axis_change(axis_data *self, double change)
{
    const double velocity = change - self->change;
    self->acceleration = velocity - self->velocity;
    self->velocity = velocity;
    self->change = change;
}

/* A change without a model, on its way to 0 by three first-order lags one within the other, which keep the limits. */
static void axis_fade(axis_data *self)
{
    const double *limit = self->limit, size = fabs(self->change), gone = HSEP_GONE * fmin(limit[1], limit[2]);
    const double rate =
        fmin(fmin(HSEP_FADE, limit[0] / size), fmin(sqrt(limit[1] / size), cbrt(limit[2] / size))); /* 1/0: inf */
    const double velocity = axis_within(self->velocity, limit[0]);
    const double acceleration = axis_within(self->acceleration, limit[1]);
    const double to_velocity = axis_within(-rate / 3.0 * self->change, limit[0]);
    const double to_acceleration = axis_within(rate * (to_velocity - velocity), limit[1]);
    const double jerk = axis_within(3.0 * rate * (to_acceleration - acceleration), limit[2]);
    axis_change(self, self->change + axis_within(velocity + (acceleration + jerk), limit[0]));
    if (size < gone && fabs(self->change) < gone) {
        self->change = self->velocity = self->acceleration = 0.0;
    }
}

/* Whether a pin is a position; axis_message says why not. */
static int axis_is_position(const axis_data *self, const char *pin, double value)
{
    axis_message[0] = '\0';
    return hsep_check_position(&self->instance.context, pin, value, "", 0.0, axis_message) == HSEP_OK;
}

/* Take in the pins cmd and fb; return the command of look-ahead periods ago. */
static double axis_take_in(axis_data *self)
{
    const axis_pins *pins = self->pins;
    double command = *pins->cmd / self->scale - self->origin, feedback = *pins->fb / self->scale - self->origin;
    self->held = !axis_is_position(self, "cmd", command);
    if (self->held) {
        if (!self->said) {
            rtapi_print_msg(
                RTAPI_MSG_ERR, HSEP_COMPONENT ".%s: %s; the last one is held\n", self->instance.name, axis_message);
        }
        self->said = 1;
        command = self->command;
    }
    const double step = command - self->command, jump = step - self->step;
    /* Another origin: both step alike (fb maybe a period earlier, as LinuxCNC answers to it), the drive does not. */
    const double alike = HSEP_ALIKE * fabs(jump);
    if (fabs(jump) > HSEP_ORIGIN * self->limit[0] && fabs(feedback - self->feedback[1] - jump) <= alike &&
        self->moved <= alike) {
        self->origin += jump;
        command -= jump;
        feedback -= jump;
        self->feedback[0] = feedback;
    }
    self->step = command - self->command;
    self->command = command;
    const int is_fast = fabs(self->step) > HSEP_FAST * self->limit[0];
    self->fast = is_fast ? self->n_ring + 4 : self->fast - (self->fast > 0);
    self->still = self->step != 0.0 ? 0 : self->still + (self->still < self->n_ring);
    const int is_missing = !axis_is_position(self, "fb", feedback);
    self->missing = is_missing ? self->missing + 1 : 0;
    self->measured = is_missing ? self->measured : feedback;
    self->feedback[1] = self->feedback[0];
    self->feedback[0] = is_missing ? NAN : feedback;
    const double delayed = self->ring[self->at];
    self->ring[self->at] = command;
    self->at = (self->at + 1) % self->n_ring;
    return delayed;
}

/* Write the pins of this sample. */
static void axis_write(axis_data *self, double delayed, int state)
{
    axis_pins *pins = self->pins;
    const double scale = self->scale, origin = self->origin, out = delayed + self->change;
    self->moved = fmax(HSEP_REMEMBERED * self->moved, fabs(out - self->out));
    self->out = out;
    *pins->out = scale * (out + origin);
    *pins->delayed = scale * (delayed + origin);
    *pins->predicted = scale * ((self->runs ? *axis_value(self, HSEP_VR_x_h) : out) + origin);
    *pins->error = self->runs ? scale * *axis_value(self, HSEP_VR_e_servo) : 0.0;
    *pins->std_dev = self->runs ? scale * *axis_value(self, HSEP_VR_x_h_std) : 0.0;
    /* The joint judges feedback against the command now: shifted by the look-ahead, what it sees is delayed - fb. */
    *pins->fb_joint = scale * (self->measured + origin + (*pins->active ? self->command - delayed : 0.0));
    *pins->state = state;
    pins->rejected = (hal_u32_t)*axis_value(self, HSEP_VR_n_rejected);
}

/* Take the first command: the axis rests there. Return whether there is one. */
static int axis_meet(axis_data *self)
{
    const double command = *self->pins->cmd / self->scale, feedback = *self->pins->fb / self->scale;
    const double out = *self->pins->out / self->scale;
    const int is_first = self->still == 0;
    self->begun = axis_is_position(self, "cmd", command);
    self->command = self->begun ? command : 0.0;
    self->missing = !axis_is_position(self, "fb", feedback);
    self->measured = self->missing ? self->command : feedback;
    self->feedback[0] = self->feedback[1] = self->measured;
    axis_rest(self);
    self->out = is_first ? self->command : out;
    return self->begun;
}

/* Let out be the feedback of an axis that is not driven, and where it is missing the command: no old position. */
static void axis_wait(axis_data *self, double delayed)
{
    axis_change(self, (self->missing > 0 ? self->command : self->measured) - delayed);
    axis_write(self, delayed, self->missing > 0 ? AXIS_NO_MEASUREMENT : AXIS_INACTIVE);
}

/* The function of one axis, in a thread. */
static void axis_step(void *data, long period)
{
    axis_data *self = data;
    const axis_pins *pins = self->pins;
    const double T_s = *axis_value(self, HSEP_VR_T_s);
    const int is_wrong = !(fabs(1e-9 * (double)period - T_s) <= HSEP_OTHER_T_S * T_s);
    const int resets = *pins->reset && !self->was_reset;
    self->was_reset = *pins->reset;
    if (!(*pins->active && self->begun) && isfinite(pins->scale) && pins->scale != 0.0) {
        self->scale = pins->scale; /* in motion, another one would be a step */
    }
    if (!self->begun && !axis_meet(self)) {
        axis_wait(self, self->command);
        return;
    }
    if (!*pins->active) {
        self->runs = self->ending = self->faulty = self->said = self->was_active = 0;
        axis_wait(self, axis_take_in(self));
        return;
    }
    const int was_inactive = !self->was_active;
    self->was_active = 1;
    if (was_inactive) {
        axis_activate(self);
    }
    if (resets) {
        self->faulty = self->said = 0;
    }
    const int is_tripped = self->runs && axis_state(self) == AXIS_TRIPPED;
    self->ending |= (resets && !is_tripped) || is_wrong;
    if ((!self->runs || self->ending) && !self->faulty && !is_wrong && self->still >= self->n_ring &&
        self->change == 0.0) {
        axis_begin(self);
    }
    const double delayed = axis_take_in(self);
    if (self->runs) {
        axis_change(self, axis_planned(self));
    } else if (was_inactive) {
        axis_change(self, self->out - delayed); /* out stays, and fades from there */
        self->acceleration = 0.0;
    } else {
        axis_fade(self);
    }
    const int is_lost = axis_lost(self) && !is_tripped;
    const int works = self->runs ? is_lost ? AXIS_NO_MEASUREMENT : axis_state(self) : AXIS_DELAYS;
    axis_write(self, delayed, is_wrong ? AXIS_WRONG_PERIOD : self->faulty || self->held ? AXIS_FAULT : works);
    if (self->runs) {
        axis_process(self);
    }
}

/* Whether an axis may be opened: its folder is one that hybridsep hal has written, and its name is no other one's. */
static int axis_allowed(const axis_data *self, const char *folder, const char *name)
{
    char path[HSEP_PATH_SIZE];
    FILE *table = NULL;
    if (rtapi_snprintf(path, sizeof path, "%s/variables.bin", folder) < (int)sizeof path) {
        table = fopen(path, "rb");
    }
    if (table == NULL) {
        rtapi_print_msg(
            RTAPI_MSG_ERR,
            HSEP_COMPONENT ": axes: there is no %s/variables.bin; an axis is a folder that hybridsep hal "
                           "has written\n",
            folder);
        return 0;
    }
    fclose(table);
    for (const axis_data *other = axis_all; other < self; other++) {
        if (strcmp(other->instance.name, name) == 0) {
            rtapi_print_msg(
                RTAPI_MSG_ERR, HSEP_COMPONENT ": axes: each axis must have a name of its own, got %s twice\n", name);
            return 0;
        }
    }
    return 1;
}

/* Take the model of an axis from its folder, and try it once: everything that can be refused is refused here. */
static int axis_open(axis_data *self, const char *folder)
{
    hsep_instance *instance = &self->instance;
    const char *slash = strrchr(folder, '/');
    const char *name = slash == NULL ? folder : slash + 1;
    instance->names = &axis_words;
    instance->allocate = calloc;
    instance->release = free;
    axis_message[0] = '\0';
    if (name[0] == '\0') {
        rtapi_print_msg(
            RTAPI_MSG_ERR, HSEP_COMPONENT ": axes must be folders without a slash at the end, got %s\n", folder);
        return 0;
    }
    if (!axis_allowed(self, folder, name)) {
        return 0;
    }
    if (hsep_open(instance, name, folder, axis_message) == HSEP_REFUSED) {
        rtapi_print_msg(
            RTAPI_MSG_ERR,
            HSEP_COMPONENT ": %s: %s; write it for this component: hybridsep hal MACHINE" HSEP_WRITTEN_BY "\n", folder,
            axis_message);
        return 0;
    }
    hsep_instance_reset(instance);
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    /* Plans end with the preview: a change has to be over where a command is too fast, which is seen that far ahead */
    *axis_value(self, HSEP_VR_horizon) = 0.0;
#endif
    axis_message[0] = '\0'; /* of opening */
    if (hsep_instance_initialise(instance, "loadrt " HSEP_COMPONENT, axis_message) == HSEP_REFUSED) {
        rtapi_print_msg(RTAPI_MSG_ERR, HSEP_COMPONENT ".%s: %s\n", name, axis_message);
        return 0;
    }
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    self->n_ring = (size_t)*axis_value(self, HSEP_VR_preview);
#else
    self->n_ring = (size_t)*axis_value(self, HSEP_VR_Np);
#endif
    self->ring = calloc(self->n_ring, sizeof *self->ring);
    if (self->ring == NULL) {
        rtapi_print_msg(RTAPI_MSG_ERR, HSEP_COMPONENT ".%s: no memory for its commands\n", name);
        return 0;
    }
    const double T_s = *axis_value(self, HSEP_VR_T_s);
    self->limit[0] = HSEP_LIMIT(self, v_max, 0.1) * T_s;
    self->limit[1] = HSEP_LIMIT(self, a_max, 1.0) * T_s * T_s;
    self->limit[2] = HSEP_LIMIT(self, j_max, 1e3) * T_s * T_s * T_s;
    return 1;
}

/* Export pins, parameters and the function of an axis. */
static int axis_export(axis_data *self)
{
    axis_pins *pins = self->pins = hal_malloc(sizeof *pins);
    const char *name = self->instance.name;
    const int id = axis_component;
    if (pins == NULL) {
        return -1;
    }
    int bad = hal_pin_float_newf(HAL_IN, &pins->cmd, id, HSEP_COMPONENT ".%s.cmd", name);
    bad |= hal_pin_float_newf(HAL_IN, &pins->fb, id, HSEP_COMPONENT ".%s.fb", name);
    bad |= hal_pin_bit_newf(HAL_IN, &pins->active, id, HSEP_COMPONENT ".%s.active", name);
    bad |= hal_pin_bit_newf(HAL_IN, &pins->enable, id, HSEP_COMPONENT ".%s.enable", name);
    bad |= hal_pin_bit_newf(HAL_IN, &pins->reset, id, HSEP_COMPONENT ".%s.reset", name);
    bad |= hal_pin_float_newf(HAL_OUT, &pins->out, id, HSEP_COMPONENT ".%s.out", name);
    bad |= hal_pin_float_newf(HAL_OUT, &pins->delayed, id, HSEP_COMPONENT ".%s.delayed", name);
    bad |= hal_pin_float_newf(HAL_OUT, &pins->fb_joint, id, HSEP_COMPONENT ".%s.fb-joint", name);
    bad |= hal_pin_float_newf(HAL_OUT, &pins->predicted, id, HSEP_COMPONENT ".%s.predicted", name);
    bad |= hal_pin_float_newf(HAL_OUT, &pins->error, id, HSEP_COMPONENT ".%s.error", name);
    bad |= hal_pin_float_newf(HAL_OUT, &pins->std_dev, id, HSEP_COMPONENT ".%s.std", name);
    bad |= hal_pin_s32_newf(HAL_OUT, &pins->state, id, HSEP_COMPONENT ".%s.state", name);
    bad |= hal_param_float_newf(HAL_RW, &pins->scale, id, HSEP_COMPONENT ".%s.scale", name);
    bad |= hal_param_u32_newf(HAL_RW, &pins->model, id, HSEP_COMPONENT ".%s.model", name);
    bad |= hal_param_u32_newf(HAL_RO, &pins->look_ahead, id, HSEP_COMPONENT ".%s.look-ahead", name);
    bad |= hal_param_u32_newf(HAL_RO, &pins->rejected, id, HSEP_COMPONENT ".%s.rejected", name);
    char function[HAL_NAME_LEN + 1]; /* hal_export_functf came with LinuxCNC 2.9 */
    bad |= rtapi_snprintf(function, sizeof function, HSEP_COMPONENT ".%s", name) >= (int)sizeof function;
    bad |= hal_export_funct(function, axis_step, self, 1, 0, id);
    if (bad == 0) {
        pins->scale = self->instance.context.angular ? 360.0 / HSEP_TURN : 1000.0; /* degrees, mm */
        pins->model = axis_first_model(self);
        pins->look_ahead = (hal_u32_t)self->n_ring;
        pins->rejected = 0;
        *pins->enable = 0;
    }
    return bad;
}

static void axis_free(void)
{
    for (size_t i = 0; i < HSEP_AXES; i++) {
        axis_data *self = &axis_all[i];
        hsep_instance *instance = &self->instance;
        if (instance->allocate != NULL) {
            hsep_instance_drop_state(instance);
            hsep_delete(instance, instance->values);
            hsep_delete(instance, instance->table);
            hsep_delete(instance, instance->weights);
            hsep_delete(instance, instance->resources);
            hsep_delete(instance, instance->name);
        }
        free(self->ring);
        *self = (axis_data){0};
    }
}

int rtapi_app_main(void)
{
    axis_component = hal_init(HSEP_COMPONENT);
    if (axis_component < 0) {
        return axis_component;
    }
    for (size_t i = 0; i < HSEP_AXES && axes[i] != NULL && axes[i][0] != '\0'; i++) {
        if (!axis_open(&axis_all[i], axes[i]) || axis_export(&axis_all[i]) != 0) {
            axis_free();
            hal_exit(axis_component);
            return -1;
        }
    }
    if (axis_all[0].pins == NULL) {
        rtapi_print_msg(
            RTAPI_MSG_ERR, HSEP_COMPONENT ": axes= must name at least one folder written by hybridsep hal\n");
        hal_exit(axis_component);
        return -1;
    }
    hal_ready(axis_component);
    return 0;
}

void rtapi_app_exit(void)
{
    hal_exit(axis_component);
    axis_free();
}
