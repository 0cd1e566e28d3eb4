/* Scalars, stabilisation of a cell: its matrices pass into those of low order as limits say (limit.c). */
#include "compat.h"
#include "impl.h"

PetscInt ScalarLimitNode(const MeshLocal *l, PetscInt c, PetscInt j)
{
  const MeshHang *h = MeshCellHang(l, c);

  for (PetscInt r = 0; h && r < h->n; r++) {
    if (h->slot[r] != j) continue;
    if (h->start[r + 1] - h->start[r] > 1) return -1;
    j = h->from[h->start[r]];
    break;
  }
  return l->cell_node[c * l->nb + j];
}

PetscReal ScalarLimitFlux(Scalars all, PetscInt i, PetscInt j, const PetscReal L[], const PetscReal M[],
                          const PetscReal x[], const PetscReal r[], PetscReal *d)
{
  const PetscInt nbp = all->element.nbp;

  *d = PetscMax(0, PetscMax(L[i * nbp + j], L[j * nbp + i]));
  return *d / all->step.theta * (x[i] - x[j]) + M[i * nbp + j] * (r[i] - r[j]);
}

void ScalarLimitValues(Scalars all, const Scalar *s, PetscInt c, const PetscReal nodal[], PetscInt node[],
                       PetscReal x[], PetscReal r[])
{
  const ScalarStep *p = &all->step;
  PetscReal         now[MESH_MAX_NB], old[MESH_MAX_NB];

  MeshCellValues(all->loc, c, 1, nodal, x);
  MeshCellValues(all->loc, c, 1, s->T, now);
  MeshCellValues(all->loc, c, 1, s->T_old, old);
  for (PetscInt j = 0; j < all->loc->nb; j++) {
    r[j]    = p->ct * x[j] - p->d0 * now[j] - p->d1 * old[j];
    node[j] = ScalarLimitNode(all->loc, c, j);
  }
}

void ScalarLimitAddMass(Scalars all, PetscReal scale, PetscReal A[], const PetscReal M[])
{
  const PetscInt nb = all->loc->nb, nbp = all->element.nbp;

  for (PetscInt i = 0; i < nb; i++)
    for (PetscInt j = 0; j < nb; j++) A[i * nbp + j] += scale * all->step.ct * M[i * nbp + j];
}

/* Off-diagonal entries i, j of a symmetric matrix lose d to the diagonal */
static void lump(PetscInt nbp, PetscInt i, PetscInt j, PetscReal d, PetscReal A[])
{
  A[i * nbp + j] -= d;
  A[j * nbp + i] -= d;
  A[i * nbp + i] += d;
  A[j * nbp + j] += d;
}

void ScalarLimitCell(Scalars all, const Scalar *s, PetscInt c, PetscReal A[], PetscReal M[])
{
  const PetscInt   nbp = all->element.nbp;
  const PetscReal *a   = s->limit.node;
  PetscInt         node[MESH_MAX_NB];
  PetscReal        x[MESH_MAX_NB], r[MESH_MAX_NB];

  ScalarLimitValues(all, s, c, s->limit.x, node, x, r);
  ScalarLimitAddMass(all, -1, A, M);
  for (PetscInt i = 0; i < all->loc->nb; i++)
    for (PetscInt j = 0; j < i; j++) {
      PetscReal       d, part = s->limit.part[c];
      const PetscReal f = ScalarLimitFlux(all, i, j, A, M, x, r, &d);

      if (node[i] >= 0 && node[j] >= 0) part *= 1 - PetscMin(a[2 * node[i] + (f < 0)], a[2 * node[j] + (f > 0)]);
      lump(nbp, i, j, part * d, A);
      lump(nbp, i, j, part * M[i * nbp + j], M);
    }
  ScalarLimitAddMass(all, 1, A, M);
}
