/* Constants of predictions and their errors, generated: what each means, and why, is in its file. */
#ifndef HSEP_PREDICT_CONSTANTS_H
#define HSEP_PREDICT_CONSTANTS_H

/* clang-format off */
/* hybridsep/predict/uncertainty.py */
#define HSEP_UNCERTAINTY_SHARES 4.0, 2.0
#define HSEP_UNCERTAINTY_N_COMPONENTS 3
#define HSEP_UNCERTAINTY_UNKNOWN_NOISE 25.0
#define HSEP_UNCERTAINTY_FELT_FOR 0.2
#define HSEP_UNCERTAINTY_FLOOR 1e-06
#define HSEP_UNCERTAINTY_LEAST_VARIANCE HSEP_TINY(1e-100)
#define HSEP_UNCERTAINTY_OUTLYING 16.0
#define HSEP_UNCERTAINTY_VANISHING 0.01
#define HSEP_UNCERTAINTY_RECENT 0.9
#define HSEP_UNCERTAINTY_MEMORY 0.97
#define HSEP_UNCERTAINTY_FIRST_EVIDENCE 0.2
#define HSEP_UNCERTAINTY_STEP 6.0
#define HSEP_UNCERTAINTY_LEVELS {0.6745, 0.5}, {1.645, 0.1}, {1.96, 0.05}
#define HSEP_UNCERTAINTY_FACTOR_RATE 0.03
#define HSEP_UNCERTAINTY_FACTOR_MAX 4.0
#define HSEP_UNCERTAINTY_RATIO 1.2
#define HSEP_UNCERTAINTY_RATIO_RATE 0.8
#define HSEP_UNCERTAINTY_RATIO_MAX 16.0

/* hybridsep/predict/trust/start.py */
#define HSEP_START_MOVING 0.05
#define HSEP_START_SAMPLES 4
#define HSEP_START_DAMPING 0.001

/* hybridsep/predict/trust/stack.py */
#define HSEP_HOLD 0
#define HSEP_LAGGED 1
#define HSEP_STATIC 2
#define HSEP_COMMAND 3
#define HSEP_DOUBTING 4
#define HSEP_N_EXPERTS 5
#define HSEP_STACK_LEAST_SQUARE HSEP_TINY(1e-300)

/* hybridsep/predict/trust/expert.py */
#define HSEP_EXPERT_DIVERGED 1000000.0
#define HSEP_EXPERT_LAG_BOUND 10.0
#define HSEP_EXPERT_RESOLUTION 1e-13

/* hybridsep/predict/trust/disturbances.py */
#define HSEP_DISTURBANCES_N_FRICTION 6
#define HSEP_DISTURBANCES_N_LASTING 8
#define HSEP_DISTURBANCES_N_PERIODIC 2
#define HSEP_DISTURBANCES_LEAST_VELOCITY HSEP_TINY(1e-200)
#define HSEP_DISTURBANCES_DIFFERENCES 3

/* hybridsep/predict/trust/state.py, hybridsep/predict/trust/forecast.py, hybridsep/predict/trust/learn.py */
#define HSEP_OF_PHYSICS 0
#define HSEP_OF_COMMAND 1
#define HSEP_TRUSTED_ROUNDING 1e-06
#define HSEP_TRUSTED_LEAST HSEP_TINY(1e-150)
#define HSEP_TRUSTED_BRIDGED 3

/* hybridsep/predict/trust/constants.py */
#define HSEP_TRUST_KAPPA 1.0
#define HSEP_TRUST_GAMMA 0.95
#define HSEP_TRUST_FIRST_LAGGED 0.5
#define HSEP_TRUST_FIRST_STATIC 0.5
#define HSEP_TRUST_LAGS_OF_COMMAND 36
#define HSEP_TRUST_LAST_LAG 0.005
#define HSEP_TRUST_LEAST_NOISE 1e-06
#define HSEP_TRUST_FIRST_NOISE 0.01
#define HSEP_TRUST_CORRELATION_MAX 100.0
#define HSEP_TRUST_CORRELATION_RATE 0.1
#define HSEP_TRUST_BOUND 1.2
#define HSEP_TRUST_BOUND_OF_COMMAND 2.0
#define HSEP_TRUST_GROWTH 30.0
#define HSEP_TRUST_OUTGROWN 1000.0
#define HSEP_TRUST_CARRIED 30.0
#define HSEP_TRUST_LESS 0.003
#define HSEP_TRUST_DOUBT 0.7
#define HSEP_TRUST_FRICTION_LEAST 0.01
#define HSEP_TRUST_FRICTION_RATIO 3.1622776601683795
#define HSEP_TRUST_DIFFERENCE_SHARE 0.03
#define HSEP_TRUST_REACH_RESIDUALS 2.0
#define HSEP_TRUST_REACH_STEPS 2.0
#define HSEP_TRUST_PATIENCE 1.0

/* Least, most and count of the numbers that are learned, in their order. */
#define HSEP_LEARNED_RANGES \
    {0.0, HSEP_HUGE(1e+100), 8}, {1.0, HSEP_HUGE(1e+100), 1}, {0.0, HSEP_HUGE(1e+100), 1}, {1.0, HSEP_HUGE(1e+100), \
    1}, {0.0, HSEP_HUGE(1e+100), 1}, {1.0, HSEP_HUGE(1e+100), 1}, {0.0, HSEP_HUGE(1e+100), 1}, {1.0, \
    HSEP_HUGE(1e+100), 1}, {0.0, 1.0, 5}, {-HSEP_HUGE(1e+100), HSEP_HUGE(1e+100), 30}, {0.0, HSEP_HUGE(1e+100), 27}
#define HSEP_UNCERTAINTY_RANGES \
    {0.0, HSEP_HUGE(1e+100), 1}, {4e-09, 40000.0, 1}, {2e-09, 20000.0, 1}, {0.0, HSEP_HUGE(1e+100), 3}, {0.25, 4.0, \
    1}, {0.0625, 16.0, 1}, {0.0, HSEP_HUGE(1e+100), 1}
/* clang-format on */

#endif
