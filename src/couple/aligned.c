/* AlignDriver: see aligned.h. */
#include "compat.h"
#include "aligned.h"
#include "align/join.h"
#include "base/array.h"

#define OWNERS 2 /* at most */

struct _p_AlignDriver {
  Flow             flow;
  MeshUpdate       mesh_update;
  MPI_Comm         comm;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nowner;
  AlignOwner      *owner[OWNERS];
  AlignJoin        join; /* NULL until the first fit, as align */
  Align            align;
  Remap            remap;
  PetscInt         n, capacity; /* all owners' surfaces */
  PetscBool       *wanted, *still, *before, *aligned;
  PetscInt        *waits;
  PetscInt         done;             /* has there been a fit? */
  PetscInt         arrived;          /* owners whose state has been loaded */
  AlignResult      result;           /* as it is, */
  AlignResult      fluid;            /* and with what bounds the fluid alone */
  PetscInt        *masked[3], nmask; /* [ncell_all] cells of some owners' surfaces */
  RemapCount       count;
  /* own fluid nodes that need u^n, u^{n-1}, and two halves of the logarithm of the conformation, if there is one */
  AlignTargets targets;
  /* those on surfaces, of viscoelastic fluids: where their point of the surface was, and what it keeps */
  PetscInt   npoint, point_capacity, *point;
  PetscReal *from, *kept;
  AlignKept *kept_mesh; /* the mesh before, until the next update; NULL: it is this one */
};

/* ---- owners ---- */

void AlignOwnerPack(const AlignOwner *o, PetscInt n, PetscInt v[])
{
  for (PetscInt k = 0; k < n; k++) v[k] = o->aligned[k] ? 1 : -o->waits[k];
}

void AlignOwnerUnpack(const AlignOwner *o, PetscInt n, const PetscInt v[])
{
  for (PetscInt k = 0; k < n; k++) {
    o->aligned[k] = (PetscBool)(v[k] > 0);
    o->waits[k]   = PetscMax(0, -v[k]);
  }
}

/* Whose surface k is, which becomes the number that he has for it */
static const AlignOwner *owner_of(AlignDriver f, PetscInt *k)
{
  return f->owner[AlignJoinFindOwner(f->join, k)];
}

/* The surfaces that there are now, and how they were in the last fit */
static PetscErrorCode gather(AlignDriver f)
{
  const PetscInt *first;

  PetscFunctionBeginUser;
  PetscCall(AlignJoinUpdate(f->join));
  first = AlignJoinGetFirst(f->join);
  f->n  = first[f->nowner];
  /* waits tell of a patience on ranks that know no surface, too */
  PetscCall(ArrayReserve(f->n + 1, &f->capacity, &f->wanted, sizeof(*f->wanted), &f->still, sizeof(*f->still),
                         &f->before, sizeof(*f->before), &f->aligned, sizeof(*f->aligned), &f->waits, sizeof(*f->waits),
                         NULL));
  for (PetscInt i = 0; i < f->nowner; i++) {
    const AlignOwner *o = f->owner[i];
    const PetscInt    n = first[i + 1] - first[i];

    PetscCall(PetscArraycpy(f->before + first[i], o->aligned, n));
    PetscCall(PetscArraycpy(f->waits + first[i], o->waits, n));
    for (PetscInt k = first[i]; k < first[i + 1]; k++) {
      f->wanted[k] = PETSC_TRUE;
      f->still[k]  = PETSC_FALSE;
    }
    if (o->ask) PetscCall((*o->ask)(o->ctx, f->wanted + first[i], f->still + first[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One boundary method a surface for as long as the mesh cannot follow it: what it changes makes the forces jump. One
   that stands still waits for nothing, since nothing will change. */
static void count_down(AlignDriver f)
{
  for (PetscInt k = 0; k < f->n; k++) {
    if (f->result.could[k]) f->waits[k] = f->still[k] ? 0 : f->waits[k] - 1;
    else f->waits[k] = f->aligned[k] || !f->wanted[k] ? 0 : ALIGN_PATIENCE;
  }
}

/* What came out, to the owners */
static PetscErrorCode scatter(AlignDriver f)
{
  const PetscInt *first = AlignJoinGetFirst(f->join);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->nowner; i++) {
    PetscCall(PetscArraycpy(f->owner[i]->aligned, f->aligned + first[i], first[i + 1] - first[i]));
    PetscCall(PetscArraycpy(f->owner[i]->waits, f->waits + first[i], first[i + 1] - first[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* cell [ncell_all] with the surfaces alone that have this at most inside */
static PetscErrorCode mask_cells(AlignDriver f, AlignInside most, const PetscInt cell[], const PetscInt *masked[])
{
  PetscBool all = PETSC_TRUE;
  PetscInt *own;

  PetscFunctionBeginUser;
  *masked = cell;
  for (PetscInt i = 0; i < f->nowner; i++) all = (PetscBool)(all && f->owner[i]->inside <= most);
  if (all) PetscFunctionReturn(PETSC_SUCCESS);
  if (!f->masked[f->nmask]) PetscCall(PetscMalloc1(f->loc->ncell_all, &f->masked[f->nmask]));
  own = f->masked[f->nmask++];
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) {
    PetscInt k = cell[c];

    own[c] = k >= 0 && owner_of(f, &k)->inside <= most ? cell[c] : -1;
  }
  *masked = own;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_align(AlignDriver f)
{
  const AlignSurfaces *table[OWNERS];
  PetscReal           *psi;

  PetscFunctionBeginUser;
  if (f->align) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < f->nowner; i++) table[i] = f->owner[i]->table;
  PetscCall(AlignJoinCreate(f->comm, f->nowner, table, &f->join));
  PetscCall(AlignJoinUpdate(f->join));
  PetscCall(AlignCreate(f->mesh, AlignJoinGet(f->join), &f->align));
  PetscCall(FlowGetLogConformation(f->flow, &psi, NULL));
  PetscCall(AlignTargetsCreate(f->loc, AlignJoinGet(f->join), psi ? 4 : 2, &f->targets));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The mesh lined up with the surfaces that are wanted, of those before (NULL: all) */
static PetscErrorCode fit(AlignDriver f, const PetscBool before[])
{
  PetscFunctionBeginUser;
  PetscCall(AlignFit(f->align, f->wanted, before, f->aligned, &f->result));
  f->nmask = 0;
  f->fluid = f->result;
  PetscCall(mask_cells(f, ALIGN_MATERIAL, f->result.cell_surface, &f->fluid.cell_surface));
  PetscCall(mask_cells(f, ALIGN_MATERIAL, f->result.cell_before, &f->fluid.cell_before));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what is carried over ---- */

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
  for (PetscInt t = 0; t < f->targets.n && f->targets.nfield > 2; t++) {
    const PetscInt    i = f->targets.node[t];
    PetscInt          k = r->node_surface[i];
    const AlignOwner *o;

    if (k < 0 || !r->on_wall[i] || !r->inactive[k] || !f->before[k]) continue;
    PetscCall(ArrayReserve(f->npoint + 1, &f->point_capacity, &f->point, sizeof(*f->point), &f->from,
                           dim * sizeof(*f->from), &f->kept, 2 * dim * sizeof(*f->kept), NULL));
    o = owner_of(f, &k);
    (*o->came_from)(o->ctx, k, f->targets.x + dim * t, f->from + dim * f->npoint);
    f->point[f->npoint++] = i;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What these points keep: psi [2][nnode_all][dim] less its shift, if the step is taken again, on the mesh as it was */
static PetscErrorCode take_points(AlignDriver f, PetscReal *const psi[])
{
  const AlignKept *s = f->kept_mesh;
  PetscInt        *side;
  PetscReal       *size;
  RemapCount       count;

  PetscFunctionBeginUser;
  if (f->targets.nfield == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc2(f->npoint, &side, f->npoint, &size));
  for (PetscInt e = 0; e < f->npoint; e++) size[e] = RemapCellSize(f->remap, f->point[e]);
  if (s)
    PetscCall(RemapEvaluateAt(s->remap, f->npoint, f->from, size, side, (RemapCells){s->inactive, s->side}, 2,
                              (const PetscReal *const *)psi, f->kept, &count));
  else
    PetscCall(RemapEvaluate(f->remap, f->npoint, f->point, f->from, side,
                            (RemapCells){f->fluid.cell_before, f->fluid.side_before}, 2, (const PetscReal *const *)psi,
                            f->kept, &count));
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
  for (PetscInt k = 0; k < (psi ? 4 : 2); k++) {
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

static PetscErrorCode destroy_kept(AlignKept **left)
{
  PetscFunctionBeginUser;
  if (!*left) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(AlignKeptDestroy(*left));
  PetscCall(PetscFree(*left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The fields where the nodes will be */
static PetscErrorCode carry_over(AlignDriver f)
{
  AlignTargets *t = &f->targets;
  PetscReal    *field[ALIGN_FIELDS];

  PetscFunctionBeginUser;
  PetscCall(copy_fields(f, field));
  PetscCall(AlignTargetsFind(t, &f->fluid, f->aligned));
  PetscCall(RemapEvaluate(f->remap, t->n, t->node, t->x, t->side,
                          (RemapCells){f->fluid.cell_before, f->fluid.side_before}, t->nfield,
                          (const PetscReal *const *)field, t->value, &f->count));
  PetscCall(find_points(f));
  join_pairs(t);
  PetscCall(subtract_shift(f, field));
  PetscCall(take_points(f, field + 2));
  for (PetscInt k = 0; k < t->nfield; k++) PetscCall(PetscFree(field[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same from the mesh before, where this one was made anew */
static PetscErrorCode carry_from_old(AlignDriver f)
{
  AlignTargets *to = &f->targets;
  PetscReal    *now[ALIGN_FIELDS];

  PetscFunctionBeginUser;
  PetscCall(copy_fields(f, now));
  PetscCall(AlignKeptEvaluate(f->kept_mesh, &f->fluid, f->remap, (const PetscReal *const *)now, to, &f->count));
  PetscCall(find_points(f));
  join_pairs(to);
  PetscCall(take_points(f, f->kept_mesh->field + 2));
  for (PetscInt k = 0; k < to->nfield; k++) PetscCall(PetscFree(now[k]));
  PetscCall(destroy_kept(&f->kept_mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode carry_others(AlignDriver f)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->nowner; i++) {
    const AlignOwner *o      = f->owner[i];
    const AlignChange change = {&f->result, f->before + AlignJoinGetFirst(f->join)[i], f->remap, (PetscBool)!f->done};

    if (o->carry) PetscCall((*o->carry)(o->ctx, &change));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode AlignDriverCreate(Flow flow, MeshUpdate mesh_update, AlignDriver *driver)
{
  AlignDriver f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->flow        = flow;
  f->mesh_update = mesh_update;
  PetscCall(FlowGetMesh(flow, &f->mesh));
  PetscCall(MeshGetComm(f->mesh, &f->comm));
  PetscCall(MeshGetLocal(f->mesh, &f->loc));
  PetscCall(RemapCreate(f->mesh, &f->remap));
  *driver = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverDestroy(AlignDriver *driver)
{
  AlignDriver  f       = *driver;
  void **const array[] = {(void **)&f->wanted,    (void **)&f->still,     (void **)&f->before,   (void **)&f->aligned,
                          (void **)&f->waits,     (void **)&f->point,     (void **)&f->from,     (void **)&f->kept,
                          (void **)&f->masked[0], (void **)&f->masked[1], (void **)&f->masked[2]};

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(destroy_kept(&f->kept_mesh));
  PetscCall(AlignDestroy(&f->align));
  PetscCall(AlignJoinDestroy(&f->join));
  PetscCall(RemapDestroy(&f->remap));
  PetscCall(AlignTargetsDestroy(&f->targets));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(array); i++) PetscCall(PetscFree(*array[i]));
  PetscCall(PetscFree(*driver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverAdd(AlignDriver f, AlignOwner *owner)
{
  PetscFunctionBeginUser;
  PetscCheck(f->nowner < OWNERS && !f->align, f->comm, PETSC_ERR_PLIB, "Too many owners of surfaces, or too late");
  f->owner[f->nowner++] = owner;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverHold(AlignDriver f, const PetscBool held[])
{
  PetscFunctionBeginUser;
  PetscCall(create_align(f));
  PetscCall(AlignHold(f->align, held));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the step ---- */

/* As the fit has it. Cells leave the fluid if there is an owner with nothing inside, the first. */
static PetscErrorCode new_mesh(AlignDriver f, MeshUpdateMesh *to)
{
  const AlignResult  *r = &f->result;
  const AlignTargets *t = &f->targets;

  PetscFunctionBeginUser;
  *to = (MeshUpdateMesh){.nnode    = r->nnode,
                         .node     = r->node,
                         .x        = r->x,
                         .ncarried = t->n,
                         .carried  = t->node,
                         .value    = t->value,
                         .nalong   = f->npoint,
                         .along    = f->point,
                         .kept     = f->kept};
  if (f->owner[0]->inside > ALIGN_NOTHING) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(mask_cells(f, ALIGN_NOTHING, r->cell_surface, &to->cell_surface));
  to->resolved = f->owner[0]->aligned;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverUpdate(AlignDriver f)
{
  MeshUpdateMesh to;
  PetscBool      any;

  PetscFunctionBeginUser;
  PetscCall(create_align(f));
  PetscCall(gather(f));
  PetscCall(AlignSetPatience(f->align, f->waits));
  PetscCall(fit(f, f->done ? f->before : NULL));
  PetscCall(AlignSetPatience(f->align, NULL));
  count_down(f);
  PetscCall(scatter(f));
  f->targets.n = f->npoint = 0;
  f->count                 = (RemapCount){0, 0, 0, 0};
  PetscCall(MeshUpdateBegin(f->mesh_update, f->result.ncell, f->result.cell, &any));
  if (f->kept_mesh) PetscCall(carry_from_old(f));
  else if (any) PetscCall(carry_over(f));
  PetscCall(carry_others(f));
  f->done = 1;
  PetscCall(new_mesh(f, &to));
  PetscCall(MeshUpdateCommit(f->mesh_update, &to));
  if (!any && AlignJoinGet(f->join)->sum) PetscCall(MeshUpdateBodies(f->mesh_update));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverGetResult(AlignDriver f, const AlignResult **result, const RemapCount **count)
{
  PetscFunctionBeginUser;
  *result = &f->result;
  if (count) *count = &f->count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt AlignDriverGetFirst(AlignDriver f, const AlignOwner *owner)
{
  PetscInt i = 0;

  while (f->owner[i] != owner) i++;
  return AlignJoinGetFirst(f->join)[i];
}

/* ---- other meshes, state ---- */

PetscErrorCode AlignDriverBeforeRemesh(AlignDriver f, AlignKept **left)
{
  PetscFunctionBeginUser;
  PetscCall(PetscNew(left));
  PetscCall(AlignKeptCreate(f->loc, f->done ? &f->fluid : NULL, *left));
  PetscCall(copy_fields(f, (*left)->field));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverAfterRemesh(AlignDriver f, AlignKept **left, Mesh *old)
{
  PetscFunctionBeginUser;
  f->kept_mesh = *left;
  *left        = NULL;
  f->done      = f->kept_mesh->done;
  PetscCall(AlignKeptArrive(f->kept_mesh, old, f->mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDriverVisitState(AlignDriver f, State state, const char name[], PetscBool *known)
{
  PetscFunctionBeginUser;
  PetscCall(StateHas(state, name, known));
  if (*known) PetscCall(StateInts(state, name, 1, &f->done));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool AlignDriverIsDone(AlignDriver f)
{
  return (PetscBool)(f->done != 0);
}

PetscErrorCode AlignDriverRestore(AlignDriver f)
{
  MeshUpdateMesh to;

  PetscFunctionBeginUser;
  f->arrived = (f->arrived + 1) % f->nowner;
  if (f->arrived || !f->done) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(create_align(f));
  PetscCall(gather(f));
  PetscCall(PetscArraycpy(f->wanted, f->before, f->n));
  PetscCall(fit(f, NULL));
  PetscCall(scatter(f));
  PetscCall(new_mesh(f, &to));
  PetscCall(MeshUpdateRestore(f->mesh_update, f->result.ncell, f->result.cell, &to));
  PetscFunctionReturn(PETSC_SUCCESS);
}
