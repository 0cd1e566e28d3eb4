/* Couple: the fluid inside bodies that begin to move freely, at the start of a run.

   The fluid inside a body counts as a part of it: the rows of the body have the inertia in excess of the fluid's. So
   it has to begin with the body's velocity, or a body as heavy as the fluid begins with that of the fluid, whatever
   velocity it was given. Node i takes

     u_i += (int_k phi_i / int phi_i) (R_k(x_i) U_k - u_i)

   of body k, the fraction of its mass that lies in the body: the momentum that comes in is that of the fluid in the
   true shape, since the sum of phi_i (R U - u)_i is R U - u in the element space.

   Not with method nodal, and a remark says so: where discs meet in the first steps, the pressure of cells that are
   rigid as a whole keeps what stopped the fluid in them, for a hundred steps, and contact answers it. */
#include "compat.h"
#include "impl.h"
#include "cutcells.h"
#include "base/log.h"

#define SAMPLES 10 /* of a cell that a surface cuts, an axis: of the penalty of bodies that move */

/* Does the fluid inside body k begin as it is? still: the flow is */
static PetscBool begins_as_fluid(Couple c, PetscInt k, PetscBool still)
{
  const BodyGroup *g = BodiesGetGroup(c->s, k);

  for (PetscInt i = 0; i < c->nr && still; i++) still = (PetscBool)(c->rigid.U[k * c->nr + i] == 0);
  return (PetscBool)(still || !g->free || g->with_fluid || c->s->removed[k]);
}

/* Place and velocities of body k as it begins, as the rows of a step have them */
static PetscErrorCode set_body(Couple c, PetscInt k)
{
  PetscReal old;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(c->rigid.X[k], c->s->x[k], 3));
  PetscCall(PetscArraycpy(c->rigid.q[k], c->s->q[k], 4));
  PetscCall(CoupleSetReferencePoint(c, k));
  for (PetscInt i = 0; i < c->nr; i++) CoupleGetHistory(c, k, i, &c->rigid.U[k * c->nr + i], &old);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u [nnode_all][dim] += that of one part of a cell at its own nodes, by before, the velocity of the fluid */
static PetscErrorCode take_part(Couple c, CutCells cells, const CutCell *cut, const PetscReal mass[],
                                const PetscReal before[], PetscReal u[])
{
  const MeshLocal *l  = c->loc;
  const PetscInt   nb = l->nb, dim = l->dim, *node = l->cell_node + cut->cell * nb;
  const PetscReal *moment;
  PetscReal        part[MESH_MAX_NB * MESH_MAX_NB], r[3] = {0, 0, 0}, v[3];

  PetscFunctionBeginUser;
  PetscCall(CutCellsGetMoments(cells, cut, &moment));
  CutCellsGetMatrix(cells, cut, moment, 1, part);
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt i        = node[j];
    PetscReal      fraction = 0;

    if (i >= l->nnode) continue;
    for (PetscInt m = 0; m < nb; m++) fraction += part[j * nb + m] / mass[i];
    for (PetscInt a = 0; a < dim; a++) r[a] = MeshNearest(l, a, l->x[i * dim + a] - cut->P[a]);
    RigidVelocityAt(dim, c->rigid.U + cut->body * c->nr, r, v);
    for (PetscInt a = 0; a < dim; a++) u[i * dim + a] += fraction * (v[a] - before[i * dim + a]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u [own nodes][dim] += what bodies make of before */
static PetscErrorCode start_bodies(Couple c, PetscBool solved, const PetscReal before[], PetscReal u[], PetscBool *any)
{
  const MeshLocal *l     = c->loc;
  PetscBool        still = PETSC_TRUE, *omit;
  CutCells         cells;
  const CutCell   *cut;
  const PetscReal *mass;
  PetscInt         n;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode * l->dim && still; i++) still = (PetscBool)(before[i] == 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &still, 1, MPIU_BOOL, MPI_LAND, c->comm));
  PetscCall(PetscMalloc1(c->s->n, &omit));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscCall(set_body(c, k));
    omit[k] = begins_as_fluid(c, k, still);
    *any    = (PetscBool)(*any || !omit[k]);
  }
  PetscCall(BodiesAny(c->bodies, any));
  if (*any && c->method.table == &method_nodal) {
    *any = PETSC_FALSE;
    if (!solved)
      PetscCall(
        LogRemark("-couple_method nodal: free bodies begin with their own velocity as far as they are heavier than the "
                  "fluid, else with the fluid's in their place: use penalty or aligned where the start matters"));
  } else if (*any) {
    PetscCall(FlowGetLumpedMass(c->flow, &mass));
    PetscCall(CutCellsCreate(c->flow, c->bodies, SAMPLES, &cells));
    PetscCall(CutCellsCut(cells, c->rigid.X, c->rigid.q, c->rigid.P, omit));
    PetscCall(CutCellsGet(cells, &n, &cut));
    for (PetscInt i = 0; i < n; i++) PetscCall(take_part(c, cells, cut + i, mass, before, u));
    PetscCall(CutCellsDestroy(&cells));
  }
  PetscCall(PetscFree(omit));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleStartInside(Couple c, PetscBool solved)
{
  const PetscInt n   = c->loc->nnode_all * c->loc->dim;
  PetscBool      any = PETSC_FALSE;
  PetscReal     *flow, *u;

  PetscFunctionBeginUser;
  if (!c->s->nall || c->method.table->moves_nodes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetFields(c->flow, &flow, NULL, NULL));
  PetscCall(PetscMalloc1(n, &u));
  PetscCall(PetscArraycpy(u, flow, n));
  PetscCall(start_bodies(c, solved, flow, u, &any));
  if (any) {
    PetscCall(MeshSyncNodes(c->mesh, c->loc->dim, u));
    PetscCall(FlowStartFrom(c->flow, u, NULL));
  }
  PetscCall(PetscFree(u));
  PetscFunctionReturn(PETSC_SUCCESS);
}
