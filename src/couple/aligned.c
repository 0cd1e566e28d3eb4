/* AlignDriver: see aligned.h. */
#include "compat.h"
#include "aligned.h"
#include "alignkept.h"
#include "couple/bodysurfaces.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "base/array.h"
#include "bodies/local.h"

/* Of a mesh that is no more */
struct _n_AlignDriverKept {
  AlignKept  mesh;
  PetscInt   done;
  PetscBool *aligned;                /* [n] */
  PetscInt  *waits;                  /* [n] */
  PetscReal (*X)[3], (*q)[4], *size; /* [n] */
};

struct _p_AlignDriver {
  Flow             flow;
  MeshUpdate       mesh_update;
  BodyState       *state;
  Mesh             mesh;
  const MeshLocal *loc;
  BodySurfaces     surfaces;
  Align            align;
  Remap            remap;
  Bodies           bodies;
  PetscBool       *wanted, *aligned, *before; /* [n] of the state */
  PetscInt        *waits;                     /* [n] steps until the mesh may follow it again, 0: it may */
  PetscReal (*X)[3], (*q)[4], *size;          /* [n] where and how large they were in the last fit */
  PetscReal (*displacement)[3],
    (*rotation)[9]; /* [n] from there to where they are now, and from points now to points then */
  PetscInt    done; /* has there been one? */
  AlignResult result;
  RemapCount  count;
  /* own fluid nodes that need u^n, u^{n-1}, and two halves of the logarithm of the conformation, if there is one */
  AlignTargets targets;
  /* those on surfaces, of viscoelastic fluids: where their point of the surface was, and what it keeps */
  PetscInt         npoint, point_capacity, *point;
  PetscReal       *from, *kept;
  AlignDriverKept *kept_mesh; /* the mesh before, until the next update; NULL: it is this one */
  AlignCarry       carry;     /* of AlignDriverSetCarry; NULL: none */
  void            *carry_ctx;
};

/* Of the two values of a node on a path, which come one after the other, the mean */
static void join_pairs(AlignTargets *to)
{
  const PetscInt bs = to->nfield * to->loc->dim;
  PetscInt       n  = 0;

  for (PetscInt t = 0; t < to->n; n++) {
    const PetscBool  pair = (PetscBool)(t + 1 < to->n && to->node[t + 1] == to->node[t]);
    const PetscReal *v    = to->value + bs * t;

    for (PetscInt e = 0; e < bs; e++) to->value[bs * n + e] = pair ? 0.5 * (v[e] + v[bs + e]) : v[e];
    to->node[n] = to->node[t];
    t += pair ? 2 : 1;
  }
  to->n = n;
}

/* Of own nodes on the surfaces of bodies that were there before: where their points of the surface were */
static PetscErrorCode find_points(AlignDriver f)
{
  const AlignResult *r   = &f->result;
  const PetscInt     dim = f->loc->dim;

  PetscFunctionBeginUser;
  f->npoint = 0;
  for (PetscInt t = 0; t < f->targets.n && f->targets.nfield > 2 && f->done; t++) {
    const PetscInt i = f->targets.node[t], k = r->node_surface[i];
    PetscReal      arm[3] = {0, 0, 0};

    if (k < 0 || !r->on_wall[i] || !r->inactive[k] || !f->before[k]) continue;
    PetscCall(ArrayReserve(f->npoint + 1, &f->point_capacity, &f->point, sizeof(*f->point), &f->from,
                           dim * sizeof(*f->from), &f->kept, 2 * dim * sizeof(*f->kept), NULL));
    for (PetscInt a = 0; a < dim; a++)
      arm[a] = DomainNearest(f->loc->period[a], f->targets.x[dim * t + a], f->X[k][a]) - f->X[k][a];
    for (PetscInt a = 0; a < dim; a++)
      f->from[dim * f->npoint + a] = f->X[k][a] - f->displacement[k][a] + dot3(f->rotation[k] + 3 * a, arm);
    f->point[f->npoint++] = i;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What these points keep: psi [2][nnode_all][dim] less its shift, if the step is taken again, on the mesh as it was */
static PetscErrorCode take_points(AlignDriver f, PetscReal *const psi[])
{
  const AlignResult     *r = &f->result;
  const AlignDriverKept *s = f->kept_mesh;
  PetscInt              *side;
  PetscReal             *size;
  RemapCount             count;

  PetscFunctionBeginUser;
  if (f->targets.nfield == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc2(f->npoint, &side, f->npoint, &size));
  for (PetscInt e = 0; e < f->npoint; e++) size[e] = RemapCellSize(f->remap, f->point[e]);
  if (s)
    PetscCall(RemapEvaluateAt(s->mesh.remap, f->npoint, f->from, size, side,
                              (RemapCells){s->mesh.inactive, s->mesh.side}, 2, (const PetscReal *const *)psi, f->kept,
                              &count));
  else
    PetscCall(RemapEvaluate(f->remap, f->npoint, f->point, f->from, side, (RemapCells){r->cell_before, r->side_before},
                            2, (const PetscReal *const *)psi, f->kept, &count));
  PetscCall(PetscFree2(side, size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Copies of the fields that are carried, [nnode_all][dim] each */
static PetscErrorCode copy_fields(AlignDriver f, PetscReal *field[])
{
  const PetscInt n = f->loc->nnode_all, dim = f->loc->dim;
  PetscReal     *u[2], *psi;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(f->flow, &u[0], &u[1], NULL));
  PetscCall(FlowGetLogConformation(f->flow, &psi, NULL));
  for (PetscInt k = 0; k < f->targets.nfield; k++) {
    PetscCall(PetscMalloc1(n * dim, &field[k]));
    if (k < 2) PetscCall(PetscArraycpy(field[k], u[k], n * dim));
    for (PetscInt i = 0; i < n * dim && k >= 2; i++) field[k][i] = psi[2 * (i - i % dim) + (k - 2) * dim + i % dim];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* If the step is taken again psi has its shift of the time before */
static PetscErrorCode subtract_shift(AlignDriver f, PetscReal *field[])
{
  const PetscInt dim = f->loc->dim;
  PetscReal     *psi, *shift;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLogConformation(f->flow, &psi, &shift));
  for (PetscInt k = 2; k < f->targets.nfield; k++)
    for (PetscInt i = 0; i < f->loc->nnode_all * dim; i++)
      field[k][i] -= shift[2 * (i - i % dim) + (k - 2) * dim + i % dim];
  if (shift) PetscCall(PetscArrayzero(shift, f->loc->nnode_all * 2 * dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_fields(PetscInt n, PetscReal *field[])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < n; k++) PetscCall(PetscFree(field[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_kept(AlignDriverKept **left)
{
  AlignDriverKept *s = *left;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(AlignKeptDestroy(&s->mesh));
  PetscCall(PetscFree5(s->aligned, s->waits, s->X, s->q, s->size));
  PetscCall(PetscFree(*left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The fields where the nodes will be */
static PetscErrorCode carry_over(AlignDriver f)
{
  const AlignResult *r = &f->result;
  AlignTargets      *t = &f->targets;
  PetscReal         *field[ALIGN_FIELDS];

  PetscFunctionBeginUser;
  PetscCall(copy_fields(f, field));
  PetscCall(AlignTargetsFind(t, r, f->state->number, f->aligned));
  PetscCall(RemapEvaluate(f->remap, t->n, t->node, t->x, t->side, (RemapCells){r->cell_before, r->side_before},
                          t->nfield, (const PetscReal *const *)field, t->value, &f->count));
  PetscCall(find_points(f));
  join_pairs(t);
  PetscCall(subtract_shift(f, field));
  PetscCall(take_points(f, field + 2));
  PetscCall(free_fields(t->nfield, field));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same from the mesh before, where this one was made anew */
static PetscErrorCode carry_from_old(AlignDriver f)
{
  AlignTargets *to = &f->targets;
  PetscReal    *now[ALIGN_FIELDS];

  PetscFunctionBeginUser;
  PetscCall(copy_fields(f, now));
  PetscCall(AlignKeptEvaluate(&f->kept_mesh->mesh, &f->result, f->state->number, f->remap,
                              (const PetscReal *const *)now, to, &f->count));
  PetscCall(find_points(f));
  join_pairs(to);
  PetscCall(take_points(f, f->kept_mesh->mesh.field + 2));
  PetscCall(free_fields(to->nfield, now));
  PetscCall(destroy_kept(&f->kept_mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverSetCarry(AlignDriver f, AlignCarry carry, void *ctx)
{
  PetscFunctionBeginUser;
  f->carry     = carry;
  f->carry_ctx = ctx;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverSetPoints(AlignDriver f, PetscInt n, const PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(BodySurfacesSetPoints(f->surfaces, n, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode carry_others(AlignDriver f)
{
  const AlignMotion m = {&f->result, (const PetscReal(*)[3])f->displacement, (const PetscReal(*)[9])f->rotation,
                         f->before, f->remap};

  PetscFunctionBeginUser;
  if (f->carry) PetscCall((*f->carry)(f->carry_ctx, &m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static MeshUpdateMesh new_mesh(AlignDriver f)
{
  const AlignResult  *r = &f->result;
  const AlignTargets *t = &f->targets;

  return (MeshUpdateMesh){r->nnode, r->node, r->x,     PETSC_FALSE, r->cell_surface, f->aligned,
                          t->n,     t->node, t->value, f->npoint,   f->point,        f->kept};
}

PetscErrorCode AlignDriverCreate(Flow flow, Bodies bodies, MeshUpdate mesh_update, AlignDriver *driver)
{
  AlignDriver f;
  PetscReal  *psi;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->flow        = flow;
  f->mesh_update = mesh_update;
  f->bodies      = bodies;
  PetscCall(FlowGetMesh(flow, &f->mesh));
  PetscCall(MeshGetLocal(f->mesh, &f->loc));
  PetscCall(BodiesGetState(bodies, &f->state));
  PetscCall(BodySurfacesCreate(bodies, &f->surfaces));
  PetscCall(BodySurfacesSet(f->surfaces, (PetscReal(*)[3])f->state->x, (PetscReal(*)[4])f->state->q));
  PetscCall(BodySurfacesRefusePlates(f->surfaces, f->mesh));
  PetscCall(AlignCreate(f->mesh, BodySurfacesGet(f->surfaces), &f->align));
  PetscCall(RemapCreate(f->mesh, &f->remap));
  PetscCall(FlowGetLogConformation(flow, &psi, NULL));
  PetscCall(AlignTargetsCreate(f->loc, psi ? 4 : 2, &f->targets));
  PetscCall(BodiesAttach(bodies, sizeof(*f->aligned), (void **)&f->aligned));
  PetscCall(BodiesAttach(bodies, sizeof(*f->waits), (void **)&f->waits));
  PetscCall(BodiesAttach(bodies, sizeof(*f->X), (void **)&f->X));
  PetscCall(BodiesAttach(bodies, sizeof(*f->q), (void **)&f->q));
  PetscCall(BodiesAttach(bodies, sizeof(*f->size), (void **)&f->size));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->wanted), (void **)&f->wanted));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->before), (void **)&f->before));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->displacement), (void **)&f->displacement));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->rotation), (void **)&f->rotation));
  *driver = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverDestroy(AlignDriver *driver)
{
  AlignDriver  f       = *driver;
  void **const array[] = {(void **)&f->aligned, (void **)&f->waits,        (void **)&f->X,
                          (void **)&f->q,       (void **)&f->size,         (void **)&f->wanted,
                          (void **)&f->before,  (void **)&f->displacement, (void **)&f->rotation};

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(destroy_kept(&f->kept_mesh));
  PetscCall(AlignDestroy(&f->align));
  PetscCall(BodySurfacesDestroy(&f->surfaces));
  PetscCall(RemapDestroy(&f->remap));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(array); i++) PetscCall(BodiesDetach(f->bodies, array[i]));
  PetscCall(AlignTargetsDestroy(&f->targets));
  PetscCall(PetscFree(f->point));
  PetscCall(PetscFree(f->from));
  PetscCall(PetscFree(f->kept));
  PetscCall(PetscFree(*driver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One boundary method a body for as long as the mesh cannot follow it: what it changes makes the forces jump. One that
   stands still waits for nothing, since nothing will change. */
static void count_down(AlignDriver f)
{
  for (PetscInt k = 0; k < f->state->n; k++) {
    const PetscBool still = (PetscBool)(dot3(f->state->u[k], f->state->u[k]) == 0 &&
                                        dot3(f->state->w[k], f->state->w[k]) == 0);

    if (f->result.could[k]) f->waits[k] = still ? 0 : f->waits[k] - 1;
    else f->waits[k] = f->aligned[k] || !f->wanted[k] ? 0 : ALIGN_PATIENCE;
  }
}

/* Bodies are at X, q now, of the sizes that they have: the motion since the last fit */
static void find_motion(AlignDriver f, PetscReal (*X)[3], PetscReal (*q)[4])
{
  for (PetscInt k = 0; k < f->state->n; k++) {
    const PetscReal shrunk = f->size[k] / f->state->scale[k];
    PetscReal       now[9], then[9];

    RotationMatrix(q[k], now);
    RotationMatrix(f->q[k], then);
    for (PetscInt a = 0; a < 3; a++) {
      f->displacement[k][a] = X[k][a] -
                              (a < f->loc->dim ? DomainNearest(f->loc->period[a], f->X[k][a], X[k][a]) : f->X[k][a]);
      for (PetscInt b = 0; b < 3; b++) f->rotation[k][3 * a + b] = shrunk * dot3(then + 3 * a, now + 3 * b);
    }
  }
}

PetscErrorCode AlignDriverUpdate(AlignDriver f, PetscReal (*X)[3], PetscReal (*q)[4], const PetscBool *aligned[],
                                 const AlignResult **result, const RemapCount **count)
{
  const PetscInt  n     = f->state->n;
  const PetscBool first = (PetscBool)!f->done;
  MeshUpdateMesh  to;
  PetscBool       any;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < n; k++)
    f->wanted[k] = (PetscBool)(!f->state->removed[k] && !BodiesGetGroup(f->state, k)->body_fitted);
  PetscCall(PetscArraycpy(f->before, f->aligned, n));
  PetscCall(AlignSetPatience(f->align, f->waits));
  PetscCall(BodySurfacesSet(f->surfaces, X, q));
  PetscCall(AlignFit(f->align, f->wanted, f->done ? f->before : NULL, f->aligned, &f->result));
  PetscCall(AlignSetPatience(f->align, NULL));
  count_down(f);
  find_motion(f, X, q);
  PetscCall(PetscArraycpy((PetscReal *)f->X, (PetscReal *)X, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)f->q, (PetscReal *)q, 4 * n));
  PetscCall(PetscArraycpy(f->size, f->state->scale, n));
  f->done      = 1;
  f->targets.n = f->npoint = 0;
  f->count                 = (RemapCount){0, 0, 0, 0};
  PetscCall(MeshUpdateBegin(f->mesh_update, f->result.ncell, f->result.cell, &any));
  if (f->kept_mesh) PetscCall(carry_from_old(f));
  else if (any) PetscCall(carry_over(f));
  if (!first) PetscCall(carry_others(f));
  to = new_mesh(f);
  PetscCall(MeshUpdateCommit(f->mesh_update, &to));
  if (!any && BodiesComm(f->bodies) != PETSC_COMM_SELF) PetscCall(MeshUpdateBodies(f->mesh_update));
  *aligned = f->aligned;
  *result  = &f->result;
  *count   = &f->count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverBeforeRemesh(AlignDriver f, AlignDriverKept **left)
{
  const PetscInt   n = f->state->n;
  AlignDriverKept *s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  PetscCall(AlignKeptCreate(f->loc, f->done ? &f->result : NULL, &s->mesh));
  PetscCall(copy_fields(f, s->mesh.field));
  PetscCall(PetscMalloc5(n, &s->aligned, n, &s->waits, n, &s->X, n, &s->q, n, &s->size));
  PetscCall(PetscArraycpy(s->size, f->size, n));
  PetscCall(PetscArraycpy((PetscReal *)s->X, (PetscReal *)f->X, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)s->q, (PetscReal *)f->q, 4 * n));
  PetscCall(PetscArraycpy(s->aligned, f->aligned, n));
  PetscCall(PetscArraycpy(s->waits, f->waits, n));
  s->done = f->done;
  *left   = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverAfterRemesh(AlignDriver f, AlignDriverKept **left, Mesh *old)
{
  const PetscInt n = f->state->n;

  PetscFunctionBeginUser;
  f->kept_mesh = *left;
  *left        = NULL;
  f->done      = f->kept_mesh->done;
  PetscCall(PetscArraycpy(f->aligned, f->kept_mesh->aligned, n));
  PetscCall(PetscArraycpy(f->waits, f->kept_mesh->waits, n));
  PetscCall(PetscArraycpy(f->size, f->kept_mesh->size, n));
  PetscCall(PetscArraycpy((PetscReal *)f->X, (PetscReal *)f->kept_mesh->X, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)f->q, (PetscReal *)f->kept_mesh->q, 4 * n));
  PetscCall(AlignKeptArrive(&f->kept_mesh->mesh, old, f->mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The mesh of the fields that are there. Bodies that are spread are still known where the scene has put them. */
static PetscErrorCode restore_mesh(AlignDriver f)
{
  MeshUpdateMesh to;

  PetscFunctionBeginUser;
  PetscCall(BodiesMigrate(f->bodies, 0, 1));
  PetscCall(PetscArraycpy(f->wanted, f->aligned, f->state->n));
  PetscCall(BodySurfacesSet(f->surfaces, f->X, f->q));
  PetscCall(AlignFit(f->align, f->wanted, NULL, f->aligned, &f->result));
  to = new_mesh(f);
  PetscCall(MeshUpdateRestore(f->mesh_update, f->result.ncell, f->result.cell, &to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverVisitState(AlignDriver f, State state)
{
  const PetscInt n = f->state->n;
  PetscInt      *aligned;
  PetscBool      has;
  BodyRows       rows;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "fit_done", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS); /* of a run with another method: the mesh is as at the start */
  PetscCall(StateInts(state, "fit_done", 1, &f->done));
  PetscCall(BodiesBeginRows(f->bodies, &rows));
  PetscCall(BodiesVisitReals(f->bodies, &rows, state, "fit_X", 3, (PetscReal *)f->X));
  PetscCall(BodiesVisitReals(f->bodies, &rows, state, "fit_q", 4, (PetscReal *)f->q));
  PetscCall(PetscMalloc1(n, &aligned));
  for (PetscInt k = 0; k < n; k++) aligned[k] = f->aligned[k] ? 1 : -f->waits[k];
  PetscCall(BodiesVisitIntegers(f->bodies, &rows, state, "fitted", aligned));
  for (PetscInt k = 0; k < n; k++) {
    f->aligned[k] = (PetscBool)(aligned[k] > 0);
    f->waits[k]   = PetscMax(0, -aligned[k]);
  }
  PetscCall(PetscFree(aligned));
  PetscCall(BodiesEndRows(&rows));
  if (StateIsLoading(state)) PetscCall(PetscArraycpy(f->size, f->state->scale, n)); /* those of the last step */
  if (StateIsLoading(state) && f->done) PetscCall(restore_mesh(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}
