/* What is proved of the core by abstract interpretation (Frama-C, Eva): for all values of the inputs within their
 * ranges no read or write outside of an array, no division of integers by zero, no overflow of signed integers and none
 * of a conversion. One main function for each part; sizes are small and concrete, as bounds of loops and offsets are
 * then exact.
 *
 * With WRONG one size is too small, or one index beyond: each of these must be found, or the proof says nothing.
 */
#include "hsep.h"

#include "hsep_paper.h"
#include "hsep_parameters.h"
#include "hsep_planner.h"
#include "hsep_stacking.h"

#include <limits.h>
#include <math.h>

#include "__fc_builtin.h"

#ifdef WRONG
#define SHORT 1
#else
#define SHORT 0
#endif

#define MOST 1000.0 /* m, the largest position that is allowed */

/* What Eva does not know of the C library. */
double fmax(double a, double b) { return a > b || b != b ? a : b; }

double fmin(double a, double b) { return a < b || b != b ? a : b; }

double frexp(double x, int *exponent)
{
    *exponent = Frama_C_interval(-1073, 1024);
    return x == 0.0 ? 0.0 : Frama_C_double_interval(-1.0, 1.0);
}

static double position(void) { return Frama_C_double_interval(-MOST, MOST); }

static void fill(double *a, int n)
{
    //@ loop unroll 64;
    for (int i = 0; i < n; i++) {
        a[i] = position();
    }
}

/* The recursion, eq. (4): N samples with P and Q lags. */
#define N 4
#define P 3
#define Q 2

void prove_recursion(void)
{
    double weights[1 + Q + 1 + P], x[N + Q - SHORT], e[N + P], work[2 * P];
    fill(weights, 1 + Q + 1 + P);
    fill(x, N + Q - SHORT);
    fill(e, N + P);
    const hsep_recursion recursion = {
        .w_x = weights + 1, .w_e = weights + 1 + Q + 1, .p = P, .q = Q, .bias = weights[0]};
    hsep_recursion_run(&recursion, x, e, N, 0, N);
    (void)hsep_has_stable_poles(&recursion, work);
}

/* The stack of experts, with any evidence. */
void prove_stack(void)
{
    double products[HSEP_N_EXPERTS + 1][HSEP_N_EXPERTS + 1];
    hsep_stack stack;
    hsep_stack_init(&stack);
    for (int i = 0; i <= HSEP_N_EXPERTS; i++) {
        for (int j = 0; j <= HSEP_N_EXPERTS; j++) {
            products[i][j] = Frama_C_double_interval(-1e12, 1e12);
        }
    }
    hsep_stack_update(&stack, products, Frama_C_double_interval(1.0, 1e4), 1e-18);
    const hsep_int leader = hsep_stack_leader(&stack);
    const hsep_int expert = (hsep_int)(Frama_C_interval(0, HSEP_N_EXPERTS - 1) + SHORT);
    hsep_stack_copy(&stack, leader, HSEP_FRESH_START); /* another one */
    hsep_stack_forget(&stack, expert);
}

/* The rings of commands and signals: some windows of a whole predictor, with the paper's model and with averaging. */
#define NP 3
#define SAMPLES (4 * NP + 1)

static double block[BLOCK / sizeof(double) - SHORT];

static const hsep_mode mode = {.f_n = 25.0, .zeta = 0.3, .alpha = 24674.0};

static void small_parameters(hsep_parameters *parameters)
{
    hsep_defaults(parameters);
    parameters->predictor.Np = NP;
    parameters->predictor.p = 2;
    parameters->predictor.q = 1;
    parameters->predictor.measurement_delay = AVERAGING ? 1 : 0;
    parameters->averaging.averaging = AVERAGING;
    parameters->n_modes = 1;
    parameters->modes = &mode;
}

void prove_rings(void)
{
    hsep_parameters parameters;
    hsep_predictor_outputs outputs;
    hsep_predictor *predictor = (hsep_predictor *)block;
    small_parameters(&parameters);
    if (hsep_predictor_size(&parameters) > BLOCK) {
        return;
    }
    (void)hsep_predictor_init(predictor, &parameters, position(), NULL, 0);
    for (int k = 0; k < SAMPLES; k++) {
        (void)hsep_predictor_sample(predictor, position(), position());
        hsep_predictor_read(predictor, &outputs);
    }
    (void)hsep_predictor_std(predictor, NP - 1);
}

/* The limits of a drive as constraints, for any plan before. */
#define SPACING 1
#define PREVIEW (NP + 4 * SPACING + 3)
#define PLAN 6000

static double plan[PLAN];

void prove_constraints(void)
{
    const hsep_planner_parameters parameters = {
        .Np = NP,
        .preview = PREVIEW,
        .spacing = SPACING,
        .jerk_weight = 1.0,
        .limit = {1e-3, 1e-4, 1e-5, 1e-5},
        .no_reversal = 1,
        .pinned = HSEP_PLANNING_PINNED_PAPER};
    static double x_d[PREVIEW - SHORT], from[HSEP_ORDERS * PREVIEW], way[HSEP_ORDERS * PREVIEW];
    double least, most;
    hsep_planner *planner = (hsep_planner *)plan;
    if (hsep_planner_size(&parameters) > sizeof plan) {
        return;
    }
    hsep_planner_init(planner, &parameters, position());
    for (int i = 0; i < 3; i++) {
        planner->x_d_before[i] = position();
        planner->delta_before[i] = Frama_C_double_interval(-1.0, 1.0);
    }
    fill(x_d, PREVIEW - SHORT);
    fill(from, HSEP_ORDERS * PREVIEW);
    fill(way, HSEP_ORDERS * PREVIEW);
    hsep_planner_total(planner, x_d);
    hsep_planner_range(planner, (uint64_t)Frama_C_interval(0, HSEP_ORDERS * PREVIEW - 1), &least, &most);
    (void)hsep_planner_share(planner, from, way);
    (void)hsep_planner_allow(planner, way);
}

/* Parameters of any bits, NaN among them, are judged. Eva cannot see that spacing is judged before it divides, so
 * 0 is a case of its own. */
void prove_refusals(void)
{
    hsep_parameters parameters;
    hsep_mode modes[2 - SHORT];
    Frama_C_make_unknown((char *)&parameters, sizeof parameters);
    Frama_C_make_unknown((char *)modes, sizeof modes);
    parameters.n_modes = 2;
    parameters.modes = modes;
    (void)hsep_predictor_refused(&parameters);
    if (parameters.compensator.spacing == 0) {
        parameters.compensator.spacing = 0;
        (void)hsep_compensator_refused(&parameters);
    } else {
        parameters.compensator.spacing = (uint64_t)Frama_C_unsigned_long_interval(1, ULONG_MAX);
        (void)hsep_compensator_refused(&parameters);
    }
}

/* The sizes of all blocks of allowed parameters: every offset fits into its integer. */
void prove_sizes(void)
{
    hsep_parameters parameters;
    hsep_mode modes[2 - SHORT];
#define ANY(of, type, name, usual, least, most, nonzero, automatic, learned) \
    parameters.of.name = (type)Frama_C_double_interval(least, most);
    HSEP_PREDICTOR_SETTINGS(ANY)
    HSEP_AVERAGING_SETTINGS(ANY)
    HSEP_COMPENSATOR_SETTINGS(ANY)
#undef ANY
    parameters.n_modes = 2;
    parameters.modes = modes;
    for (int i = 0; i < 2; i++) {
        modes[i].f_n = Frama_C_double_interval(1e-3, 1e5);
        modes[i].zeta = Frama_C_double_interval(1e-9, 1e3);
        modes[i].alpha = modes[i].beta = position();
    }
    (void)hsep_predictor_size(&parameters);
}
