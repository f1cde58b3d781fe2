/* Constants of plans, generated: what each means, and why, is in its file. */
#ifndef HSEP_PLAN_CONSTANTS_H
#define HSEP_PLAN_CONSTANTS_H

/* clang-format off */
/* hybridsep/compensate/splines.py */
#define HSEP_N_DECIDED 3
#define HSEP_SPLINES_END 3
#define HSEP_SPLINES_RIDGE 1e-12

/* hybridsep/compensate/constraints.py */
#define HSEP_CONSTRAINTS_ROUNDING 1e-09
#define HSEP_CONSTRAINTS_INTERIOR 1e-10
#define HSEP_CONSTRAINTS_MOVES 1e-12

/* hybridsep/compensate/interior.py */
#define HSEP_INTERIOR_FIRST_SLACK 0.3
#define HSEP_INTERIOR_FIRST_MU 10.0
#define HSEP_INTERIOR_SLACK_AGAIN 0.03
#define HSEP_INTERIOR_MU_AGAIN 0.1
#define HSEP_INTERIOR_REGULARISATION 1e-14
#define HSEP_INTERIOR_TAU 0.995
#define HSEP_INTERIOR_STEPS 24
#define HSEP_INTERIOR_EXACT 1e-15, 1e-09, 1e-11, 24

/* hybridsep/compensate/linearised.py */
#define HSEP_LINEARISED_APART 4

/* hybridsep/compensate/paper_planning.py */
#define HSEP_PAPER_PLANNING_PINNED 8

/* hybridsep/compensate/trusted_planning.py */
#define HSEP_TRUSTED_PLANNING_PINNED 24

/* hybridsep/compensate/trusted_plan.py */
#define HSEP_TRUSTED_PLAN_SOLVED 5, 5, 3, 3
#define HSEP_TRUSTED_PLAN_TOLERANCE 0.0001, 0.01, 1e-05, 5
#define HSEP_TRUSTED_PLAN_REACHES 0.1, 0.01, 0.0
#define HSEP_TRUSTED_PLAN_LENGTHS 1.0, 0.3
#define HSEP_TRUSTED_PLAN_GAIN 0.001
#define HSEP_TRUSTED_PLAN_LEAST_GAIN 1e-09
#define HSEP_TRUSTED_PLAN_AT_BOUND 0.97
#define HSEP_TRUSTED_PLAN_BOUND_SHARE 0.2
#define HSEP_TRUSTED_PLAN_LEFT 0.3
/* clang-format on */

#endif
