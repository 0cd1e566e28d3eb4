/* ElasticAlign: see elasticalign.h. */
#include "compat.h"
#include "elasticalign.h"
#include "bodies/local.h"
#include "couple/couple.h"

/* Of a mesh that is no more */
struct _n_ElasticAlignKept {
  AlignKept *mesh;   /* NULL: the driver of rigid bodies has it */
  PetscInt  *fitted; /* [n] AlignOwnerPack */
};

struct _p_ElasticAlign {
  Flow               flow;
  const MeshLocal   *loc;
  const SolidsState *s;
  ElasticSurfaces    surfaces;
  ElasticCarry       carry; /* or NULL, with */
  void              *ctx;
  AlignDriver        driver;
  PetscBool          beside;       /* it is that of rigid bodies */
  AlignOwner         owner;        /* aligned, waits: [n] */
  PetscReal         *x;            /* [nnode][dim] of the last update */
  PetscBool         *left;         /* [n] aligned until this update */
  PetscBool          solid_inside; /* some cells are a solid's */
  PetscReal         *density;      /* [ncell_all] */
  PetscInt          *label;        /* [ncell_all] */
};

static PetscErrorCode carry_others(void *ctx, const AlignChange *change)
{
  const ElasticAlign f = (ElasticAlign)ctx;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < f->s->n; k++) f->left[k] = (PetscBool)(change->before[k] && !f->owner.aligned[k]);
  if (f->carry) PetscCall((*f->carry)(f->ctx, change->remap, change->result));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignCreate(Flow flow, MeshUpdate update, const SolidsState *s, ElasticSurfaces surfaces,
                                  AlignDriver beside, ElasticAlign *align)
{
  ElasticAlign f;
  Mesh         mesh;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->flow     = flow;
  f->s        = s;
  f->surfaces = surfaces;
  f->beside   = (PetscBool)(beside != NULL);
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &f->loc));
  PetscCall(ElasticSurfacesSet(f->surfaces, s->x));
  f->owner = (AlignOwner){.table  = ElasticSurfacesGet(f->surfaces),
                          .inside = SolidsHave(s, PETSC_TRUE) ? ALIGN_FLUID : ALIGN_MATERIAL,
                          .ctx    = f,
                          .carry  = carry_others};
  PetscCall(PetscCalloc4(s->nnode * s->dim, &f->x, s->n, &f->owner.aligned, s->n, &f->owner.waits, s->n, &f->left));
  PetscCall(PetscCalloc2(f->loc->ncell_all, &f->density, f->loc->ncell_all, &f->label));
  if (beside) f->driver = beside;
  else PetscCall(AlignDriverCreate(flow, update, &f->driver));
  PetscCall(AlignDriverAdd(f->driver, &f->owner));
  *align = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignHold(ElasticAlign f, const PetscBool held[])
{
  PetscFunctionBeginUser;
  PetscCall(AlignDriverHold(f->driver, held));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignSetCarry(ElasticAlign f, ElasticCarry carry, void *ctx)
{
  PetscFunctionBeginUser;
  f->carry = carry;
  f->ctx   = ctx;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignDestroy(ElasticAlign *align)
{
  ElasticAlign f = *align;

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  if (!f->beside) PetscCall(AlignDriverDestroy(&f->driver));
  PetscCall(PetscFree4(f->x, f->owner.aligned, f->owner.waits, f->left));
  PetscCall(PetscFree2(f->density, f->label));
  PetscCall(PetscFree(*align));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells of solids that are followed, and their density */
static PetscErrorCode set_labels(ElasticAlign f)
{
  const PetscInt        first = AlignDriverGetFirst(f->driver, &f->owner);
  const AlignResult    *r;
  const FlowParameters *par;
  PetscBool             any = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(f->flow, &par));
  PetscCall(AlignDriverGetResult(f->driver, &r, NULL));
  for (PetscInt k = 0; k < f->s->n && f->owner.inside == ALIGN_MATERIAL; k++)
    any = (PetscBool)(any || f->owner.aligned[k]);
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) {
    f->label[c]   = PetscMax(-1, r->cell_surface[c] - first);
    f->density[c] = f->label[c] >= 0 ? 0 : par->density;
  }
  f->solid_inside = any;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignPlace(ElasticAlign f, const PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(f->x, x, f->s->nnode * f->s->dim));
  PetscCall(ElasticSurfacesSet(f->surfaces, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignUpdate(ElasticAlign f, const PetscReal x[], ElasticLabels *labels)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticAlignPlace(f, x));
  if (!f->beside) PetscCall(AlignDriverUpdate(f->driver));
  PetscCall(set_labels(f));
  PetscCall(ElasticAlignGetLabels(f, labels));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignGetLabels(ElasticAlign f, ElasticLabels *labels)
{
  PetscFunctionBeginUser;
  *labels = (ElasticLabels){.lined      = f->owner.aligned,
                            .left       = f->left,
                            .cell_solid = f->label,
                            .density    = f->solid_inside ? f->density : NULL};
  for (PetscInt k = 0; k < f->s->n; k++) labels->immersed += !f->owner.aligned[k];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignBeforeRemesh(ElasticAlign f, ElasticAlignKept **left)
{
  ElasticAlignKept *kept;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&kept));
  if (!f->beside) PetscCall(AlignDriverBeforeRemesh(f->driver, &kept->mesh));
  PetscCall(PetscMalloc1(f->s->n, &kept->fitted));
  AlignOwnerPack(&f->owner, f->s->n, kept->fitted);
  *left = kept;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignAfterRemesh(ElasticAlign f, ElasticAlignKept **left, Mesh *old)
{
  ElasticAlignKept *kept = *left;

  PetscFunctionBeginUser;
  AlignOwnerUnpack(&f->owner, f->s->n, kept->fitted);
  if (kept->mesh) PetscCall(AlignDriverAfterRemesh(f->driver, &kept->mesh, old));
  PetscCall(PetscFree(kept->fitted));
  PetscCall(PetscFree(*left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_solids(ElasticAlign f, State state)
{
  PetscInt *fitted;

  PetscFunctionBeginUser;
  PetscCall(StateReals(state, "elastic_x", f->s->nnode * f->s->dim, f->x));
  PetscCall(PetscMalloc1(f->s->n, &fitted));
  AlignOwnerPack(&f->owner, f->s->n, fitted);
  PetscCall(StateInts(state, "elastic_fitted", f->s->n, fitted));
  AlignOwnerUnpack(&f->owner, f->s->n, fitted);
  PetscCall(PetscFree(fitted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticAlignVisitState(ElasticAlign f, State state)
{
  PetscBool known;

  PetscFunctionBeginUser;
  PetscCall(AlignDriverVisitState(f->driver, state, "elastic_done", &known));
  if (known) PetscCall(visit_solids(f, state));
  if (!StateIsLoading(state)) PetscFunctionReturn(PETSC_SUCCESS);
  if (AlignDriverIsDone(f->driver)) PetscCall(ElasticSurfacesSet(f->surfaces, f->x));
  PetscCall(AlignDriverRestore(f->driver));
  if (AlignDriverIsDone(f->driver)) PetscCall(set_labels(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- whether it can be done ---- */

PetscErrorCode CoupleCanAlignSolids(PetscInt dim, Bodies bodies, Solids solids, PetscBool tracks, const char **why)
{
  SolidsState *s;
  BodyState   *rigid;
  PetscBool    membranes, both, still;

  PetscFunctionBeginUser;
  PetscCall(SolidsGetState(solids, &s));
  PetscCall(BodiesGetState(bodies, &rigid));
  membranes = SolidsHave(s, PETSC_TRUE);
  both      = (PetscBool)(membranes && SolidsHave(s, PETSC_FALSE));
  PetscCall(BodiesAreStill(bodies, &still));
  *why = NULL;
  if (both)
    *why =
      "-couple_method aligned: the mesh is lined up with membranes or with elastic solids, not with both: use -couple_method penalty, which immerses "
      "them";
  else if (rigid->nall && dim == 3)
    *why =
      "-couple_method aligned: in space the mesh follows elastic particles, or rigid bodies, not both: use -couple_method penalty, which immerses "
      "elastic ones";
  else if (still && rigid->nall && tracks)
    *why =
      "-mesh_track true: with -couple_method aligned the mesh is lined up with rigid bodies once, before elastic particles: use "
      "-couple_method penalty, or remove -mesh_track";
  PetscFunctionReturn(PETSC_SUCCESS);
}
