/* Bodyblocks: see bodyblocks.h. */
#include "compat.h"
#include "bodyblocks.h"
#include "base/algebra.h"

/* block: P^T A P and M_r / scale of body k, without D, which is added. Inverses of both;
   *massless: there is none */
static PetscErrorCode invert_blocks(PetscInt nr, PetscInt unknown, const PetscReal D[], PetscReal scale,
                                    PetscReal block[], PetscReal stiff_inverse[], PetscReal mass_inverse[],
                                    PetscBool *massless)
{
  const PetscInt nn       = nr * nr;
  PetscBool      positive = PETSC_TRUE;

  PetscFunctionBeginUser;
  for (PetscInt s = 0; s < 2; s++) {
    PetscReal *M = block + s * nn, fraction = 1;

    /* the excess mass of a light body may exceed the discrete one of its nodes: added mass is not in the block */
    for (PetscInt a = 0; a < nr; a++)
      if ((unknown >> a) & 1 && -D[a * (nr + 1)] > 0)
        fraction = PetscMin(fraction, 0.9 * M[a * (nr + 1)] * (s ? scale : 1) / -D[a * (nr + 1)]);
    for (PetscInt e = 0; e < nn; e++) {
      const PetscBool active = (PetscBool)((unknown >> (e / nr)) & 1 && (unknown >> (e % nr)) & 1);

      M[e] = active ? M[e] + fraction * D[e] / (s ? scale : 1) : (PetscReal)(e / nr == e % nr);
    }
    for (PetscInt a = 0; a < nr; a++) {
      if (M[a * (nr + 1)] > 0) continue;
      positive  = PETSC_FALSE;
      *massless = (PetscBool)(*massless || s);
    }
  }
  /* convection in long steps outweighs the mass: the mass alone */
  if (*massless) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < nn && !positive; e++) block[e] = scale * block[nn + e];
  DenseInvert(nr, block, stiff_inverse);
  DenseInvert(nr, block + nn, mass_inverse);
  for (PetscInt a = 0; a < nr; a++)
    if (!((unknown >> a) & 1)) mass_inverse[a * (nr + 1)] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of own bodies, block [nown][2][nr][nr] */
static PetscErrorCode invert_own(Constraint constraint, const PetscReal D[], PetscReal scale, PetscReal block[],
                                 PetscReal stiff_inverse[], PetscReal mass_inverse[])
{
  const ConstraintView *c     = ConstraintGetView(constraint);
  const PetscInt        nn    = c->nr * c->nr;
  PetscInt              worst = -1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nown; i++) {
    const PetscInt k        = c->own[i];
    PetscBool      massless = PETSC_FALSE;

    PetscCall(invert_blocks(c->nr, c->unknown[k], D + k * nn, scale, block + 2 * i * nn, stiff_inverse + i * nn,
                            mass_inverse + i * nn, &massless));
    if (massless) worst = PetscMax(worst, k);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &worst, 1, MPIU_INT, MPI_MAX, c->comm));
  PetscCheck(worst < 0, c->comm, PETSC_ERR_USER_INPUT,
             "Body %" PetscInt_FMT
             " covers no node of the mesh and is lighter than the fluid: refine the mesh (-mesh_cells)",
             worst);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyBlocksInvert(Flow flow, Constraint constraint, const PetscReal fraction[], const PetscReal stiff[],
                                const PenaltyTerm *penalty, const PetscReal D[], PetscReal scale,
                                PetscReal stiff_inverse[], PetscReal mass_inverse[])
{
  const ConstraintView *c  = ConstraintGetView(constraint);
  const PetscInt        nr = c->nr, dim = c->loc->dim, nn = nr * nr;
  const PetscReal      *m;
  PetscReal            *block, *own, *own_inverse;

  PetscFunctionBeginUser;
  PetscCall(FlowGetInertialMass(flow, &m));
  PetscCall(PetscCalloc3(2 * c->nbodies * nn, &block, 2 * c->nown * nn, &own, c->nown * nn, &own_inverse));
  for (PetscInt e = 0; e < c->nbodies * nn; e++) block[2 * nn * (e / nn) + e % nn] = stiff[e];
  for (PetscInt j = 0; j < c->nbody_nodes; j++) {
    const PetscInt i = c->body_node[j], k = ConstraintGetMover(c, i);
    PetscReal      R[18], *mass;

    if (i >= c->loc->nnode || k < 0 || !ConstraintHasUnknown(c, k)) continue;
    mass = block + (2 * k + 1) * nn;
    PetscCall(ConstraintRigidMap(constraint, i, k, R));
    for (PetscInt e = 0; e < nn; e++)
      for (PetscInt a = 0; a < dim; a++) mass[e] += fraction[i] * m[i] * R[a * nr + e / nr] * R[a * nr + e % nr];
  }
  PetscCall(ConstraintSumRows(constraint, 2 * nn, block, own));
  for (PetscInt e = 0; penalty && e < c->nown * nn; e++) own[2 * nn * (e / nn) + e % nn] += penalty->whole[e];
  PetscCall(invert_own(constraint, D, scale, own, stiff_inverse, own_inverse));
  PetscCall(ConstraintCopyRows(constraint, nn, own_inverse, mass_inverse));
  PetscCall(PetscFree3(block, own, own_inverse));
  PetscFunctionReturn(PETSC_SUCCESS);
}
