/* Flow, how it starts (flow.h): velocities that are known in closed form. Those that have to be solved for, or read
   from another run, are set by the room run. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"

/* In the order of FlowInitial */
static const char *const KINDS[] = {"rest", "uniform", "shear", "poiseuille", "expression", "steady", "run", NULL};

/* Linear between the two walls of an axis, and that times 4 s (1 - s) for every axis with walls; s in [0, 1] */
typedef struct {
  PetscInt  axis;         /* of the linear part, -1: none */
  PetscReal wall[2][3];   /* velocities there */
  PetscReal top[3];       /* largest velocity of the parabolic part */
  PetscBool parabolic[3]; /* axes of the parabola */
} Profile;

static PetscErrorCode read_kind(Flow f)
{
  const PetscInt dim  = f->loc->dim;
  PetscInt       kind = -1;
  PetscBool      given;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-flow_initial", KINDS, &kind));
  PetscCall(ExprRead("-flow_velocity", dim, dim, f->par.velocity, &f->start.formula, &given));
  for (PetscInt a = 0; a < dim && !given; a++) f->start.mean = (PetscBool)(f->start.mean || f->par.velocity[a] != 0);
  if (kind < 0)
    kind = f->start.formula ? FLOW_START_EXPRESSION : given || f->start.mean ? FLOW_START_UNIFORM : FLOW_START_REST;
  f->start.kind = (FlowInitial)kind;
  PetscCheck(!given || kind == FLOW_START_UNIFORM || kind == FLOW_START_EXPRESSION || kind == FLOW_START_POISEUILLE,
             f->comm, PETSC_ERR_USER_INPUT, "-flow_velocity has no meaning with -flow_initial %s: remove one of them",
             KINDS[kind]);
  PetscCheck(given || f->start.mean || (kind != FLOW_START_UNIFORM && kind != FLOW_START_EXPRESSION), f->comm,
             PETSC_ERR_USER_INPUT, "-flow_initial %s needs -flow_velocity", KINDS[kind]);
  PetscCheck(!f->start.formula || kind == FLOW_START_EXPRESSION, f->comm, PETSC_ERR_USER_INPUT,
             "-flow_velocity %s is an expression, and -flow_initial %s takes numbers: use -flow_initial expression",
             ExprText(f->start.formula), KINDS[kind]);
  if (kind == FLOW_START_RUN) PetscCall(OptString("-flow_initial_run", f->start.run, sizeof(f->start.run)));
  PetscCheck(kind != FLOW_START_RUN || f->start.run[0], f->comm, PETSC_ERR_USER_INPUT,
             "-flow_initial run needs -flow_initial_run, the output folder of a run or one of its files fields_<step>.h5");
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The walls of the box: does axis a have two, and their velocities */
static PetscErrorCode find_walls(Flow f, PetscInt a, PetscReal v[2][3], PetscBool *both)
{
  PetscBool wall;

  PetscFunctionBeginUser;
  *both = PETSC_TRUE;
  for (PetscInt side = 0; side < 2; side++) {
    PetscCall(ConditionsGetSide(f->boundary, 2 * a + side, v[side], &wall));
    *both = (PetscBool)(*both && wall);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_profile(Flow f, Profile *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(p, sizeof(*p)));
  p->axis = -1;
  for (PetscInt a = 0; a < f->loc->dim; a++) {
    PetscReal v[2][3] = {{0}};
    PetscBool both, moves = PETSC_FALSE;

    PetscCall(find_walls(f, a, v, &both));
    for (PetscInt d = 0; d < 6; d++) moves = (PetscBool)(moves || v[d / 3][d % 3] != 0);
    p->parabolic[a] = both;
    if (!both || !moves) continue;
    PetscCheck(p->axis < 0, f->comm, PETSC_ERR_USER_INPUT,
               "-flow_initial %s: walls move along two axes, and nothing is linear between all of them: use -flow_initial steady",
               KINDS[f->start.kind]);
    p->axis = a;
    PetscCall(PetscMemcpy(p->wall, v, sizeof(v)));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Without -flow_velocity: the parabola that -flow_force drives between two walls, f H^2/(8 mu) */
static PetscErrorCode find_top(Flow f, Profile *p)
{
  const MeshLocal *l     = f->loc;
  PetscInt         walls = 0, axis = 0;
  PetscReal        force = 0;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < l->dim; a++) {
    if (p->parabolic[a]) axis = a;
    walls += p->parabolic[a];
    p->top[a] = f->par.velocity[a]; /* a mean is 2/3 of the largest, for each axis */
    for (PetscInt b = 0; b < l->dim && f->start.mean; b++) p->top[a] *= p->parabolic[b] ? 1.5 : 1;
    force = PetscMax(force, PetscAbsReal(f->par.force[a]));
  }
  PetscCheck(walls > 0, f->comm, PETSC_ERR_USER_INPUT,
             "-flow_initial poiseuille: the box has no axis with walls (no_slip, moving_wall) on both sides: see -flow_bc_<boundary>_type");
  for (PetscInt a = 0; a < l->dim; a++)
    if (f->par.velocity[a] != 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(force > 0 && walls == 1 && !f->force.expr, f->comm, PETSC_ERR_USER_INPUT,
             "-flow_initial poiseuille needs -flow_velocity, the largest velocity of the profile%s",
             walls > 1 ? "" : " (or -flow_force, numbers, which drives it)");
  for (PetscInt a = 0; a < l->dim; a++)
    p->top[a] = a == axis ? 0 : f->par.force[a] * PetscSqr(l->upper[axis] - l->lower[axis]) / (8 * f->par.viscosity);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_profile(Flow f)
{
  const MeshLocal *l = f->loc;
  Profile          p;

  PetscFunctionBeginUser;
  PetscCall(find_profile(f, &p));
  if (f->start.kind == FLOW_START_POISEUILLE) PetscCall(find_top(f, &p));
  else
    PetscCheck(p.axis >= 0, f->comm, PETSC_ERR_USER_INPUT,
               "-flow_initial shear: the box has no two walls (no_slip, moving_wall) that face each other and of which one moves: see "
               "-flow_bc_<boundary>_type and _velocity");
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscReal s[3], shape = 1;

    for (PetscInt a = 0; a < l->dim; a++) {
      s[a] = (l->x[i * l->dim + a] - l->lower[a]) / (l->upper[a] - l->lower[a]);
      if (p.parabolic[a]) shape *= 4 * s[a] * (1 - s[a]);
    }
    for (PetscInt a = 0; a < l->dim; a++)
      f->u[i * l->dim + a] = shape * p.top[a] +
                             (p.axis < 0 ? 0 : (1 - s[p.axis]) * p.wall[0][a] + s[p.axis] * p.wall[1][a]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetInitial(Flow f)
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(read_kind(f));
  if (f->start.kind == FLOW_START_UNIFORM)
    for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) f->u[i] = f->par.velocity[i % l->dim];
  if (f->start.kind == FLOW_START_EXPRESSION) {
    for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) f->u[i] = f->par.velocity[i % l->dim];
    if (f->start.formula) PetscCall(ExprEvaluate(f->start.formula, 0, l->nnode_all, l->x, f->u));
  }
  if (f->start.kind == FLOW_START_SHEAR || f->start.kind == FLOW_START_POISEUILLE) PetscCall(set_profile(f));
  PetscCall(PetscArraycpy(f->u_old, f->u, l->nnode_all * l->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetInitial(Flow f, FlowInitial *kind, const char *run[])
{
  PetscFunctionBeginUser;
  *kind = f->start.kind;
  if (run) *run = f->start.run;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowStartFrom(Flow f, const PetscReal u[], const PetscReal p[])
{
  PetscFunctionBeginUser;
  if (f->device) PetscCall(OnDeviceBring(f, PETSC_TRUE));
  PetscCall(PetscArraycpy(f->u, u, f->loc->nnode_all * f->loc->dim));
  PetscCall(PetscArraycpy(f->u_old, u, f->loc->nnode_all * f->loc->dim));
  if (p) PetscCall(PetscArraycpy(f->p, p, f->loc->ncell * (f->loc->dim + 1)));
  PetscFunctionReturn(PETSC_SUCCESS);
}
