/* Ale: see ale.h. */
#include "compat.h"
#include "ale.h"
#include "impl.h"
#include "bodies/local.h"
#include "couple/bodysurfaces.h"

#define MAX_SUBSTEPS 100 /* parts of a way at most */

struct _p_Ale {
  Flow             flow;
  MeshUpdate       mesh_update;
  Mesh             mesh;
  const MeshLocal *loc;
  Deform           deform;
  BodySurfaces     surfaces; /* the deform's */
  Bodies           bodies;
  BodyState       *s;
  PetscReal (*X)[3], (*q)[4];           /* [known bodies] where the bodies were drawn for the mesh at the time n, */
  PetscReal (*X_next)[3], (*q_next)[4]; /* for the present mesh, */
  PetscReal (*X_between)[3], (*q_between)[4]; /* and on the way */
  PetscReal   *now, *old, *velocity;          /* [nnode_all][dim] places at the last two times; velocity of the nodes */
  PetscInt    *all;                           /* [nnode_all] 0, 1, ... */
  PetscReal    h;                             /* smallest cell at the time n */
  DeformResult result;
};

/* From where body k was to X, by the shortest way in a periodic domain */
static void find_displacement(const struct _p_Ale *f, PetscInt k, PetscReal (*X)[3], PetscReal displacement[3])
{
  for (PetscInt a = 0; a < 3; a++) displacement[a] = MeshNearest(f->loc, a, X[k][a] - f->X[k][a]);
}

/* Parts of the way of all bodies, by the point that goes farthest, each about as long as the smallest cell */
static PetscErrorCode count_substeps(const struct _p_Ale *f, PetscReal (*X)[3], PetscReal (*q)[4], PetscInt *nsubsteps)
{
  PetscReal longest = 0;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < f->s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(f->s, k);
    PetscReal        displacement[3], dot = 0, turn;

    if (f->s->removed[k]) continue;
    find_displacement(f, k, X, displacement);
    for (PetscInt a = 0; a < 4; a++) dot += q[k][a] * f->q[k][a];
    turn    = g->disc > 0 ? 0 : 2 * PetscAcosReal(PetscMin(1, PetscAbsReal(dot)));
    longest = PetscMax(longest, PetscSqrtReal(displacement[0] * displacement[0] + displacement[1] * displacement[1] +
                                              displacement[2] * displacement[2]) +
                                  BodiesGetRadius(f->s, k) * turn);
  }
  PetscCall(BodiesMax(f->bodies, 1, &longest));
  *nsubsteps = PetscMax(1, PetscMin(MAX_SUBSTEPS, (PetscInt)PetscCeilReal(longest / f->h)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies at the given share of their way */
static void place_between(Ale f, PetscReal fraction, PetscReal (*X)[3], PetscReal (*q)[4])
{
  for (PetscInt k = 0; k < f->s->n; k++) {
    PetscReal displacement[3], dot = 0, size = 0;

    find_displacement(f, k, X, displacement);
    for (PetscInt a = 0; a < 3; a++) f->X_between[k][a] = X[k][a] - (1 - fraction) * displacement[a];
    for (PetscInt a = 0; a < 4; a++) dot += q[k][a] * f->q[k][a];
    for (PetscInt a = 0; a < 4; a++) {
      f->q_between[k][a] = fraction * q[k][a] + (1 - fraction) * (dot < 0 ? -1 : 1) * f->q[k][a];
      size += PetscSqr(f->q_between[k][a]);
    }
    for (PetscInt a = 0; a < 4; a++) f->q_between[k][a] /= PetscSqrtReal(size);
  }
}

/* Places and orientations of the bodies */
static PetscErrorCode copy_bodies(const struct _p_Ale *f, const PetscReal (*X)[3], const PetscReal (*q)[4],
                                  PetscReal (*X_to)[3], PetscReal (*q_to)[4])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy((PetscReal *)X_to, (const PetscReal *)X, 3 * f->s->n));
  PetscCall(PetscArraycpy((PetscReal *)q_to, (const PetscReal *)q, 4 * f->s->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AleCreate(MeshUpdate mesh_update, Flow flow, Bodies bodies, Deform deform, Ale *ale)
{
  Ale                   f;
  PetscInt              n, size;
  const DeformSurfaces *surfaces;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->flow        = flow;
  f->mesh_update = mesh_update;
  f->deform      = deform;
  f->bodies      = bodies;
  PetscCall(BodySurfacesCreate(bodies, &f->surfaces));
  PetscCall(BodySurfacesGiveDeform(f->surfaces, &surfaces));
  PetscCall(DeformSetSurfaces(deform, surfaces));
  PetscCall(FlowGetMesh(flow, &f->mesh));
  PetscCall(MeshGetLocal(f->mesh, &f->loc));
  n    = f->loc->nnode_all;
  size = n * f->loc->dim;
  PetscCall(PetscMalloc4(size, &f->now, size, &f->old, size, &f->velocity, n, &f->all));
  PetscCall(PetscArraycpy(f->now, f->loc->x, size));
  PetscCall(PetscArraycpy(f->old, f->loc->x, size));
  PetscCall(BodiesGetState(bodies, &f->s));
  PetscCall(BodiesAttach(bodies, sizeof(*f->X), (void **)&f->X));
  PetscCall(BodiesAttach(bodies, sizeof(*f->q), (void **)&f->q));
  PetscCall(BodiesAttach(bodies, sizeof(*f->X_next), (void **)&f->X_next));
  PetscCall(BodiesAttach(bodies, sizeof(*f->q_next), (void **)&f->q_next));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->X_between), (void **)&f->X_between));
  PetscCall(BodiesAttachWork(bodies, sizeof(*f->q_between), (void **)&f->q_between));
  PetscCall(copy_bodies(f, f->s->x, f->s->q, f->X, f->q));
  PetscCall(copy_bodies(f, f->s->x, f->s->q, f->X_next, f->q_next));
  for (PetscInt i = 0; i < n; i++) f->all[i] = i;
  f->h      = f->loc->h;
  f->result = (DeformResult){{1, 1}, 1, 0};
  *ale      = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AleDestroy(Ale *ale)
{
  Ale f = *ale;

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4(f->now, f->old, f->velocity, f->all));
  PetscCall(BodiesDetach(f->bodies, (void **)&f->X));
  PetscCall(BodiesDetach(f->bodies, (void **)&f->q));
  PetscCall(BodiesDetach(f->bodies, (void **)&f->X_next));
  PetscCall(BodiesDetach(f->bodies, (void **)&f->q_next));
  PetscCall(BodiesDetach(f->bodies, (void **)&f->X_between));
  PetscCall(BodiesDetach(f->bodies, (void **)&f->q_between));
  PetscCall(PetscFree(*ale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AleUpdate(Ale f, PetscReal (*X)[3], PetscReal (*q)[4])
{
  const MeshLocal *l = f->loc;
  const FlowStep  *s;
  PetscInt         nsubsteps = 1;

  PetscFunctionBeginUser;
  if (X) {
    PetscCall(MeshUpdateBegin(f->mesh_update, l->ncell_all, f->all, NULL)); /* a mesh has more nodes than cells */
    PetscCall(MeshMoveNodes(f->mesh, l->nnode_all, f->all, f->now));
    PetscCall(count_substeps(f, X, q, &nsubsteps));
    for (PetscInt i = 1; i <= nsubsteps; i++) {
      place_between(f, (PetscReal)i / nsubsteps, X, q);
      PetscCall(BodySurfacesSet(f->surfaces, f->X_between, f->q_between));
      PetscCall(DeformUpdate(f->deform, &f->result));
    }
    PetscCall(copy_bodies(f, X, q, f->X_next, f->q_next));
    PetscCall(MeshUpdateCommit(f->mesh_update, &(MeshUpdateMesh){.whole = PETSC_TRUE}));
  }
  PetscCall(FlowGetStep(f->flow, &s));
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++)
    f->velocity[i] = s->ct * l->x[i] - s->d0 * f->now[i] - s->d1 * f->old[i];
  PetscCall(FlowSetMeshVelocity(f->flow, f->velocity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AleAccept(Ale f)
{
  const PetscInt size = f->loc->nnode_all * f->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(f->old, f->now, size));
  PetscCall(PetscArraycpy(f->now, f->loc->x, size));
  PetscCall(copy_bodies(f, f->X_next, f->q_next, f->X, f->q));
  f->h = f->loc->h;
  PetscCall(DeformLook(f->deform));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AleGetResult(Ale f, const DeformResult **result)
{
  PetscFunctionBeginUser;
  *result = &f->result;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The mesh of the fields that are there, whose pressures already belong to it */
static PetscErrorCode restore_mesh(Ale f)
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(
    MeshUpdateRestore(f->mesh_update, l->ncell_all, f->all,
                      &(MeshUpdateMesh){.nnode = l->nnode_all, .node = f->all, .x = f->now, .whole = PETSC_TRUE}));
  f->h = l->h;
  PetscCall(DeformLook(f->deform));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Visited after the state of the flow. Loading moves the mesh to where it was; the flow's solver must then be made
   anew. */
static PetscErrorCode visit_state(Ale f, State state)
{
  BodyRows rows;

  PetscFunctionBeginUser;
  PetscCall(StateNodes(state, "place", f->loc->dim, f->now));
  PetscCall(StateNodes(state, "place_old", f->loc->dim, f->old));
  PetscCall(BodiesBeginRows(f->bodies, &rows));
  PetscCall(BodiesVisitReals(f->bodies, &rows, state, "follow_X", 3, (PetscReal *)f->X));
  PetscCall(BodiesVisitReals(f->bodies, &rows, state, "follow_q", 4, (PetscReal *)f->q));
  PetscCall(BodiesEndRows(&rows));
  if (!StateIsLoading(state)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(copy_bodies(f, f->X, f->q, f->X_next, f->q_next));
  PetscCall(restore_mesh(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- as a participant: nothing until CoupleSetDeform ---- */

static PetscErrorCode update_mesh(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  if (c->ale) PetscCall(AleUpdate(c->ale, c->method.current ? NULL : c->rigid.X, c->rigid.q));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode accept_mesh(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  if (c->ale) PetscCall(AleAccept(c->ale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode discard(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)data;
  PetscCall(AleDestroy(&c->ale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  PetscFunctionBeginUser;
  (void)data;
  if (!c->ale) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(visit_state(c->ale, state));
  PetscCall(CoupleNeedsSolver(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Couple c, void *data, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  (void)data;
  if (c->ale)
    PetscCall(
      PetscViewerASCIIPrintf(viewer,
                             "  the mesh follows the bodies (-mesh_deform), its velocity is part of the convection\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant ALE =
  {.name = "ale", .prepare = update_mesh, .advance = accept_mesh, .discard = discard, .visit = visit, .view = view};

PetscErrorCode CoupleAddAle(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleAddParticipant(c, &ALE, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSetDeform(Couple c, Deform deform)
{
  char others[256] = "";

  PetscFunctionBeginUser;
  for (PetscInt i = 0; methods[i]; i++) {
    if (methods[i]->moves_nodes) continue;
    if (others[0]) PetscCall(PetscStrlcat(others, " or ", sizeof(others)));
    PetscCall(PetscStrlcat(others, methods[i]->name, sizeof(others)));
  }
  PetscCheck(!c->method.table->moves_nodes, c->comm, PETSC_ERR_SUP,
             "-couple_method %s moves the nodes around bodies itself, and -mesh_deform would have to follow bodies that move with the same nodes: use "
             "-couple_method %s, or remove -mesh_deform",
             c->method.table->name, others);
  PetscCall(AleCreate(c->mesh_update, c->flow, c->bodies, deform, &c->ale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetDeform(Couple c, const DeformResult **result)
{
  PetscFunctionBeginUser;
  *result = NULL;
  if (c->ale) PetscCall(AleGetResult(c->ale, result));
  PetscFunctionReturn(PETSC_SUCCESS);
}
