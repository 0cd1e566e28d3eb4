/* ElasticAlign: see elasticalign.h. */
#include "compat.h"
#include "elasticalign.h"
#include "alignkept.h"
#include "bodies/local.h"
#include "couple/couple.h"

/* Of a mesh that is no more */
struct _n_ElasticAlignKept {
  AlignKept  mesh;
  PetscBool *aligned; /* [n] */
  PetscInt  *waits;   /* [n] */
  PetscInt   done;
};

struct _p_ElasticAlign {
  Flow               flow;
  MeshUpdate         mesh_update;
  Mesh               mesh;
  const MeshLocal   *loc;
  const SolidsState *s;
  ElasticSurfaces    surfaces;
  ElasticCarry       carry; /* or NULL, with */
  void              *ctx;
  Align              align;
  Remap              remap;
  AlignResult        result;
  PetscReal         *x;                         /* [nnode][dim] of the last update */
  PetscBool         *wanted, *aligned, *before; /* [n] */
  PetscInt          *waits;                     /* [n] steps until the mesh may follow it again, 0: it may */
  PetscInt           done;
  PetscBool          solid_inside; /* some cells are a solid's */
  PetscReal         *density;      /* [ncell_all] */
  PetscInt          *label, *none; /* [ncell_all]; none: -1 */
  AlignTargets       targets;      /* own nodes that get other old velocities */
  ElasticAlignKept  *kept_mesh;    /* the mesh before, until the next update; NULL: it is this one */
};

PetscErrorCode ElasticAlignCreate(Flow flow, MeshUpdate update, const SolidsState *s, ElasticSurfaces surfaces,
                                  ElasticAlign *align)
{
  ElasticAlign f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->flow        = flow;
  f->mesh_update = update;
  f->s           = s;
  f->surfaces    = surfaces;
  PetscCall(FlowGetMesh(flow, &f->mesh));
  PetscCall(MeshGetLocal(f->mesh, &f->loc));
  PetscCall(ElasticSurfacesSet(f->surfaces, s->x));
  PetscCall(AlignCreate(f->mesh, ElasticSurfacesGet(f->surfaces), &f->align));
  PetscCall(RemapCreate(f->mesh, &f->remap));
  PetscCall(
    PetscCalloc5(s->nnode * s->dim, &f->x, s->n, &f->wanted, s->n, &f->aligned, s->n, &f->before, s->n, &f->waits));
  PetscCall(PetscCalloc3(f->loc->ncell_all, &f->density, f->loc->ncell_all, &f->label, f->loc->ncell_all, &f->none));
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) f->none[c] = -1;
  PetscCall(AlignTargetsCreate(f->loc, 2, &f->targets));
  *align = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignHold(ElasticAlign f, const PetscBool held[])
{
  PetscFunctionBeginUser;
  PetscCall(AlignHold(f->align, held));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignSetCarry(ElasticAlign f, ElasticCarry carry, void *ctx)
{
  PetscFunctionBeginUser;
  f->carry = carry;
  f->ctx   = ctx;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_kept(ElasticAlignKept **left)
{
  ElasticAlignKept *kept = *left;

  PetscFunctionBeginUser;
  if (!kept) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(AlignKeptDestroy(&kept->mesh));
  PetscCall(PetscFree2(kept->aligned, kept->waits));
  PetscCall(PetscFree(*left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignDestroy(ElasticAlign *align)
{
  ElasticAlign f = *align;

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(destroy_kept(&f->kept_mesh));
  PetscCall(AlignDestroy(&f->align));
  PetscCall(RemapDestroy(&f->remap));
  PetscCall(PetscFree5(f->x, f->wanted, f->aligned, f->before, f->waits));
  PetscCall(PetscFree3(f->density, f->label, f->none));
  PetscCall(AlignTargetsDestroy(&f->targets));
  PetscCall(PetscFree(*align));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- old velocities ---- */

/* What is fluid for it: on both sides of a membrane */
static AlignResult fluid_of(const ElasticAlign f)
{
  AlignResult fluid = f->result;

  if (SolidsHave(f->s, PETSC_TRUE)) fluid.cell_surface = fluid.cell_before = f->none;
  return fluid;
}

static PetscErrorCode carry_over(ElasticAlign f)
{
  const AlignResult fluid = fluid_of(f);
  AlignTargets     *t     = &f->targets;
  PetscReal        *u[2];
  RemapCount        count;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(f->flow, &u[0], &u[1], NULL));
  if (f->kept_mesh) {
    PetscCall(AlignKeptEvaluate(&f->kept_mesh->mesh, &fluid, NULL, f->remap, (const PetscReal *const *)u, t, &count));
    PetscCall(destroy_kept(&f->kept_mesh));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(AlignTargetsFind(t, &fluid, NULL, NULL));
  PetscCall(RemapEvaluate(f->remap, t->n, t->node, t->x, t->side, (RemapCells){fluid.cell_before, fluid.side_before}, 2,
                          (const PetscReal *const *)u, t->value, &count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- labels ---- */

/* Cells of solids that are followed, and their density */
static PetscErrorCode set_labels(ElasticAlign f)
{
  const FlowParameters *par;
  PetscBool             any = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(f->flow, &par));
  for (PetscInt k = 0; k < f->s->n && SolidsHave(f->s, PETSC_FALSE); k++) any = (PetscBool)(any || f->aligned[k]);
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) {
    f->label[c]   = f->result.cell_surface[c];
    f->density[c] = f->label[c] >= 0 ? 0 : par->density;
  }
  f->solid_inside = any;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void count_down(ElasticAlign f)
{
  for (PetscInt k = 0; k < f->s->n; k++) {
    if (f->result.could[k]) f->waits[k]--;
    else f->waits[k] = f->aligned[k] ? 0 : ALIGN_PATIENCE;
  }
}

PetscErrorCode ElasticAlignUpdate(ElasticAlign f, const PetscReal x[], ElasticLabels *labels)
{
  const AlignResult *r = &f->result;
  PetscBool          any;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < f->s->n; k++) f->wanted[k] = PETSC_TRUE;
  PetscCall(PetscArraycpy(f->before, f->aligned, f->s->n));
  PetscCall(PetscArraycpy(f->x, x, f->s->nnode * f->s->dim));
  PetscCall(ElasticSurfacesSet(f->surfaces, x));
  PetscCall(AlignSetPatience(f->align, f->waits));
  PetscCall(AlignFit(f->align, f->wanted, f->done ? f->before : NULL, f->aligned, &f->result));
  PetscCall(AlignSetPatience(f->align, NULL));
  count_down(f);
  f->done      = 1;
  f->targets.n = 0;
  PetscCall(MeshUpdateBegin(f->mesh_update, r->ncell, r->cell, &any));
  if (any || f->kept_mesh) PetscCall(carry_over(f));
  if (f->carry) PetscCall((*f->carry)(f->ctx, f->remap, r));
  PetscCall(MeshUpdateCommit(f->mesh_update, &(MeshUpdateMesh){.nnode    = r->nnode,
                                                               .node     = r->node,
                                                               .x        = r->x,
                                                               .ncarried = f->targets.n,
                                                               .carried  = f->targets.node,
                                                               .value    = f->targets.value}));
  PetscCall(set_labels(f));
  PetscCall(ElasticAlignGetLabels(f, labels));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignGetLabels(ElasticAlign f, ElasticLabels *labels)
{
  PetscFunctionBeginUser;
  *labels = (ElasticLabels){.lined      = f->aligned,
                            .cell_solid = f->label,
                            .density    = f->solid_inside ? f->density : NULL};
  for (PetscInt k = 0; k < f->s->n; k++) labels->immersed += !f->aligned[k];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignBeforeRemesh(ElasticAlign f, ElasticAlignKept **left)
{
  const PetscInt    n     = f->loc->nnode_all * f->loc->dim;
  const AlignResult fluid = fluid_of(f);
  ElasticAlignKept *kept;
  PetscReal        *u[2];

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&kept));
  PetscCall(AlignKeptCreate(f->loc, f->done ? &fluid : NULL, &kept->mesh));
  PetscCall(FlowGetFields(f->flow, &u[0], &u[1], NULL));
  for (PetscInt k = 0; k < 2; k++) {
    PetscCall(PetscMalloc1(n, &kept->mesh.field[k]));
    PetscCall(PetscArraycpy(kept->mesh.field[k], u[k], n));
  }
  PetscCall(PetscMalloc2(f->s->n, &kept->aligned, f->s->n, &kept->waits));
  PetscCall(PetscArraycpy(kept->aligned, f->aligned, f->s->n));
  PetscCall(PetscArraycpy(kept->waits, f->waits, f->s->n));
  kept->done = f->done;
  *left      = kept;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignAfterRemesh(ElasticAlign f, ElasticAlignKept **left, Mesh *old)
{
  PetscFunctionBeginUser;
  f->kept_mesh = *left;
  *left        = NULL;
  f->done      = f->kept_mesh->done;
  PetscCall(PetscArraycpy(f->aligned, f->kept_mesh->aligned, f->s->n));
  PetscCall(PetscArraycpy(f->waits, f->kept_mesh->waits, f->s->n));
  PetscCall(AlignKeptArrive(&f->kept_mesh->mesh, old, f->mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The mesh of the fields that are there */
static PetscErrorCode restore_mesh(ElasticAlign f)
{
  const AlignResult *r = &f->result;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(f->wanted, f->aligned, f->s->n));
  PetscCall(ElasticSurfacesSet(f->surfaces, f->x));
  PetscCall(AlignFit(f->align, f->wanted, NULL, f->aligned, &f->result));
  PetscCall(MeshUpdateRestore(f->mesh_update, r->ncell, r->cell,
                              &(MeshUpdateMesh){.nnode = r->nnode, .node = r->node, .x = r->x}));
  PetscCall(set_labels(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignVisitState(ElasticAlign f, State state)
{
  PetscBool has;
  PetscInt *aligned;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "elastic_done", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS); /* of a run with another method: the mesh is as at the start */
  PetscCall(StateInts(state, "elastic_done", 1, &f->done));
  PetscCall(StateReals(state, "elastic_x", f->s->nnode * f->s->dim, f->x));
  PetscCall(PetscMalloc1(f->s->n, &aligned));
  for (PetscInt k = 0; k < f->s->n; k++) aligned[k] = f->aligned[k] ? 1 : -f->waits[k];
  PetscCall(StateInts(state, "elastic_fitted", f->s->n, aligned));
  for (PetscInt k = 0; k < f->s->n; k++) {
    f->aligned[k] = (PetscBool)(aligned[k] > 0);
    f->waits[k]   = PetscMax(0, -aligned[k]);
  }
  PetscCall(PetscFree(aligned));
  if (StateIsLoading(state) && f->done) PetscCall(restore_mesh(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- whether it can be done ---- */

PetscErrorCode CoupleCanAlignSolids(PetscInt dim, Bodies bodies, Solids solids, PetscBool tracks, const char **why)
{
  SolidsState *s;
  BodyState   *rigid;
  PetscBool    still, membranes, both;

  PetscFunctionBeginUser;
  PetscCall(SolidsGetState(solids, &s));
  PetscCall(BodiesGetState(bodies, &rigid));
  PetscCall(BodiesAreStill(bodies, &still));
  membranes = SolidsHave(s, PETSC_TRUE);
  both      = (PetscBool)(membranes && SolidsHave(s, PETSC_FALSE));
  *why      = NULL;
  if (membranes && dim == 3)
    *why =
      "-couple_method aligned: in space the mesh is not lined up with membranes: use -couple_method penalty, which immerses them";
  else if (both)
    *why =
      "-couple_method aligned: the mesh is lined up with membranes or with elastic solids, not with both: use -couple_method penalty, which immerses "
      "them";
  else if (!still)
    *why =
      "-couple_method aligned: the mesh follows elastic particles, or rigid bodies that move, not both: use -couple_method penalty, which "
      "immerses elastic ones, or hold the rigid bodies (-particle_<group>_free none)";
  else if (rigid->nall && dim == 3)
    *why =
      "-couple_method aligned: in space the mesh follows elastic particles, or rigid bodies, not both: use -couple_method penalty, which immerses "
      "elastic ones";
  else if (rigid->nall && tracks)
    *why =
      "-mesh_track true: with -couple_method aligned the mesh is lined up with rigid bodies once, before elastic particles: use "
      "-couple_method penalty, or remove -mesh_track";
  PetscFunctionReturn(PETSC_SUCCESS);
}
