/* AlignBodies: see alignbodies.h. */
#include "compat.h"
#include "alignbodies.h"
#include "couple/bodysurfaces.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "bodies/local.h"

/* Of a mesh that is no more */
struct _n_AlignBodiesKept {
  AlignKept *mesh;
  PetscInt  *fitted;                 /* [n] AlignOwnerPack */
  PetscReal (*X)[3], (*q)[4], *size; /* [n] */
};

struct _p_AlignBodies {
  Bodies           bodies;
  BodyState       *state;
  PetscInt         dim;
  const PetscReal *period;
  BodySurfaces     surfaces;
  AlignDriver      driver;
  AlignOwner       owner;            /* aligned, waits: [n] of the state */
  PetscReal (*X)[3], (*q)[4], *size; /* [n] where and how large they were in the last fit */
  PetscReal (*displacement)[3],
    (*rotation)[9]; /* [n] from there to where they are now, and from points now to points then */
  AlignCarry carry; /* of AlignBodiesSetCarry; NULL: none */
  void      *carry_ctx;
};

/* ---- what the driver asks ---- */

/* One that stands still waits for nothing, since nothing will change */
static PetscErrorCode ask(void *ctx, PetscBool wanted[], PetscBool still[])
{
  const BodyState *s = ((AlignBodies)ctx)->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    wanted[k] = (PetscBool)(!s->removed[k] && !BodiesGetGroup(s, k)->body_fitted);
    still[k]  = (PetscBool)(dot3(s->u[k], s->u[k]) == 0 && dot3(s->w[k], s->w[k]) == 0);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void came_from(void *ctx, PetscInt k, const PetscReal x[], PetscReal y[])
{
  const AlignBodies f      = (AlignBodies)ctx;
  PetscReal         arm[3] = {0, 0, 0};

  for (PetscInt a = 0; a < f->dim; a++) arm[a] = DomainNearest(f->period[a], x[a], f->X[k][a]) - f->X[k][a];
  for (PetscInt a = 0; a < f->dim; a++) y[a] = f->X[k][a] - f->displacement[k][a] + dot3(f->rotation[k] + 3 * a, arm);
}

static PetscErrorCode carry_others(void *ctx, const AlignChange *change)
{
  const AlignBodies f = (AlignBodies)ctx;
  const AlignMotion m = {change->result, (const PetscReal(*)[3])f->displacement, (const PetscReal(*)[9])f->rotation,
                         change->before, change->remap};

  PetscFunctionBeginUser;
  if (f->carry && !change->first) PetscCall((*f->carry)(f->carry_ctx, &m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode AlignBodiesCreate(Flow flow, Bodies bodies, MeshUpdate mesh_update, AlignBodies *align)
{
  AlignBodies      f;
  Mesh             mesh;
  const MeshLocal *loc;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->bodies = bodies;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &loc));
  f->dim    = loc->dim;
  f->period = loc->period;
  PetscCall(BodiesGetState(bodies, &f->state));
  PetscCall(BodySurfacesCreate(bodies, &f->surfaces));
  PetscCall(BodySurfacesSet(f->surfaces, (PetscReal(*)[3])f->state->x, (PetscReal(*)[4])f->state->q));
  PetscCall(BodySurfacesRefusePlates(f->surfaces, mesh));
  f->owner = (AlignOwner){.table     = BodySurfacesGet(f->surfaces),
                          .inside    = ALIGN_NOTHING,
                          .ctx       = f,
                          .ask       = ask,
                          .came_from = came_from,
                          .carry     = carry_others};
  PetscCall(BodiesAttach(bodies, sizeof(*f->owner.aligned), (void **)&f->owner.aligned));
  PetscCall(BodiesAttach(bodies, sizeof(*f->owner.waits), (void **)&f->owner.waits));
  PetscCall(BodiesAttach(bodies, sizeof(*f->X), (void **)&f->X));
  PetscCall(BodiesAttach(bodies, sizeof(*f->q), (void **)&f->q));
  PetscCall(BodiesAttach(bodies, sizeof(*f->size), (void **)&f->size));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->displacement), (void **)&f->displacement));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->rotation), (void **)&f->rotation));
  PetscCall(AlignDriverCreate(flow, mesh_update, &f->driver));
  PetscCall(AlignDriverAdd(f->driver, &f->owner));
  *align = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignBodiesDestroy(AlignBodies *align)
{
  AlignBodies  f       = *align;
  void **const array[] = {(void **)&f->owner.aligned, (void **)&f->owner.waits,  (void **)&f->X,       (void **)&f->q,
                          (void **)&f->size,          (void **)&f->displacement, (void **)&f->rotation};

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(AlignDriverDestroy(&f->driver));
  PetscCall(BodySurfacesDestroy(&f->surfaces));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(array); i++) PetscCall(BodiesDetach(f->bodies, array[i]));
  PetscCall(PetscFree(*align));
  PetscFunctionReturn(PETSC_SUCCESS);
}

AlignDriver AlignBodiesGetDriver(AlignBodies f)
{
  return f->driver;
}

PetscErrorCode AlignBodiesSetCarry(AlignBodies f, AlignCarry carry, void *ctx)
{
  PetscFunctionBeginUser;
  f->carry     = carry;
  f->carry_ctx = ctx;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignBodiesSetPoints(AlignBodies f, PetscInt n, const PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(BodySurfacesSetPoints(f->surfaces, n, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the step ---- */

/* Bodies are at X, q now, of the sizes that they have: the motion since the last fit */
static void find_motion(AlignBodies f, PetscReal (*X)[3], PetscReal (*q)[4])
{
  for (PetscInt k = 0; k < f->state->n; k++) {
    const PetscReal shrunk = f->size[k] / f->state->scale[k];
    PetscReal       now[9], then[9];

    RotationMatrix(q[k], now);
    RotationMatrix(f->q[k], then);
    for (PetscInt a = 0; a < 3; a++) {
      f->displacement[k][a] = X[k][a] - (a < f->dim ? DomainNearest(f->period[a], f->X[k][a], X[k][a]) : f->X[k][a]);
      for (PetscInt b = 0; b < 3; b++) f->rotation[k][3 * a + b] = shrunk * dot3(then + 3 * a, now + 3 * b);
    }
  }
}

PetscErrorCode AlignBodiesUpdate(AlignBodies f, PetscReal (*X)[3], PetscReal (*q)[4], const PetscBool *aligned[])
{
  const PetscInt n = f->state->n;

  PetscFunctionBeginUser;
  PetscCall(BodySurfacesSet(f->surfaces, X, q));
  find_motion(f, X, q);
  PetscCall(PetscArraycpy((PetscReal *)f->X, (PetscReal *)X, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)f->q, (PetscReal *)q, 4 * n));
  PetscCall(PetscArraycpy(f->size, f->state->scale, n));
  PetscCall(AlignDriverUpdate(f->driver));
  *aligned = f->owner.aligned;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- other meshes, state ---- */

PetscErrorCode AlignBodiesBeforeRemesh(AlignBodies f, AlignBodiesKept **left)
{
  const PetscInt   n = f->state->n;
  AlignBodiesKept *s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  PetscCall(AlignDriverBeforeRemesh(f->driver, &s->mesh));
  PetscCall(PetscMalloc4(n, &s->fitted, n, &s->X, n, &s->q, n, &s->size));
  PetscCall(PetscArraycpy(s->size, f->size, n));
  PetscCall(PetscArraycpy((PetscReal *)s->X, (PetscReal *)f->X, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)s->q, (PetscReal *)f->q, 4 * n));
  AlignOwnerPack(&f->owner, n, s->fitted);
  *left = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignBodiesAfterRemesh(AlignBodies f, AlignBodiesKept **left, Mesh *old)
{
  const PetscInt   n = f->state->n;
  AlignBodiesKept *s = *left;

  PetscFunctionBeginUser;
  AlignOwnerUnpack(&f->owner, n, s->fitted);
  PetscCall(PetscArraycpy(f->size, s->size, n));
  PetscCall(PetscArraycpy((PetscReal *)f->X, (PetscReal *)s->X, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)f->q, (PetscReal *)s->q, 4 * n));
  PetscCall(AlignDriverAfterRemesh(f->driver, &s->mesh, old));
  PetscCall(PetscFree4(s->fitted, s->X, s->q, s->size));
  PetscCall(PetscFree(*left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that are spread are still known where the scene has put them */
static PetscErrorCode restore(AlignBodies f)
{
  PetscFunctionBeginUser;
  if (AlignDriverIsDone(f->driver)) {
    PetscCall(PetscArraycpy(f->size, f->state->scale, f->state->n)); /* those of the last step */
    PetscCall(BodiesMigrate(f->bodies, 0, 1));
    PetscCall(BodySurfacesSet(f->surfaces, f->X, f->q));
  }
  PetscCall(AlignDriverRestore(f->driver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_bodies(AlignBodies f, State state)
{
  const PetscInt n = f->state->n;
  PetscInt      *fitted;
  BodyRows       rows;

  PetscFunctionBeginUser;
  PetscCall(BodiesBeginRows(f->bodies, &rows));
  PetscCall(BodiesVisitReals(f->bodies, &rows, state, "fit_X", 3, (PetscReal *)f->X));
  PetscCall(BodiesVisitReals(f->bodies, &rows, state, "fit_q", 4, (PetscReal *)f->q));
  PetscCall(PetscMalloc1(n, &fitted));
  AlignOwnerPack(&f->owner, n, fitted);
  PetscCall(BodiesVisitIntegers(f->bodies, &rows, state, "fitted", fitted));
  AlignOwnerUnpack(&f->owner, n, fitted);
  PetscCall(PetscFree(fitted));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignBodiesVisitState(AlignBodies f, State state)
{
  PetscBool known;

  PetscFunctionBeginUser;
  PetscCall(AlignDriverVisitState(f->driver, state, "fit_done", &known));
  if (known) PetscCall(visit_bodies(f, state));
  if (StateIsLoading(state)) PetscCall(restore(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}
