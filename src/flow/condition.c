/* Conditions: see condition.h. Conditions are attached to named boundaries of the mesh; where boundaries meet, walls
   win over inflow, and inflow over slip. */
#include "compat.h"
#include "boundary.h"
#include "base/opt.h"

static const char *const BC_TYPES[] = {"no_slip", "moving_wall", "rotating_wall", "inflow",
                                       "outflow", "slip",        "pressure",      NULL};
static const char *const PROFILES[] = {"uniform", "parabolic", NULL};

/* Of every boundary, over all ranks: lower ends, and upper ones with the other sign */
static PetscErrorCode find_extents(Conditions f)
{
  const MeshLocal *l = f->loc;
  PetscReal       *lower;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(6 * f->n, &lower));
  for (PetscInt e = 0; e < 6 * f->n; e++) lower[e] = PETSC_MAX_REAL;
  for (PetscInt b = 0; b < f->n; b++) {
    const PetscInt *node;
    PetscInt        n;

    PetscCall(MeshGetBoundaryNodes(f->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++)
      for (PetscInt d = 0; d < l->dim; d++) {
        lower[6 * b + d]     = PetscMin(lower[6 * b + d], l->x[node[i] * l->dim + d]);
        lower[6 * b + 3 + d] = PetscMin(lower[6 * b + 3 + d], -l->x[node[i] * l->dim + d]);
      }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, lower, (PetscMPIInt)(6 * f->n), MPIU_REAL, MPIU_MIN, f->comm));
  for (PetscInt e = 0; e < 3 * f->n; e++) {
    f->condition[e / 3].lower[e % 3] = lower[e / 3 * 6 + e % 3];
    f->condition[e / 3].upper[e % 3] = -lower[e / 3 * 6 + 3 + e % 3];
  }
  PetscCall(PetscFree(lower));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_rotation(Conditions f, const char name[], Condition *bc)
{
  const PetscInt dim = f->loc->dim;
  char           option[OPT_NAME];
  PetscBool      has_omega;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(OptJoin("-flow_bc_", name, "_omega", option), dim == 2 ? 1 : 3,
                         dim == 2 ? bc->omega + 2 : bc->omega, &has_omega));
  PetscCheck(has_omega, f->comm, PETSC_ERR_USER_INPUT,
             "Boundary '%s' is of type rotating_wall: give its angular velocity with %s", name, option);
  PetscCall(OptRealArray(OptJoin("-flow_bc_", name, "_centre", option), dim, bc->centre, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_pressure(Conditions f, const char name[], Condition *bc)
{
  const PetscInt dim = f->loc->dim;
  char           option[OPT_NAME];
  PetscBool      given;

  PetscFunctionBeginUser;
  PetscCall(ExprRead(OptJoin("-flow_bc_", name, "_pressure", option), dim, 1, &bc->pressure, &bc->formula, &given));
  PetscCheck(given, f->comm, PETSC_ERR_USER_INPUT,
             "Boundary '%s' is of type pressure: give the pressure outside with %s", name, option);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_boundary(Conditions f, PetscInt b)
{
  const PetscInt dim = f->loc->dim;
  Condition     *bc  = f->condition + b;
  const char    *name;
  char           option[OPT_NAME];
  PetscInt       type = BC_NO_SLIP, profile = 0;
  PetscBool      has_velocity;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryName(f->mesh, b, &name));
  PetscCall(OptChoice(OptJoin("-flow_bc_", name, "_type", option), BC_TYPES, &type));
  bc->type      = (ConditionsType)type;
  bc->factor[0] = bc->factor[2] = 1;
  (void)OptJoin("-flow_bc_", name, "_velocity", option);
  if (type == BC_INFLOW || type == BC_MOVING_WALL) {
    PetscCall(ExprRead(option, dim, dim, bc->velocity, &bc->formula, &has_velocity));
    PetscCheck(has_velocity, f->comm, PETSC_ERR_USER_INPUT, "Boundary '%s' is of type %s: give its velocity with %s",
               name, BC_TYPES[type], option);
    PetscCall(OptChoice(OptJoin("-flow_bc_", name, "_profile", option), PROFILES, &profile));
  }
  if (type == BC_ROTATING_WALL) PetscCall(read_rotation(f, name, bc));
  if (type == BC_PRESSURE) PetscCall(read_pressure(f, name, bc));
  if (type == BC_INFLOW || type == BC_MOVING_WALL || type == BC_ROTATING_WALL || type == BC_PRESSURE) {
    PetscCall(OptRealArray(OptJoin("-flow_bc_", name, "_factor", option), 3, bc->factor, NULL));
    PetscCheck(bc->factor[1] == 0 || bc->factor[2] > 0, f->comm, PETSC_ERR_USER_INPUT,
               "Option %s: the period %g must be positive", option, (double)bc->factor[2]);
    PetscCall(OptReal(OptJoin("-flow_bc_", name, "_ramp", option), &bc->ramp));
  }
  bc->parabolic = (PetscBool)(profile == 1);
  if (type == BC_SLIP) {
    bc->axis = -1;
    for (PetscInt d = 0; d < dim; d++)
      if (bc->upper[d] - bc->lower[d] < 1e-10 * (f->loc->upper[d] - f->loc->lower[d])) bc->axis = d;
    PetscCheck(bc->axis >= 0, f->comm, PETSC_ERR_SUP,
               "Boundary '%s' is not a plane along an axis: slip is available on such planes only, choose another -flow_bc_%s_type",
               name, name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Which components a condition prescribes. Where boundaries meet, walls win over inflow, and inflow over slip. */
static PetscErrorCode mark_fixed(Conditions f)
{
  const PetscInt all     = (1 << f->loc->dim) - 1;
  PetscInt       outflow = 0;

  PetscFunctionBeginUser;
  for (PetscInt b = 0; b < f->n; b++) {
    const PetscInt *node, bits = BoundaryIsFree(f->condition + b) ? 0
                               : f->condition[b].type == BC_SLIP  ? 1 << f->condition[b].axis
                                                                  : all;
    PetscInt        n;

    outflow += BoundaryIsFree(f->condition + b);
    PetscCall(MeshGetBoundaryNodes(f->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++) {
      f->fixed[node[i]] |= (unsigned char)bits;
      if (f->condition[b].type != BC_INFLOW) f->wall[node[i]] |= (unsigned char)bits;
    }
  }
  f->floating = (PetscBool)(outflow == 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal boundary_factor(const Condition *bc, PetscReal t)
{
  PetscReal value = bc->factor[0] +
                    (bc->factor[1] != 0 ? bc->factor[1] * PetscSinReal(2 * PETSC_PI * t / bc->factor[2]) : 0);

  if (bc->ramp > 0 && t < bc->ramp) value *= 0.5 * (1 - PetscCosReal(PETSC_PI * t / bc->ramp));
  return value;
}

static PetscReal boundary_profile(const Condition *bc, PetscInt dim, const PetscReal x[])
{
  PetscReal value = 1, longest = 0;

  if (!bc->parabolic) return 1;
  for (PetscInt d = 0; d < dim; d++) longest = PetscMax(longest, bc->upper[d] - bc->lower[d]);
  for (PetscInt d = 0; d < dim; d++) {
    const PetscReal length = bc->upper[d] - bc->lower[d], s = x[d] - bc->lower[d];

    if (length > 1e-10 * longest) value *= 4 * s * (length - s) / (length * length);
  }
  return value;
}

static PetscErrorCode evaluate_field(Conditions f, PetscReal time)
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->nnode_all; i++) {
    PetscReal v[3];

    if (!f->fixed[i]) continue;
    PetscCall(f->field(f->field_ctx, time, f->loc->x + i * dim, v));
    for (PetscInt a = 0; a < dim; a++)
      if ((f->fixed[i] >> a) & 1) f->value[i * dim + a] = v[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_steady(Conditions f, PetscInt b, PetscReal time)
{
  const PetscReal *factor  = f->condition[b].factor;
  const Expr       formula = f->condition[b].formula;
  const char      *name;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryName(f->mesh, b, &name));
  PetscCheck(time < PETSC_MAX_REAL || factor[1] == 0, f->comm, PETSC_ERR_USER_INPUT,
             "Boundary '%s' changes in time (-flow_bc_%s_factor %g,%g,%g) and has no steady state: set the second number to 0, or run in time without -sim_steady",
             name, name, (double)factor[0], (double)factor[1], (double)factor[2]);
  PetscCheck(time < PETSC_MAX_REAL || !formula || !ExprUsesTime(formula), f->comm, PETSC_ERR_USER_INPUT,
             "Boundary '%s' changes in time (-flow_bc_%s_%s %s) and has no steady state: remove t, or run in time without -sim_steady",
             name, name, f->condition[b].type == BC_PRESSURE ? "pressure" : "velocity", ExprText(formula));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocities of the formula at the boundary's nodes [n][dim], NULL without one */
static PetscErrorCode evaluate_formula(Conditions f, Condition *bc, PetscReal time, PetscInt n, const PetscInt node[],
                                       const PetscReal *velocity[])
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  *velocity = NULL;
  if (!bc->formula) PetscFunctionReturn(PETSC_SUCCESS);
  if (!bc->x) PetscCall(PetscMalloc1(n * dim, &bc->x));
  for (PetscInt i = 0; i < n * dim; i++) bc->x[i] = f->loc->x[node[i / dim] * dim + i % dim];
  PetscCall(ExprKeep(bc->formula, time < PETSC_MAX_REAL ? time : 0, n, bc->x, velocity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Prescribed velocity at x, without the factor of time; given: what the formula says, or NULL */
static void wall_velocity(const Condition *bc, PetscInt dim, const PetscReal x[], const PetscReal given[],
                          PetscReal v[3])
{
  if (bc->type == BC_SLIP || bc->type == BC_NO_SLIP) return;
  if (bc->type == BC_ROTATING_WALL) {
    const PetscReal *w    = bc->omega;
    const PetscReal  r[3] = {x[0] - bc->centre[0], x[1] - bc->centre[1], dim == 3 ? x[2] - bc->centre[2] : 0};

    for (PetscInt a = 0; a < dim; a++) v[a] = w[(a + 1) % 3] * r[(a + 2) % 3] - w[(a + 2) % 3] * r[(a + 1) % 3];
  } else {
    const PetscReal s = boundary_profile(bc, dim, x);

    for (PetscInt a = 0; a < dim; a++) v[a] = s * (given ? given[a] : bc->velocity[a]);
  }
}

PetscErrorCode ConditionsSetTime(Conditions f, PetscReal time)
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  f->time  = time;
  f->timed = PETSC_TRUE;
  for (PetscInt b = 0; b < f->n; b++)
    if (f->condition[b].type == BC_PRESSURE) PetscCall(check_steady(f, b, time));
  if (f->field) PetscCall(evaluate_field(f, time < PETSC_MAX_REAL ? time : 0));
  for (PetscInt pass = 0; pass < 5 && !f->field; pass++) {
    for (PetscInt b = 0; b < f->n; b++) {
      Condition       *bc = f->condition + b;
      const PetscInt  *node;
      const PetscReal *given;
      PetscInt         n;
      PetscReal        factor;

      if (bc->type != ORDER[pass]) continue;
      PetscCall(check_steady(f, b, time));
      factor = boundary_factor(bc, time);
      PetscCall(MeshGetBoundaryNodes(f->mesh, b, &n, &node));
      PetscCall(evaluate_formula(f, bc, time, n, node, &given));
      for (PetscInt i = 0; i < n; i++) {
        PetscReal v[3] = {0, 0, 0};

        wall_velocity(bc, dim, f->loc->x + node[i] * dim, given ? given + i * dim : NULL, v);
        for (PetscInt a = 0; a < dim; a++)
          if (bc->type != BC_SLIP || a == bc->axis) f->value[node[i] * dim + a] = factor * v[a];
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsRenew(Conditions f)
{
  PetscFunctionBeginUser;
  if (f->timed) PetscCall(ConditionsSetTime(f, f->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsCreate(Mesh mesh, Conditions *boundary)
{
  Conditions f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->mesh = mesh;
  PetscCall(MeshGetComm(mesh, &f->comm));
  PetscCall(MeshGetLocal(mesh, &f->loc));
  PetscCall(MeshGetBoundaryCount(mesh, &f->n));
  PetscCall(PetscCalloc4(f->n, &f->condition, f->loc->nnode_all, &f->fixed, f->loc->nnode_all, &f->wall,
                         f->loc->nnode_all * f->loc->dim, &f->value));
  PetscCall(find_extents(f));
  for (PetscInt b = 0; b < f->n; b++) PetscCall(read_boundary(f, b));
  PetscCall(mark_fixed(f));
  *boundary = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsDestroy(Conditions *boundary)
{
  PetscFunctionBeginUser;
  if (!*boundary) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt b = 0; b < (*boundary)->n; b++) {
    PetscCall(ExprDestroy(&(*boundary)->condition[b].formula));
    PetscCall(PetscFree((*boundary)->condition[b].x));
  }
  PetscCall(PetscFree4((*boundary)->condition, (*boundary)->fixed, (*boundary)->wall, (*boundary)->value));
  PetscCall(PetscFree(*boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the scene says of it: ", velocity 1,0, profile parabolic" */
static PetscErrorCode view_values(const char boundary[], PetscViewer viewer)
{
  static const char *const KEYS[] = {"_velocity", "_profile", "_pressure", "_omega", "_centre", "_factor", "_ramp"};

  PetscFunctionBeginUser;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(KEYS); i++) {
    char option[OPT_NAME], text[256];

    PetscCall(OptPeek(OptJoin("-flow_bc_", boundary, KEYS[i], option), text, sizeof(text)));
    if (text[0]) PetscCall(PetscViewerASCIIPrintf(viewer, ", %s %s", KEYS[i] + 1, text));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsView(Conditions f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  for (PetscInt b = 0; b < f->n; b++) {
    const char *name;
    char        where[256];

    PetscCall(MeshGetBoundaryName(f->mesh, b, &name));
    PetscCall(MeshDescribeBoundary(f->mesh, b, where, sizeof(where)));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  boundary %s (%s): %s", name, where, BC_TYPES[f->condition[b].type]));
    PetscCall(view_values(name, viewer));
    PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetValues(Conditions f, const unsigned char *fixed[], const PetscReal *value[])
{
  PetscFunctionBeginUser;
  *fixed = f->fixed;
  if (value) *value = f->value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetWalls(Conditions f, const unsigned char *wall[])
{
  PetscFunctionBeginUser;
  *wall = f->wall;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsSetField(Conditions f, VectorField field, void *ctx)
{
  PetscFunctionBeginUser;
  f->field     = field;
  f->field_ctx = ctx;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsPressureIsFloating(Conditions f, PetscBool *floating)
{
  PetscFunctionBeginUser;
  *floating = f->floating;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetSpeed(Conditions f, PetscReal *speed)
{
  PetscFunctionBeginUser;
  *speed = 0;
  for (PetscInt b = 0; b < f->n; b++) {
    Condition      *bc     = f->condition + b;
    const PetscReal factor = PetscAbsReal(bc->factor[0]) + PetscAbsReal(bc->factor[1]), *given;
    const PetscInt *node;
    PetscInt        n;
    /* a profile has its largest between nodes */
    const Condition even = {.type     = bc->type,
                            .velocity = {bc->velocity[0], bc->velocity[1], bc->velocity[2]},
                            .omega    = {bc->omega[0], bc->omega[1], bc->omega[2]},
                            .centre   = {bc->centre[0], bc->centre[1], bc->centre[2]}};

    if (bc->type == BC_OUTFLOW || bc->type == BC_PRESSURE) continue; /* it prescribes none */
    PetscCall(MeshGetBoundaryNodes(f->mesh, b, &n, &node));
    PetscCall(evaluate_formula(f, bc, f->timed ? f->time : 0, n, node, &given));
    for (PetscInt i = 0; i < n; i++) {
      PetscReal v[3] = {0, 0, 0};

      wall_velocity(&even, f->loc->dim, f->loc->x + node[i] * f->loc->dim, given ? given + i * f->loc->dim : NULL, v);
      *speed = PetscMax(*speed, factor * PetscSqrtReal(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, speed, 1, MPIU_REAL, MPIU_MAX, f->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetVelocity(Conditions f, PetscInt b, const PetscReal x[3], PetscReal v[3])
{
  const Condition *bc     = f->condition + b;
  const PetscReal  time   = f->timed && f->time < PETSC_MAX_REAL ? f->time : 0;
  const PetscReal  factor = boundary_factor(bc, f->timed ? f->time : 0);
  PetscReal        given[3];

  PetscFunctionBeginUser;
  v[0] = v[1] = v[2] = 0;
  if (bc->formula) PetscCall(ExprEvaluateAlone(bc->formula, time, x, given));
  wall_velocity(bc, f->loc->dim, x, bc->formula ? given : NULL, v);
  for (PetscInt a = 0; a < f->loc->dim; a++) v[a] *= factor;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetPressure(Conditions f, PetscInt b, PetscReal theta, PetscReal dt, PetscInt m,
                                     const PetscReal x[], PetscReal value[])
{
  const Condition *bc        = f->condition + b;
  const PetscBool  steady    = (PetscBool)(f->time >= PETSC_MAX_REAL);
  const PetscReal  weight[2] = {theta, 1 - theta};
  PetscReal       *given;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(m, &given));
  PetscCall(PetscArrayzero(value, m));
  for (PetscInt k = 0; k < 2; k++) {
    const PetscReal time = f->time - k * dt, factor = weight[k] * boundary_factor(bc, steady ? f->time : time);

    if (weight[k] == 0) continue;
    if (bc->formula && ExprUsesPosition(bc->formula))
      PetscCall(ExprEvaluate(bc->formula, steady ? 0 : time, m, x, given));
    for (PetscInt i = 0; i < m && !bc->formula; i++) given[i] = bc->pressure;
    if (bc->formula && !ExprUsesPosition(bc->formula)) {
      PetscReal one;

      PetscCall(ExprEvaluate(bc->formula, steady ? 0 : time, 1, NULL, &one));
      for (PetscInt i = 0; i < m; i++) given[i] = one;
    }
    for (PetscInt i = 0; i < m; i++) value[i] += factor * given[i];
  }
  PetscCall(PetscFree(given));
  PetscFunctionReturn(PETSC_SUCCESS);
}
