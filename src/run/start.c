/* Start: see start.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "start.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "couple/scalars.h"
#include "follow.h"
#include "report/sample.h"

/* ---- fields of another run ---- */

static PetscErrorCode read_run(Mesh mesh, Flow flow, const char run[])
{
  const MeshLocal *l;
  PetscReal       *u, box[2][3];
  SampleCount      count;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(PetscCalloc1(l->nnode_all * l->dim, &u));
  PetscCall(SampleField("-flow_initial_run", run, "velocity", l->dim, mesh, l->x, u, box, &count));
  PetscCheck(count.inside > 0, RunComm(), PETSC_ERR_USER_INPUT,
             "-flow_initial_run %s: no node of this mesh lies in the mesh of that run, which reaches from %g, %g, %g to %g, %g, %g",
             run, (double)box[0][0], (double)box[0][1], (double)box[0][2], (double)box[1][0], (double)box[1][1],
             (double)box[1][2]);
  if (count.outside || count.nowhere)
    PetscCall(LogRemark("%" PetscInt_FMT " of %" PetscInt_FMT
                        " nodes lie outside the mesh of -flow_initial_run: %" PetscInt_FMT
                        " take the velocity at the nearest place of its box, %" PetscInt_FMT " start at rest",
                        count.outside + count.nowhere, l->nnode_global, count.outside, count.nowhere));
  PetscCall(FlowStartFrom(flow, u, NULL));
  PetscCall(PetscFree(u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Scalars know values everywhere or nowhere: a concentration that is missing has no neutral value */
static PetscErrorCode read_scalar(Mesh mesh, const char option[], const char run[], const char scalar[],
                                  const PetscReal x[], PetscReal T[])
{
  PetscReal   box[2][3];
  SampleCount count;

  PetscFunctionBeginUser;
  PetscCall(SampleField(option, run, scalar, 1, mesh, x, T, box, &count));
  PetscCheck(!count.outside && !count.nowhere, RunComm(), PETSC_ERR_USER_INPUT,
             "%s %s: %" PetscInt_FMT
             " nodes of this mesh do not lie in the mesh of that run, which reaches from %g, %g, %g to %g, %g, %g: give a run in the same "
             "domain",
             option, run, count.outside + count.nowhere, (double)box[0][0], (double)box[0][1], (double)box[0][2],
             (double)box[1][0], (double)box[1][1], (double)box[1][2]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StartScalars(Couple couple)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleStartScalars(couple, read_scalar));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- before the coupling ---- */

PetscErrorCode StartRead(Mesh mesh, Flow flow, Bodies bodies)
{
  BodyState  *s;
  FlowInitial kind;
  const char *run;
  PetscBool   any = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetInitial(flow, &kind, &run));
  if (kind == FLOW_START_RUN) PetscCall(read_run(mesh, flow, run));
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *group = &s->group[g];

    any = (PetscBool)(any || group->with_fluid);
    PetscCheck(!group->with_fluid || kind != FLOW_START_STEADY, RunComm(), PETSC_ERR_USER_INPUT,
               "-particle_%s_initial_velocity fluid: with -flow_initial steady the fluid in the body's place is held: remove one of them",
               group->name);
  }
  if (any) PetscCall(StartWithFlow(mesh, flow, bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- flows that are solved for ---- */

/* Ranks know the bodies that reach into them */
static PetscErrorCode know_bodies(const SimComponents *p)
{
  PetscFunctionBeginUser;
  PetscCall(ContactMigrate(p->contact, 0, NULL));
  PetscCall(CoupleUpdateLocalBodies(p->couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Free of divergence, with the walls and the bodies where and as fast as they are */
static PetscErrorCode project(const SimComponents *p)
{
  const PetscReal    tiny = 1e-9; /* of the time that the flow needs through a cell: nothing else acts in it */
  const MeshLocal   *l;
  const PetscReal   *u, *q;
  PetscReal         *now, speed = 0;
  PetscInt           its;
  KSPConvergedReason reason;
  BodyState         *s;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(BodiesGetState(p->bodies, &s));
  PetscCall(FlowGetFields(p->flow, &now, NULL, NULL));
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) speed = PetscMax(speed, PetscAbsReal(now[i]));
  for (PetscInt i = 0; i < 3 * s->n; i++) {
    const PetscReal turns = PetscAbsReal(s->w[i / 3][i % 3]) * BodiesGetRadius(s, i / 3);

    speed = PetscMax(speed, PetscMax(PetscAbsReal(s->u[i / 3][i % 3]), turns));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, p->comm));
  if (speed == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowBeginStep(p->flow, tiny * l->h / speed, tiny * l->h / speed));
  PetscCall(CoupleUpdateGeometry(p->couple));
  PetscCall(CoupleSolve(p->couple, &its, &reason));
  PetscCheck(reason > 0, p->comm, PETSC_ERR_NOT_CONVERGED,
             "The flow at the start could not be made free of divergence (%s): raise -flow_ksp_max_it, or use -flow_solver direct",
             KSPConvergedReasons[reason]);
  PetscCall(CoupleGetSolution(p->couple, &u, &q));
  PetscCall(FlowStartFrom(p->flow, u, NULL));
  PetscCall(CoupleStartSolids(p->couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is free rests meanwhile */
static PetscErrorCode solve_steady(const SimComponents *p)
{
  const PetscReal  zero[3] = {0, 0, 0};
  const PetscReal *u, *pressure;
  PetscReal(*keep)[6];
  PetscInt   its, linear;
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  PetscCall(PetscMalloc1(s->n, &keep));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscCall(PetscArraycpy(keep[k], s->u[k], 3));
    PetscCall(PetscArraycpy(keep[k] + 3, s->w[k], 3));
    if (BodiesGetGroup(s, k)->free) PetscCall(BodiesSetVelocity(p->bodies, k, zero, zero));
  }
  PetscCall(SteadySetUp(p->steady_start));
  PetscCall(SteadySolve(p->steady_start, &its, &linear));
  PetscCheck(!InterruptHeard(), p->comm, PETSC_ERR_USER,
             "A signal ended the run before the flow of its start was known: there is nothing to save");
  PetscCall(CoupleGetSolution(p->couple, &u, &pressure));
  PetscCall(FlowStartFrom(p->flow, u, pressure));
  for (PetscInt k = 0; k < s->n; k++) PetscCall(BodiesSetVelocity(p->bodies, k, keep[k], keep[k] + 3));
  PetscCall(PetscFree(keep));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StartSolve(const SimComponents *p)
{
  FlowInitial kind;
  PetscBool   projected;

  PetscFunctionBeginUser;
  PetscCall(FlowGetInitial(p->flow, &kind, NULL));
  projected = (PetscBool)(kind == FLOW_START_EXPRESSION || kind == FLOW_START_RUN);
  PetscCall(know_bodies(p));
  if (kind != FLOW_START_STEADY) PetscCall(CoupleStartInside(p->couple, projected));
  if (projected || kind == FLOW_START_STEADY) {
    PetscCall(BodiesSetFixed(p->bodies, PETSC_TRUE));
    if (projected) PetscCall(project(p));
    else PetscCall(solve_steady(p));
    PetscCall(BodiesSetFixed(p->bodies, PETSC_FALSE));
    PetscCall(BodiesSetTime(p->bodies, 0));
    PetscCall(CoupleRenewSolver(p->couple)); /* as a restart would: all depends on the fields alone */
  }
  if (kind == FLOW_START_STEADY) PetscCall(CoupleStartInside(p->couple, PETSC_FALSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}
