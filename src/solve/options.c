/* Options of the room solve: see base/opt.h. Defaults of PETSc's own solver objects stand where these are made. */
#include "base/opt.h"

#define FLOW "-flow_active true"

static const OptSpec SPECS[] = {
  {"-flow_solver", OPT_CHOICE, "", OPT_ANY, "balanced", .old = "-flow_recipe",
   .help = "preset of the solver options; every one can be overridden (default of small steady scenes: direct)", .when = FLOW,
   .choices = "fast, balanced, accurate, direct", .also = "linear_solver, preconditioner", .words = "mumps direct, lu direct, iterative balanced"},
  {"-flow_schur", OPT_CHOICE, "", OPT_ANY, "auto, with recipe fast projection, around bodies two_stage",
   .help = "how the pressure is found (auto: two stages with bodies, else by the viscous number of the step)", .when = FLOW,
   .choices = "auto, projection, commutator, two_stage"},
  {"-flow_velocity_smoother", OPT_CHOICE, "", OPT_ANY, "auto", .old = "-flow_velocity_sweep",
   .help = "preconditioner of the velocity (auto: by the convective number of the step)", .when = FLOW, .choices = "jacobi, sor, ilu, auto"},
  {"-flow_rtol_start", OPT_REAL, "", 0, 1, "0, with recipe balanced 1e-2, fast around bodies 0.1",
   .help = "residual that a solve leaves as share of its start value's (0: only -flow_ksp_rtol counts)", .when = FLOW, .expert = PETSC_TRUE},
  {"-flow_rtol_max", OPT_REAL, "", 0, 1, "1e-5, with bodies that move 2e-5 (1e-6 with preset accurate), with recipe fast around bodies 1",
   .old = "-flow_rtol_most", .help = "bound for -flow_rtol_start, as share of the right-hand side", .when = FLOW, .expert = PETSC_TRUE},
  {"-flow_velocity_tol", OPT_REAL, "", 0, 1, "0, with recipe balanced and bodies that move 2e-3, but not on periodic meshes nor with outflows",
   .old = "-flow_error_most",
   .help =
     "estimated error of velocities that a solve may leave, as share of the largest; with bodies lighter than the fluid it counts ten times, at convective numbers above 2 four times, with ties twice (0: only residuals count, as where -flow_rtol_max is given, and where a mean velocity is held)",
   .when = FLOW},
  {"-flow_min_it", OPT_INT, "", 0, 100, "0, with recipe fast around bodies 2", .old = "-flow_iterations_least",
   .help = "outer iterations of a step, unless fewer do for recipe balanced", .when = FLOW, .expert = PETSC_TRUE},
  {"-flow_krylov_single", OPT_BOOL, "", 0, 0, "true",
   .help = "Krylov vectors in single precision where that costs no iteration; false: a tenth to a quarter more memory, and results in other units, "
           "or after other round-off, agree to 1e-9 rather than 1e-8",
   .when = FLOW},
  {"-flow_one_it_rtol", OPT_REAL, "", 0, 1,
   "0, with bodies that move, but not on periodic meshes nor with outflows: recipe fast 1e-2, balanced 2e-3, in 3D 3e-3", .old = "-flow_once_most",
   .help = "residual, as share of the right-hand side, with which one iteration ends a step, unless it has grown threefold since the step before, "
           "bodies are lighter than the fluid or touch, or the velocities' error is not small enough (0: never)",
   .when = FLOW},
  {"-flow_pressure_regularisation", OPT_REAL, "", OPT_POSITIVE, 1, "1e-6", .old = "-flow_pressure_softness",
   .help = "share of their inverse mass that body nodes keep in the pressure preconditioner", .when = FLOW, .expert = PETSC_TRUE},
  {"-flow_pressure_gap_compressibility", OPT_REAL, "", 0, 1, "1e-3", .old = "-flow_pressure_shared",
   .help = "compressibility of cells between two bodies, or body and wall, as share of their nodes' inverse mass", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-flow_pressure_coarse", OPT_CHOICE, "", OPT_ANY, "auto",
   .help = "operator on the vertices below the pressure's two levels (auto: laplacian in 3D and on nearly square cells, else galerkin)",
   .when = "-flow_fieldsplit_pressure_pc_type mg", .choices = "auto, galerkin, laplacian", .expert = PETSC_TRUE},
  {"-flow_pressure_reuse", OPT_REAL, "", 0, 1, "0.03", .old = "-flow_pressure_keep",
   .help = "share of the vertices that may change before the multigrid hierarchy of the pressure is built anew",
   .when = "-flow_fieldsplit_pressure_pc_type mg", .expert = PETSC_TRUE},
};
OPT_TABLE("solve: linear solvers", SPECS)
