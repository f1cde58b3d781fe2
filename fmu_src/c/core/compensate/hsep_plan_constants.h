/* Constants of plans, generated: what each means, and why, is in its file. */
#ifndef HSEP_PLAN_CONSTANTS_H
#define HSEP_PLAN_CONSTANTS_H

/* clang-format off */
/* hybridsep/compensate/splines.py */
#define HSEP_N_DECIDED 3
#define HSEP_SPLINES_END 3
#define HSEP_SPLINES_LEAST 0.1
#define HSEP_SPLINES_RIDGE 1e-12

/* hybridsep/compensate/qp.py */
#define HSEP_QP_FIRST_SLACK 0.3
#define HSEP_QP_REGULARISATION 1e-14
#define HSEP_QP_TAU 0.995
#define HSEP_QP_STEPS 24
#define HSEP_QP_EXACT 1e-15, 1e-09, 1e-11, 24, 10.0

/* hybridsep/compensate/limits.py */
#define HSEP_LIMITS_ROUNDING 1e-09
#define HSEP_LIMITS_INTERIOR 1e-10
#define HSEP_LIMITS_EXCEEDED 1.000001
#define HSEP_LIMITS_MOVES 1e-12

/* hybridsep/compensate/newton.py */
#define HSEP_NEWTON_VARIANCE_STRIDE 4
#define HSEP_NEWTON_TOLERANCE 0.0001, 0.01, 1e-05, 5, 100.0
#define HSEP_NEWTON_FIRST_REACH 0.1
#define HSEP_NEWTON_LEAST_REACH 0.03
#define HSEP_NEWTON_REACH 0.5
#define HSEP_NEWTON_WIDER 2.0
#define HSEP_NEWTON_MOST_REACH 1.0
#define HSEP_NEWTON_TWICE 15
#define HSEP_NEWTON_THRICE 5
#define HSEP_NEWTON_PHYSICS_STEPS 3
#define HSEP_NEWTON_LENGTHS 1.0, 0.3
#define HSEP_NEWTON_LEAST_GAIN 1e-09

/* hybridsep/compensate/planning.py */
#define HSEP_PLANNING_ENDS 5.0
#define HSEP_PLANNING_NEW 1000000000.0
#define HSEP_PLANNING_PINNED_PAPER 8
#define HSEP_PLANNING_FASTER 1.25
#define HSEP_PLANNING_UNPROVEN 0.5
#define HSEP_PLANNING_TAKEN_BACK 0.2
#define HSEP_PLANNING_LEAST_SHARE 0.7
#define HSEP_PLANNING_NEAR 4
#define HSEP_PLANNING_DOUBT 0.1
#define HSEP_PLANNING_STRAIGHT 10
#define HSEP_PLANNING_PINNED_AVERAGED 24

/* hybridsep/compensate/stop.py */
#define HSEP_STOP_TRIES 12
#define HSEP_STOP_STILL 1e-12
#define HSEP_STOP_MOST 10.0
/* clang-format on */

#endif
