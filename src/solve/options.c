/* Options of the room solve: see base/opt.h. Defaults of PETSc's own solver objects stand where these are made. */
#include "base/opt.h"

#define FLOW "-flow_active true"

static const OptSpec SPECS[] = {
  {"-flow_solver", OPT_CHOICE, "", OPT_ANY, "balanced", .old = "-flow_recipe",
   .help = "set of solver options, each of which can be overridden (default of small steady scenes: direct)",
   .when = FLOW, .choices = "fast, balanced, accurate, direct", .also = "linear_solver, preconditioner",
   .words = "mumps direct, lu direct, iterative balanced"},
  {"-flow_schur", OPT_CHOICE, "", OPT_ANY, "auto; solver fast: projection, around bodies two_stage",
   .help =
     "Schur complement preconditioner (auto: two stages with bodies, else chosen by the viscous number of the step)",
   .when = FLOW, .choices = "auto, projection, commutator, two_stage"},
  {"-flow_velocity_smoother", OPT_CHOICE, "", OPT_ANY, "auto", .old = "-flow_velocity_sweep",
   .help = "smoother of the velocity block (auto: chosen by the convective number of the step)", .when = FLOW,
   .choices = "jacobi, sor, ilu, auto"},
  {"-flow_print_choice", OPT_BOOL, "", 0, 0, "false",
   .help = "print what the solver takes for a step (pressure, smoother of the velocity), when it changes", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-flow_rtol_start", OPT_REAL, "", 0, 1, "0; solver balanced: 1e-2, fast around bodies: 0.1",
   .help = "residual at which a solve stops, relative to that of the initial guess (0: only -flow_ksp_rtol)",
   .when = FLOW, .expert = PETSC_TRUE},
  {"-flow_rtol_max", OPT_REAL, "", 0, 1,
   "1e-5; moving bodies: 2e-5 (preset accurate: 1e-6); solver fast around bodies: 1", .old = "-flow_rtol_most",
   .help = "upper bound of the residual relative to the right-hand side, for -flow_rtol_start", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-flow_velocity_tol", OPT_REAL, "", 0, 1,
   "0; solver balanced with moving bodies: 2e-3, except on periodic meshes and with outflows",
   .old = "-flow_error_most",
   .help =
     "estimated error of the velocity at which a solve stops, relative to the largest velocity; ten times stricter for bodies lighter than the fluid, four times at convective numbers above 2, twice with contact in the system (0: residuals alone, as with -flow_rtol_max or -flow_rate)",
   .when = FLOW},
  {"-flow_min_it", OPT_INT, "", 0, 100, "0; solver fast around bodies: 2", .old = "-flow_iterations_least",
   .help = "smallest number of outer iterations of a step; solver balanced may stop earlier", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-flow_krylov_single", OPT_BOOL, "", 0, 0, "true",
   .help =
     "Krylov vectors in single precision where that costs no iteration; false: a tenth to a quarter more memory, and results in other units, "
     "or after other round-off, agree to 1e-9 rather than 1e-8",
   .when = FLOW},
  {"-flow_one_it_rtol", OPT_REAL, "", 0, 1,
   "0; moving bodies, except on periodic meshes and with outflows: solver fast 1e-2, balanced 2e-3, in 3D 3e-3",
   .old = "-flow_once_most",
   .help =
     "residual, relative to the right-hand side, at which a step ends after one iteration (0: never); not if it has tripled since the step "
     "before, if bodies touch or are lighter than the fluid, or if the velocity error is too large",
   .when = FLOW},
  {"-flow_pressure_regularisation", OPT_REAL, "", OPT_POSITIVE, 1, "1e-6", .old = "-flow_pressure_softness",
   .help = "fraction of their inverse mass that body nodes keep in the pressure preconditioner", .when = FLOW,
   .expert = PETSC_TRUE},
  {"-flow_pressure_gap_compressibility", OPT_REAL, "", 0, 1, "1e-3", .old = "-flow_pressure_shared",
   .help = "compressibility of cells between two bodies, or body and wall, as fraction of their nodes' inverse mass",
   .when = FLOW, .expert = PETSC_TRUE},
  {"-flow_pressure_coarse", OPT_CHOICE, "", OPT_ANY, "auto",
   .help =
     "coarse operator of the pressure on the vertices (auto: laplacian in 3D and on nearly square cells, else galerkin)",
   .when = "-flow_fieldsplit_pressure_pc_type mg", .choices = "auto, galerkin, laplacian", .expert = PETSC_TRUE},
  {"-flow_pressure_reuse", OPT_REAL, "", 0, 1, "0.03", .old = "-flow_pressure_keep",
   .help = "fraction of vertices that may change before the multigrid hierarchy of the pressure is rebuilt",
   .when = "-flow_fieldsplit_pressure_pc_type mg", .expert = PETSC_TRUE},
};
OPT_TABLE("solve: linear solvers", SPECS)
