/* Bodyblocks: see bodyblocks.h. */
#include "compat.h"
#include "bodyblocks.h"
#include "base/algebra.h"

struct _p_BodyBlocks {
  Flow             flow;
  Constraint       constraint;
  const MeshLocal *loc;
  PetscInt         nr, *ghost_of_column; /* off-diagonal columns of S -> local nodes */
};

static PetscErrorCode map_ghost_columns(BodyBlocks b)
{
  const MeshLocal *l = b->loc;
  const PetscInt  *garray;
  PetscInt         n, nghost = l->nnode_all - l->nnode, *sorted, *where;
  Mat              part[2];

  PetscFunctionBeginUser;
  if (b->ghost_of_column) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetMatrixParts(b->flow, part, &garray));
  if (!part[1]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatGetLocalSize(part[1], NULL, &n));
  PetscCall(PetscMalloc1(n, &b->ghost_of_column));
  PetscCall(PetscMalloc2(nghost, &sorted, nghost, &where));
  for (PetscInt i = 0; i < nghost; i++) {
    sorted[i] = l->node_global[l->nnode + i];
    where[i]  = l->nnode + i;
  }
  PetscCall(PetscSortIntWithArray(nghost, sorted, where));
  for (PetscInt j = 0; j < n; j++) {
    PetscInt at;

    PetscCall(PetscFindInt(garray[j], nghost, sorted, &at));
    PetscCheck(at >= 0, PETSC_COMM_SELF, PETSC_ERR_PLIB, "Node %" PetscInt_FMT " is coupled to own nodes but is no ghost node", garray[j]);
    b->ghost_of_column[j] = where[at];
  }
  PetscCall(PetscFree2(sorted, where));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* block: P^T A P and M_r / scale of body k, without D, which is added. Inverses of both;
   *massless: there is none */
static PetscErrorCode invert_blocks(PetscInt nr, PetscInt unknown, const PetscReal D[], PetscReal scale, PetscReal block[], PetscReal stiff_inverse[],
                                    PetscReal mass_inverse[], PetscBool *massless)
{
  const PetscInt nn       = nr * nr;
  PetscBool      positive = PETSC_TRUE;

  PetscFunctionBeginUser;
  for (PetscInt s = 0; s < 2; s++) {
    PetscReal *M = block + s * nn, share = 1;

    /* the excess mass of a light body may exceed the discrete one of its nodes: added mass is not in the block */
    for (PetscInt a = 0; a < nr; a++)
      if ((unknown >> a) & 1 && -D[a * (nr + 1)] > 0) share = PetscMin(share, 0.9 * M[a * (nr + 1)] * (s ? scale : 1) / -D[a * (nr + 1)]);
    for (PetscInt e = 0; e < nn; e++) {
      const PetscBool active = (PetscBool)((unknown >> (e / nr)) & 1 && (unknown >> (e % nr)) & 1);

      M[e] = active ? M[e] + share * D[e] / (s ? scale : 1) : (PetscReal)(e / nr == e % nr);
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
static PetscErrorCode invert_own(BodyBlocks b, const PetscReal D[], PetscReal scale, PetscReal block[], PetscReal stiff_inverse[],
                                 PetscReal mass_inverse[])
{
  const struct _p_Constraint *c     = b->constraint;
  const PetscInt              nn    = b->nr * b->nr;
  PetscInt                    worst = -1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->nown; i++) {
    const PetscInt k        = c->own[i];
    PetscBool      massless = PETSC_FALSE;

    PetscCall(invert_blocks(b->nr, c->unknown[k], D + k * nn, scale, block + 2 * i * nn, stiff_inverse + i * nn, mass_inverse + i * nn, &massless));
    if (massless) worst = PetscMax(worst, k);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &worst, 1, MPIU_INT, MPI_MAX, PETSC_COMM_WORLD));
  PetscCheck(worst < 0, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Body %" PetscInt_FMT " covers no node of the mesh and is lighter than the fluid: refine the mesh (-mesh_cells)", worst);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sum over the entries of the penalty: block of body k -= R^T G + G^T R (of nodes that follow it). With the whole H it
   is what the penalty adds to the diagonal block of a body. */
static PetscErrorCode subtract_soft_blocks(BodyBlocks b, const PenaltyTerm *s, PetscReal block[])
{
  const struct _p_Constraint *c  = b->constraint;
  const PetscInt              nr = b->nr, nn = nr * nr;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->n; e++) {
    const PetscInt i = s->node[e], k = s->body[e];
    PetscReal      G[18], R[18];

    if (!c->unknown[k] || c->node_body[i] >= 0 || c->follow[i] != k) continue;
    PenaltyTermGetBlock(s, e, G);
    PetscCall(ConstraintRigidMap(b->constraint, i, k, R));
    for (PetscInt m = 0; m < nn; m++)
      for (PetscInt a = 0; a < b->loc->dim; a++)
        block[2 * k * nn + m] -= R[a * nr + m / nr] * G[a * nr + m % nr] + G[a * nr + m / nr] * R[a * nr + m % nr];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* moment [1 + dim] += value times (1, x_j - x_i) */
static inline void add_moment(const MeshLocal *l, PetscInt i, PetscInt j, PetscReal value, PetscReal moment[])
{
  moment[0] += value;
  for (PetscInt d = 0; d < l->dim; d++) { moment[1 + d] += value * MeshNearest(l, d, l->x[j * l->dim + d] - l->x[i * l->dim + d]); }
}

/* AR [dim][nr] = sum_j a_ij R_j from the moments of row i: R_j = R_i + spin (x_j - x_i) */
static void multiply_map(PetscInt dim, PetscInt nr, const PetscReal Ri[], const PetscReal moment[], PetscReal AR[])
{
  const PetscReal *r = moment + 1;

  for (PetscInt e = 0; e < dim * nr; e++) AR[e] = moment[0] * Ri[e];
  if (dim == 2) {
    AR[2] -= r[1];
    AR[5] += r[0];
  } else {
    for (PetscInt a = 0; a < 3; a++) {
      const PetscInt b = (a + 1) % 3, c = (a + 2) % 3;

      AR[a * nr + 3 + b] += r[c];
      AR[a * nr + 3 + c] -= r[b];
    }
  }
}

PetscErrorCode BodyBlocksUpdate(BodyBlocks b, const PetscReal share[], const PenaltyTerm *soft, const PetscReal D[], PetscReal scale,
                                PetscReal stiff_inverse[], PetscReal mass_inverse[])
{
  const struct _p_Constraint *c  = b->constraint;
  const MeshLocal            *l  = b->loc;
  const PetscInt              nr = b->nr, dim = l->dim, nn = nr * nr;
  const PetscInt             *row_start[2] = {NULL, NULL}, *column[2] = {NULL, NULL}, *map;
  const PetscReal            *value[2] = {NULL, NULL}, *m;
  PetscReal                  *block, *own, *own_inverse;
  PetscInt                    n;
  Mat                         S, part[2];
  PetscBool                   done;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(b->flow, &m));
  PetscCall(PetscCalloc3(2 * c->nbodies * nn, &block, 2 * c->nown * nn, &own, c->nown * nn, &own_inverse));
  PetscCall(FlowGetMatrix(b->flow, &S));
  PetscCall(map_ghost_columns(b));
  PetscCall(FlowGetMatrixParts(b->flow, part, &map));
  for (PetscInt s = 0; s < 2 && part[s]; s++) {
    PetscCall(MatGetRowIJ(part[s], 0, PETSC_FALSE, PETSC_FALSE, &n, &row_start[s], &column[s], &done));
    PetscCall(MatSeqAIJGetArrayRead(part[s], &value[s]));
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt k = c->node_body[i] >= 0 ? c->node_body[i] : c->follow[i];
    PetscReal      Ri[18], AR[18], moment[4] = {0}, *stiff, *mass;

    if (k < 0 || !c->unknown[k]) continue;
    stiff = block + 2 * k * nn;
    mass  = stiff + nn;
    PetscCall(ConstraintRigidMap(b->constraint, i, k, Ri));
    for (PetscInt s = 0; s < 2 && part[s]; s++) {
      for (PetscInt q = row_start[s][i]; q < row_start[s][i + 1]; q++) {
        const PetscInt j = s ? b->ghost_of_column[column[s][q]] : column[s][q];

        if ((c->node_body[j] >= 0 ? c->node_body[j] : c->follow[j]) == k) add_moment(l, i, j, value[s][q], moment);
      }
    }
    multiply_map(dim, nr, Ri, moment, AR);
    for (PetscInt e = 0; e < nn; e++) {
      for (PetscInt a = 0; a < dim; a++) {
        stiff[e] += Ri[a * nr + e / nr] * AR[a * nr + e % nr];
        mass[e] += share[i] * m[i] * Ri[a * nr + e / nr] * Ri[a * nr + e % nr];
      }
    }
  }
  for (PetscInt s = 0; s < 2 && part[s]; s++) {
    PetscCall(MatSeqAIJRestoreArrayRead(part[s], &value[s]));
    PetscCall(MatRestoreRowIJ(part[s], 0, PETSC_FALSE, PETSC_FALSE, &n, &row_start[s], &column[s], &done));
  }
  if (soft) PetscCall(subtract_soft_blocks(b, soft, block));
  PetscCall(ConstraintSumRows(b->constraint, 2 * nn, block, own));
  for (PetscInt e = 0; soft && e < c->nown * nn; e++) own[2 * nn * (e / nn) + e % nn] += soft->whole[e];
  PetscCall(invert_own(b, D, scale, own, stiff_inverse, own_inverse));
  PetscCall(ConstraintCopyRows(b->constraint, nn, own_inverse, mass_inverse));
  PetscCall(PetscFree3(block, own, own_inverse));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const PetscInt *BodyBlocksGetGhosts(BodyBlocks b)
{
  return b->ghost_of_column;
}

PetscErrorCode BodyBlocksCreate(Flow flow, Constraint constraint, BodyBlocks *blocks)
{
  BodyBlocks b;
  Mesh       mesh;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->flow       = flow;
  b->constraint = constraint;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &b->loc));
  b->nr   = constraint->nr;
  *blocks = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyBlocksDestroy(BodyBlocks *blocks)
{
  PetscFunctionBeginUser;
  if (!*blocks) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*blocks)->ghost_of_column));
  PetscCall(PetscFree(*blocks));
  PetscFunctionReturn(PETSC_SUCCESS);
}
