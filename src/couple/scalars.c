/* CoupleScalars: see couple/scalars.h. */
#include "compat.h"
#include "impl.h"
#include "flow/device.h"
#include "couple/scalars.h"
#include "scalarbodies.h"
#include "scalarlayer.h"
#include "scalarphases.h"
#include "base/expr.h"
#include "base/opt.h"
#include "bodies/local.h"

#define PASSES 4    /* until what particles give back is what appears */
#define CHANGE 1e-6 /* change of the content in a step that is the least to go by */

struct _p_CoupleScalars {
  Scalars       scalars;
  ScalarBodies  bodies;  /* NULL: there are none */
  ScalarPhases  phases;  /* likewise */
  PetscBool     started; /* with the values inside bodies */
  PetscInt      n, nboundary;
  CoupleScalar *result;   /* [n] */
  PetscReal    *area;     /* [nboundary] */
  PetscReal    *covered;  /* [n] of ScalarBodiesMeasure */
  PetscBool     measured; /* are areas those of the mesh? */
  PetscReal    *force;    /* [nnode_all][dim] buoyancy; NULL: none */
  PetscReal    *w;        /* [nnode_all][dim] convecting velocity */
  Expr          viscosity_of;
  PetscReal    *viscosity; /* [ncell_all] by viscosity_of */
};

/* ---- viscosity ---- */

/* Of cells, by the values in their middle, extrapolated to the point theta of the step */
static PetscErrorCode set_viscosity(Couple c, CoupleScalars s, PetscReal extrapolation)
{
  const MeshLocal *l = c->loc;
  const PetscInt   n = l->ncell_all, dim = l->dim, middle = l->nb / 2;
  PetscReal       *x, *field[EXPR_FIELDS] = {NULL};
  PetscReal        lowest = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n * dim, &x));
  for (PetscInt e = 0; e < n * dim; e++) x[e] = l->x[l->cell_node[e / dim * l->nb + middle] * dim + e % dim];
  for (PetscInt i = 0; i < s->n; i++) {
    PetscReal *T, *T_old;

    PetscCall(ScalarsGetFields(s->scalars, i, &T, &T_old));
    PetscCall(PetscMalloc1(n, &field[i]));
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt k = l->cell_node[e * l->nb + middle];

      field[i][e] = T[k] + extrapolation * (T[k] - T_old[k]);
      for (PetscInt a = 0; a < dim; a++) field[i][e] += s->result[i].par->gradient[a] * x[e * dim + a];
    }
  }
  PetscCall(ExprEvaluateFields(s->viscosity_of, c->step ? c->step->time : 0, n, x, (const PetscReal *const *)field,
                               s->viscosity));
  for (PetscInt e = 0; e < n; e++) lowest = PetscMin(lowest, s->viscosity[e]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &lowest, 1, MPIU_REAL, MPIU_MIN, c->comm));
  PetscCheck(lowest > 0, c->comm, PETSC_ERR_USER_INPUT,
             "-flow_viscosity_of_scalars %s is %g somewhere: write one that is above zero for all values, with max() perhaps",
             ExprText(s->viscosity_of), (double)lowest);
  for (PetscInt i = 0; i < s->n; i++) PetscCall(PetscFree(field[i]));
  PetscCall(PetscFree(x));
  PetscCall(FlowSetProperties(c->flow, NULL, s->viscosity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a step ---- */

/* T at the point theta of the step is about T^n and so much of what it changed by in the step before */
static PetscReal get_extrapolation(const FlowStep *f)
{
  return f->order == 2 && f->dt_old > 0 ? f->theta * f->dt / f->dt_old : 0;
}

static PetscErrorCode begin_step(Couple c, void *data)
{
  CoupleScalars   s             = (CoupleScalars)data;
  const PetscReal extrapolation = get_extrapolation(c->step);

  PetscFunctionBeginUser;
  if (s->viscosity_of) PetscCall(set_viscosity(c, s, extrapolation));
  PetscCall(ScalarBodiesBegin(s->bodies, c, s->scalars, extrapolation));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleStartPhases(Couple c)
{
  CoupleScalars s = c->scalars;

  PetscFunctionBeginUser;
  if (!s || s->started) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarPhasesUpdate(s->phases));
  PetscCall(ScalarPhasesStart(s->phases));
  s->started = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool CouplePhasesHaveBegun(Couple c)
{
  return (PetscBool)(!c->scalars || c->scalars->started);
}

/* Bodies are where the step has them, which is the scheme's of the flow now: it may have begun anew (dropmesh.c) */
static PetscErrorCode find_bodies(Couple c, void *data)
{
  CoupleScalars    s      = (CoupleScalars)data;
  const FlowStep  *f      = c->step;
  const PetscBool  steady = (PetscBool)(f->dt == 0);
  const ScalarStep step   = {.time          = f->time,
                             .dt            = f->dt,
                             .ct            = steady ? 0 : f->ct,
                             .d0            = steady ? 0 : f->d0,
                             .d1            = f->d1,
                             .theta         = f->theta,
                             .extrapolation = get_extrapolation(f)};

  PetscFunctionBeginUser;
  PetscCall(ScalarsBeginStep(s->scalars, &step));
  if (s->phases) PetscCall(CoupleStartPhases(c));
  if (s->phases) PetscCall(ScalarPhasesUpdate(s->phases));
  if (!s->started) PetscCall(ScalarBodiesStart(s->bodies, c, s->scalars));
  s->started = PETSC_TRUE;
  PetscCall(ScalarBodiesUpdate(s->bodies, c, s->scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_buoyancy(Couple c, void *data)
{
  CoupleScalars s = (CoupleScalars)data;

  PetscFunctionBeginUser;
  if (!s->force) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(s->force, c->loc->nnode_all * c->loc->dim));
  for (PetscInt i = 0; i < s->n; i++) {
    const PetscReal *part = s->phases ? ScalarPhasesWeight(s->phases, i) : ScalarBodiesFluid(s->bodies);

    PetscCall(ScalarsAddBuoyancy(s->scalars, i, c->par->density, c->par->gravity, part, s->force));
  }
  PetscCall(FlowAddForce(c->flow, s, s->force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity at the point theta of the step, against the mesh */
static PetscErrorCode set_convection(Couple c, CoupleScalars s)
{
  const PetscInt   dim = c->loc->dim;
  const PetscReal *mesh, theta = c->step->theta;
  PetscReal       *u;

  PetscFunctionBeginUser;
  PetscCall(FlowTakeSolution(c->flow, c->field.u, c->field.p));
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  if (s->phases) PetscCall(ScalarPhasesGetVelocity(s->phases, &mesh));
  else PetscCall(FlowGetMeshVelocity(c->flow, &mesh));
  for (PetscInt i = 0; i < c->loc->nnode_all; i++)
    for (PetscInt a = 0, e = i * dim; a < dim; a++, e++)
      s->w[e] = theta * c->field.u[e] + (1 - theta) * u[e] - (mesh ? mesh[e] : 0) - c->step->frame[a];
  PetscCall(ScalarBodiesConvect(s->bodies, s->w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve(Couple c, CoupleScalars s)
{
  KSPConvergedReason reason = KSP_CONVERGED_RTOL;
  PetscInt           failed = -1;

  PetscFunctionBeginUser;
  PetscCall(set_convection(c, s));
  for (PetscInt i = 0; i < s->n && failed < 0; i++) {
    PetscBool again = PETSC_TRUE;

    PetscCall(ScalarsPredict(s->scalars, i, s->w));
    PetscCall(ScalarBodiesGiveBack(s->bodies, c, s->scalars, i));
    if (s->phases && c->step->dt > 0) PetscCall(ScalarPhasesGiveBack(s->phases, i));
    for (PetscInt pass = 0; again && pass < PASSES; pass++) {
      PetscCall(ScalarsSolve(s->scalars, i, s->w, &reason));
      again = PETSC_FALSE;
      if (s->phases && c->step->dt > 0 && reason > 0) PetscCall(ScalarPhasesCorrect(s->phases, i, &again));
    }
    if (reason <= 0) failed = i;
  }
  if (failed < 0) PetscCall(ScalarsSettle(s->scalars, &failed, &reason));
  PetscCheck(failed < 0, c->comm, PETSC_ERR_NOT_CONVERGED,
             "Scalar '%s' could not be solved for at t = %g (%s): lower -sim_dt (%g), or raise its conductivity",
             s->result[PetscMax(0, failed)].par->name, (double)c->step->time, KSPConvergedReasons[reason],
             (double)c->step->dt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_step(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(solve(c, (CoupleScalars)data));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure(Couple c, void *data)
{
  CoupleScalars s = (CoupleScalars)data;

  PetscFunctionBeginUser;
  if (c->step->dt == 0) PetscCall(solve(c, s)); /* steady flows are solved for elsewhere, and before */
  if (!s->measured) PetscCall(ScalarsGetAreas(s->scalars, s->area));
  s->measured = PETSC_TRUE;
  PetscCall(ScalarBodiesMeasure(s->bodies, c, s->scalars, s->covered));
  if (s->phases && c->step->dt > 0) PetscCall(ScalarPhasesMeasure(s->phases, s->covered));
  for (PetscInt i = 0; i < s->n; i++) {
    CoupleScalar *r = s->result + i;
    PetscReal     size;

    PetscCall(ScalarBodiesBalance(s->bodies, c, s->scalars, i, &r->balance, r->boundary, r->group));
    r->covered = s->covered[i];
    size       = r->balance.size; /* where next to nothing changes, its round-off is no error */
    if (c->step->dt > 0) size = PetscMax(size, CHANGE * PetscAbsReal(r->balance.content) / c->step->dt);
    r->error = size > 0 ? PetscAbsReal(r->balance.residual) / size : 0;
    for (PetscInt b = 0; r->nusselt && b < s->nboundary; b++)
      r->nusselt[b] = s->area[b] > 0
                      ? r->boundary[b] * r->par->length / (s->area[b] * r->par->conductivity * r->par->difference)
                      : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode balance(Couple c, void *data, const FlowDiagnostics *d, CoupleBalance *b)
{
  CoupleScalars  s      = (CoupleScalars)data;
  const PetscInt dim    = c->loc->dim;
  PetscReal      sum[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  (void)d;
  if (!s->force) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < c->loc->nnode_all * dim; i++) sum[i % dim] += s->force[i];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, c->comm));
  for (PetscInt a = 0; a < dim; a++) {
    b->others[a] += sum[a];
    b->residual[a] -= sum[a];
    b->size += PetscAbsReal(sum[a]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Its power */
static PetscErrorCode energy(Couple c, void *data, CouplePower *w)
{
  CoupleScalars s   = (CoupleScalars)data;
  PetscReal     sum = 0;

  PetscFunctionBeginUser;
  if (!s->force) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < c->loc->nnode_all * c->loc->dim; i++) sum += s->force[i] * c->field.u[i];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, c->comm));
  w->power += sum;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode limit(Couple c, void *data, PetscReal *dt)
{
  PetscFunctionBeginUser;
  PetscCall(ScalarBodiesLimit(((CoupleScalars)data)->bodies, c, dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode accept(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(ScalarBodiesAccept(((CoupleScalars)data)->bodies, c, ((CoupleScalars)data)->scalars));
  if (((CoupleScalars)data)->phases) PetscCall(ScalarPhasesAccept(((CoupleScalars)data)->phases));
  PetscCall(ScalarsAccept(((CoupleScalars)data)->scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- meshes, state ---- */

static PetscErrorCode discard(Couple c, void *data)
{
  CoupleScalars s = (CoupleScalars)data;

  PetscFunctionBeginUser;
  (void)c;
  PetscCall(ScalarsDiscard(s->scalars));
  PetscCall(ScalarBodiesDiscard(s->bodies));
  PetscCall(ScalarPhasesDiscard(s->phases));
  PetscCall(PetscFree(s->force));
  PetscCall(PetscFree(s->w));
  PetscCall(PetscFree(s->viscosity));
  s->measured = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_on_mesh(Couple c, void *data, Mesh *old)
{
  CoupleScalars  s = (CoupleScalars)data;
  const PetscInt n = c->loc->nnode_all * c->loc->dim;

  PetscFunctionBeginUser;
  if (old) PetscCall(ScalarsRemesh(s->scalars, *old));
  PetscCall(PetscMalloc1(n, &s->w));
  if (s->viscosity_of) {
    PetscCall(PetscMalloc1(c->loc->ncell_all, &s->viscosity));
    PetscCall(set_viscosity(c, s, 0));
  }
  for (PetscInt i = 0; i < s->n; i++)
    if (s->result[i].par->expansion != 0 && !s->force) PetscCall(PetscCalloc1(n, &s->force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode renew(Couple c, void *data, FlowSolver solver)
{
  PetscFunctionBeginUser;
  (void)c;
  (void)solver;
  PetscCall(ScalarsRenewSolvers(((CoupleScalars)data)->scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  PetscFunctionBeginUser;
  PetscCall(ScalarsVisitState(((CoupleScalars)data)->scalars, state));
  PetscCall(ScalarBodiesVisit(((CoupleScalars)data)->bodies, c, ((CoupleScalars)data)->scalars, state));
  if (((CoupleScalars)data)->phases) PetscCall(ScalarPhasesVisit(((CoupleScalars)data)->phases, state));
  ((CoupleScalars)data)->started = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Couple c, void *data, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  (void)c;
  PetscCall(ScalarsView(((CoupleScalars)data)->scalars, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  CoupleScalars s = (CoupleScalars)data;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->n; i++) {
    PetscCall(PetscFree(s->result[i].boundary));
    PetscCall(PetscFree(s->result[i].nusselt));
    PetscCall(PetscFree2(s->result[i].group, s->result[i].group_name));
    PetscCall(PetscFree(s->result[i].open));
  }
  PetscCall(ScalarBodiesDestroy(c, &s->bodies));
  PetscCall(ScalarPhasesDestroy(&s->phases));
  PetscCall(ScalarsDestroy(&s->scalars));
  PetscCall(ExprDestroy(&s->viscosity_of));
  PetscCall(PetscFree(s->result));
  PetscCall(PetscFree(s->area));
  PetscCall(PetscFree(s->covered));
  PetscCall(PetscFree(c->scalars));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant SCALARS = {.name         = "scalars",
                                          .begin        = begin_step,
                                          .rows         = find_bodies,
                                          .assemble     = add_buoyancy,
                                          .solved       = solve_step,
                                          .force        = measure,
                                          .balance      = balance,
                                          .energy       = energy,
                                          .limit        = limit,
                                          .advance      = accept,
                                          .connect      = renew,
                                          .discard      = discard,
                                          .after_remesh = make_on_mesh,
                                          .visit        = visit,
                                          .view         = view,
                                          .destroy      = destroy};

/* What cannot be yet, one message each */
static PetscErrorCode refuse(Couple c, CoupleScalars s)
{
  const PetscReal *gravity = c->par->gravity;
  PetscBool        steady  = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(OptPeekBool("-sim_steady", &steady));
  for (PetscInt i = 0; i < s->n; i++) {
    const ScalarParameters *par = s->result[i].par;

    PetscCheck(par->expansion == 0 || !steady, c->comm, PETSC_ERR_SUP,
               "-scalar_%s_expansion %g drives the flow, and -sim_steady solves for the flow alone: run in time until nothing changes",
               par->name, (double)par->expansion);
    PetscCheck(par->expansion == 0 || gravity[0] != 0 || gravity[1] != 0 || gravity[2] != 0, c->comm,
               PETSC_ERR_USER_INPUT, "-scalar_%s_expansion %g needs gravity: give -flow_gravity", par->name,
               (double)par->expansion);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_viscosity(Couple c, CoupleScalars s)
{
  PetscReal number;
  PetscBool given, steady = PETSC_FALSE, slips = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(ExprRead("-flow_viscosity_of_scalars", c->loc->dim, 1, &number, &s->viscosity_of, &given));
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(s->viscosity_of, c->comm, PETSC_ERR_USER_INPUT,
             "-flow_viscosity_of_scalars %g goes by no scalar: give -flow_viscosity %g in its place", (double)number,
             (double)number);
  PetscCall(OptPeekBool("-sim_steady", &steady));
  for (PetscInt g = 0; g < c->s->ngroups; g++) slips = (PetscBool)(slips || c->s->group[g].slip);
  PetscCheck(!steady && !slips, c->comm, PETSC_ERR_SUP,
             "-flow_viscosity_of_scalars %s is not known with %s: leave one of them out", ExprText(s->viscosity_of),
             steady ? "-sim_steady" : "surfaces that slip");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAddScalars(Couple c)
{
  CoupleScalars s;
  Scalars       scalars;

  PetscFunctionBeginUser;
  PetscCall(ScalarsCreate(c->mesh, &scalars));
  if (!scalars) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->scalars = scalars;
  s->n       = ScalarsCount(scalars);
  PetscCall(MeshGetBoundaryCount(c->mesh, &s->nboundary));
  PetscCall(PetscCalloc1(s->n, &s->result));
  PetscCall(PetscCalloc1(s->nboundary, &s->area));
  PetscCall(PetscCalloc1(s->n, &s->covered));
  for (PetscInt i = 0; i < s->n; i++) {
    PetscCall(ScalarsGetParameters(scalars, i, &s->result[i].par));
    PetscCall(PetscCalloc1(s->nboundary, &s->result[i].boundary));
    PetscCall(PetscCalloc1(s->nboundary, &s->result[i].open));
    for (PetscInt b = 0; b < s->nboundary; b++) s->result[i].open[b] = ScalarsIsOpen(scalars, i, b);
    if (s->result[i].par->difference > 0) PetscCall(PetscCalloc1(s->nboundary, &s->result[i].nusselt));
  }
  c->scalars = s;
  PetscCall(read_viscosity(c, s));
  PetscCall(refuse(c, s));
  PetscCall(ScalarBodiesCreate(c, scalars, &s->bodies));
  for (PetscInt i = 0; i < s->n; i++) {
    CoupleScalar *r = s->result + i;

    r->ngroups = c->s->ngroups;
    PetscCall(PetscCalloc2(r->ngroups, &r->group, r->ngroups, &r->group_name));
    for (PetscInt g = 0; g < r->ngroups; g++)
      r->group_name[g] = ScalarBodiesLetsOut(s->bodies, c, i, g) ? c->s->group[g].name : NULL;
  }
  PetscCall(CoupleAddParticipant(c, &SCALARS, s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAddPhases(Couple c, PetscInt n, const ScalarPhase phase[])
{
  CoupleScalars s = c->scalars;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(!s->viscosity_of || n == 0, c->comm, PETSC_ERR_SUP,
             "-flow_viscosity_of_scalars %s: group '%s' has a viscosity of its own: leave one of them out",
             ExprText(s->viscosity_of), phase[0].name);
  PetscCheck(!c->s->nall, c->comm, PETSC_ERR_SUP,
             "-scalars in a flow with both rigid bodies and drops or elastic particles: what these carry is not in one balance: leave one of "
             "the three out");
  PetscCall(ScalarPhasesCreate(c, s->scalars, n, phase, &s->phases));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool CouplePhasesAreAlike(Couple c, PetscInt a, PetscInt b)
{
  return (PetscBool)(!c->scalars || ScalarPhasesAreAlike(c->scalars->phases, a, b));
}

PetscErrorCode CoupleSetPhases(Couple c, const PetscInt cell[], const PetscReal part[], const PetscReal V[])
{
  PetscFunctionBeginUser;
  if (c->scalars) PetscCall(ScalarPhasesSetCells(c->scalars->phases, cell, part, V));
  PetscFunctionReturn(PETSC_SUCCESS);
}

Scalars CoupleCarriedScalars(Couple c)
{
  return c->scalars ? c->scalars->scalars : NULL;
}

PetscErrorCode CoupleGetScalars(Couple c, PetscInt *n, const CoupleScalar *scalar[])
{
  PetscFunctionBeginUser;
  *n      = c->scalars ? c->scalars->n : 0;
  *scalar = c->scalars ? c->scalars->result : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleStartScalars(Couple c, ScalarsReader read)
{
  PetscFunctionBeginUser;
  if (c->scalars) PetscCall(ScalarsSetReader(c->scalars->scalars, read));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetScalarField(Couple c, PetscInt i, PetscReal T[])
{
  PetscReal *now;

  PetscFunctionBeginUser;
  PetscCall(ScalarsGetFields(c->scalars->scalars, i, &now, NULL));
  PetscCall(PetscArraycpy(T, now, c->loc->nnode_all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleMeasureScalarLayers(Couple c, PetscInt i, ScalarLayer layer[])
{
  PetscBool *open;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->s->ngroups, &open));
  ScalarBodiesGetOpen(c->scalars->bodies, c, c->scalars->result[i].par, i, open);
  PetscCall(ScalarLayerMeasure(c, c->scalars->result[i].par, open, layer));
  PetscCall(PetscFree(open));
  PetscFunctionReturn(PETSC_SUCCESS);
}
