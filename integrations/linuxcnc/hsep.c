/* HAL component for LinuxCNC: servo error pre-compensation, or prediction alone, of one axis each in a servo thread.
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
 * Real time: axis_step allocates nothing, locks nothing and opens no file; it costs as much as hsep_compensator_sample
 * (hsep.h). A begin (active rises, or the command jumps) costs some 100 us more: the state is filled anew.
 *
 * Never larger than the joint's limits: the plan's limits come from the axis' machine file, a plan that cannot keep
 * them is not used, and where the model fails (fault) the change of the command fades within HSEP_FADE periods.
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
#define HSEP_FADE 500       /* periods within which the change of a command fades after a fault */
#define HSEP_JUMP 1.5       /* a command that moves by more than so many times the largest step is another position */
#define HSEP_OTHER_T_S 0.01 /* deviation of the period, relative to the sampling interval, that is another one */

static char *axes[HSEP_AXES];
RTAPI_MP_ARRAY_STRING(axes, HSEP_AXES, "folders of the axes, written by hybridsep hal");

/* Values of the pin state. */
enum { AXIS_WRONG_PERIOD = -2, AXIS_FAULT = -1, AXIS_INACTIVE = 0, AXIS_DELAYS = 1, AXIS_PHYSICS = 2, AXIS_HYBRID = 3 };

/* Pins and parameters, in HAL's memory. Positions are in machine units. */
typedef struct {
    hal_float_t *cmd, *fb;                                               /* in */
    hal_bit_t *active, *enable, *reset;                                  /* in */
    hal_float_t *out, *delayed, *fb_joint, *predicted, *error, *std_dev; /* out */
    hal_s32_t *state;                                                    /* out */
    hal_float_t scale;                                                   /* parameter: machine units in a metre */
    hal_u32_t model;                                                     /* parameter: 1 physics, 2 hybrid */
    hal_u32_t look_ahead;                                                /* parameter: periods */
    hal_u32_t rejected;                                                  /* parameter: measurements not believed */
} axis_pins;

typedef struct {
    axis_pins *pins;
    hsep_instance instance; /* the model and its memory */
    void *weights;          /* what weights.bin holds; NULL: none */
    double *ring;           /* (n_ring,) m, the last commands, for the time after a fault */
    size_t n_ring, at;
    double last;     /* m, last command */
    double change;   /* m, last change of the command that the model made */
    unsigned fading; /* periods left of the fade after a fault */
    uint64_t k;      /* sample of this run */
    int runs, faulty;
    int was_reset;
} axis_data;

static const hsep_words axis_words = {
    .instantiate = "loadrt " HSEP_COMPONENT, .location = "axes", .location_form = "a folder written by hybridsep hal"};

static axis_data axis_all[HSEP_AXES];
static int axis_component = -1;
static char axis_message[HSEP_MESSAGE_SIZE];

static double *axis_value(axis_data *self, size_t place) { return &self->instance.values[place]; }

/* The command of the drive in this sample, m: modified, and as it came. */
static double axis_out(axis_data *self)
{
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    return *axis_value(self, HSEP_VR_x_dm);
#else
    return *axis_value(self, HSEP_VR_x_d);
#endif
}

/* Largest step of a command, m. */
static double axis_largest_step(axis_data *self)
{
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    return *axis_value(self, HSEP_VR_v_max) * *axis_value(self, HSEP_VR_T_s);
#else
    (void)self;
    return HUGE_VAL;
#endif
}

/* Say which model may plan the next windows. */
static void axis_choose(axis_data *self)
{
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    const hsep_sep_state model = self->pins->model == 1 ? HSEP_SEP_PHYSICS : HSEP_SEP_HYBRID;
    *axis_value(self, HSEP_VR_compensate) = *self->pins->enable ? (double)model : (double)HSEP_SEP_OFF;
#else
    (void)self;
#endif
}

/* The model that may plan until the parameter is set: the machine file's. */
static hal_u32_t axis_first_model(axis_data *self)
{
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    return *axis_value(self, HSEP_VR_compensate) >= (double)HSEP_SEP_HYBRID ? 2 : 1;
#else
    (void)self;
    return 1;
#endif
}

/* Begin another run at rest at a command, m; what the weights hold is kept. */
static int axis_begin(axis_data *self, double command)
{
    hsep_instance *instance = &self->instance;
    *axis_value(self, HSEP_VR_x_d_ahead) = *axis_value(self, HSEP_VR_x_meas) = command;
    axis_choose(self);
    memset(instance->state, 0, instance->state_size);
    axis_message[0] = '\0';
    if (hsep_model_initialise(
            &instance->context, instance->state, instance->state_size, instance->values, 0.0, axis_message) ==
        HSEP_REFUSED) {
        rtapi_print_msg(RTAPI_MSG_ERR, HSEP_COMPONENT ".%s: %s\n", instance->name, axis_message);
        return 0;
    }
    for (size_t i = 0; i < self->n_ring; i++) {
        self->ring[i] = command;
    }
    self->k = 0;
    self->change = 0.0;
    self->fading = 0;
    self->faulty = 0;
    return 1;
}

/* Process the sample (command, feedback), m; a model that fails is not used again in this run. */
static void axis_process(axis_data *self, double command, double feedback)
{
    const double T_s = *axis_value(self, HSEP_VR_T_s);
    *axis_value(self, HSEP_VR_x_d_ahead) = command;
    *axis_value(self, HSEP_VR_x_meas) = feedback;
    axis_choose(self);
    axis_message[0] = '\0';
    const double t = (double)self->k * T_s;
    if (hsep_model_step(&self->instance.context, self->instance.state, self->instance.values, t, T_s, axis_message) ==
        HSEP_REFUSED) {
        rtapi_print_msg(RTAPI_MSG_ERR, HSEP_COMPONENT ".%s: %s\n", self->instance.name, axis_message);
        self->faulty = 1;
        self->fading = HSEP_FADE;
    }
    self->k++;
}

/* Write the pins of this sample. */
static void axis_write(axis_data *self, double command, double feedback)
{
    axis_pins *pins = self->pins;
    const double scale = pins->scale, delayed = self->ring[self->at];
    double out = delayed;
    if (self->faulty) {
        /* A cosine from 1 to 0, whose velocity ends at 0 on both sides */
        const double share = 0.5 - 0.5 * cos(3.14159265358979323846 * (double)self->fading / HSEP_FADE);
        out = delayed + share * self->change;
        self->fading -= self->fading > 0;
        *pins->state = AXIS_FAULT;
    } else {
        out = axis_out(self);
        self->change = out - delayed;
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
        *pins->state = AXIS_DELAYS + (hal_s32_t)*axis_value(self, HSEP_VR_sep_state);
#else
        *pins->state = *axis_value(self, HSEP_VR_hybrid_active) > 0.0 ? AXIS_HYBRID : AXIS_PHYSICS;
#endif
    }
    *pins->out = scale * out;
    *pins->delayed = scale * delayed;
    *pins->predicted = scale * *axis_value(self, HSEP_VR_x_h);
    *pins->error = scale * *axis_value(self, HSEP_VR_e_servo);
    *pins->std_dev = scale * *axis_value(self, HSEP_VR_x_h_std);
    /* The joint judges feedback against the command now: shifted by the look-ahead, what it sees is delayed - fb. */
    *pins->fb_joint = scale * (feedback + command - delayed);
    pins->rejected = (hal_u32_t)*axis_value(self, HSEP_VR_n_rejected);
}

/* What stands on the pins while nothing is predicted: the command as it came, or, while the axis is switched off, the
 * position where it is: LinuxCNC's command goes there, too, one period later. */
static void axis_pass(axis_data *self, int state)
{
    axis_pins *pins = self->pins;
    *pins->out = *pins->delayed = *pins->predicted = state == AXIS_INACTIVE ? *pins->fb : *pins->cmd;
    *pins->fb_joint = *pins->fb;
    *pins->error = *pins->std_dev = 0.0;
    *pins->state = state;
    self->runs = 0;
}

/* The function of one axis, in a thread. */
static void axis_step(void *data, long period)
{
    axis_data *self = data;
    axis_pins *pins = self->pins;
    const double command = *pins->cmd / pins->scale, feedback = *pins->fb / pins->scale;
    const double T_s = *axis_value(self, HSEP_VR_T_s);
    if (!(fabs(1e-9 * (double)period - T_s) <= HSEP_OTHER_T_S * T_s)) {
        axis_pass(self, AXIS_WRONG_PERIOD);
        return;
    }
    if (!*pins->active || !isfinite(command)) {
        axis_pass(self, AXIS_INACTIVE);
        return;
    }
    const int reset = *pins->reset && !self->was_reset;
    self->was_reset = *pins->reset;
    if (!self->runs || reset || fabs(command - self->last) > HSEP_JUMP * axis_largest_step(self)) {
        self->runs = axis_begin(self, command);
        if (!self->runs) {
            axis_pass(self, AXIS_FAULT);
            return;
        }
    }
    axis_write(self, command, feedback);
    self->ring[self->at] = self->last = command;
    self->at = (self->at + 1) % self->n_ring;
    if (!self->faulty) {
        axis_process(self, command, feedback);
    }
}

/* Read a whole file of the axis' folder into memory; NULL: there is none, or no memory. */
static void *axis_read(const hsep_instance *instance, const char *name, size_t *size)
{
    FILE *file = hsep_resource_open(&instance->context, name);
    if (file == NULL) {
        return NULL;
    }
    void *bytes = NULL;
    if (fseek(file, 0, SEEK_END) == 0) {
        const long end = ftell(file);
        if (end > 0 && fseek(file, 0, SEEK_SET) == 0) {
            bytes = malloc((size_t)end);
            if (bytes != NULL && fread(bytes, 1, (size_t)end, file) != (size_t)end) {
                free(bytes);
                bytes = NULL;
            }
            *size = (size_t)end;
        }
    }
    fclose(file);
    return bytes;
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
    instance->words = &axis_words;
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
    size_t size = 0;
    self->weights = axis_read(instance, "weights.bin", &size);
    instance->context.weights = self->weights;
    instance->context.weights_size = size;
    hsep_instance_reset(instance);
    if (hsep_instance_initialise(instance, "loadrt " HSEP_COMPONENT, axis_message) != HSEP_OK) {
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
        pins->scale = 1000.0; /* mm */
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
            hsep_delete(instance, instance->resources);
            hsep_delete(instance, instance->name);
        }
        free(self->weights);
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
