/* CoupleDrops, curve: where the interface is, with its images; where no mesh is lined up with it (dropregular.c) it
   moves with the flow. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "fem/edge.h"
#include "fem/element.h"

void DropsNearest(const PhaseInterface *f, const MeshLocal *l, const PetscReal x[], PetscReal reach, PhasePoint *p)
{
  const PetscReal at[3] = {x[0], x[1], l->dim == 3 ? x[2] : 0};

  *p = (PhasePoint){.d = reach, .edge = -1};
  for (DomainImages i = {0}; MeshNextImage(l, at, PETSC_MAX_REAL / 4, &i);) {
    PhasePoint q;

    PhaseInterfaceClosest(f, i.at, PetscAbsReal(p->d), &q);
    if (q.edge < 0) continue;
    *p = q;
    for (PetscInt a = 0; a < 3; a++) p->y[a] -= i.shift[a];
  }
}

PetscErrorCode DropsFindDeepest(const CoupleDrops *f, const MeshLocal *l, const PetscReal x[], PetscInt *number,
                                PetscReal *depth)
{
  const PetscReal place[3] = {x[0], x[1], l->dim == 3 ? x[2] : 0};

  PetscFunctionBeginUser;
  *number = -1;
  *depth  = PETSC_MAX_REAL;
  for (DomainImages i = {0}; MeshNextImage(l, place, PETSC_MAX_REAL / 4, &i);) {
    const PetscReal *middle;
    PetscInt         drop;
    PhasePoint       p = {.edge = -1};

    if (!PhaseInterfaceSize(&f->interface)) PetscCall(DropsStartNearest(f->drops, i.at, &drop, &p.d));
    else {
      PhaseInterfaceClosest(&f->interface, i.at, PETSC_MAX_REAL / 4, &p);
      if (p.edge < 0) continue;
      (void)PhaseInterfacePiece(&f->interface, p.edge, &drop, &middle);
    }
    if (p.d >= *depth) continue;
    *depth  = p.d;
    *number = drop;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* way of the first and the middle node of every edge, v [n][2][2]: a rank looks after its part of them. Collective. */
static PetscErrorCode evaluate_nodes(CoupleDrops *f, Couple c, const PetscReal way[], const PhaseCurve *curve,
                                     PetscReal v[])
{
  const MeshLocal *l = c->loc;
  PetscMPIInt      rank, nrank;
  PetscInt         begin, n;
  PetscReal       *x, *size;
  RemapCount       count;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  PetscCallMPI(MPI_Comm_size(c->comm, &nrank));
  begin = 2 * (curve->n * rank / nrank);
  n     = 2 * (curve->n * (rank + 1) / nrank) - begin;
  PetscCall(PetscMalloc2(2 * n, &x, n, &size));
  for (PetscInt i = 0; i < 2 * n; i++) {
    const PetscInt a = i % 2, node = begin + i / 2;

    x[i]        = DomainWrap(l->period[a], curve->x[node / 2][node % 2][a], l->lower[a]);
    size[i / 2] = l->h;
  }
  PetscCall(PetscArrayzero(v, 4 * curve->n));
  PetscCall(RemapEvaluateAt(f->remap, n, x, size, NULL, (RemapCells){NULL, NULL}, 1, &way, v + 2 * begin, &count));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, (PetscMPIInt)(4 * curve->n), MPIU_REAL, MPIU_SUM, c->comm));
  PetscCall(PetscFree2(x, size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsMoveCurve(CoupleDrops *f, Couple c, const PetscReal way[], PhaseCurve *now)
{
  const PhaseCurve *from = &f->interface.curve;
  PetscReal        *v; /* [n][2][2] */

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(4 * from->n, &v));
  PetscCall(evaluate_nodes(f, c, way, from, v));
  PetscCall(PhaseCurveKeep(from, NULL, now));
  for (PetscInt e = 0; e < now->n; e++)
    for (PetscInt i = 0; i < 6; i++) now->x[e][i / 2][i % 2] += i < 4 ? v[4 * e + i] : v[4 * now->next[e] + i % 2];
  PhaseCurveUpdate(now);
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsMeanVelocities(CoupleDrops *f, Couple c, const PetscReal u[])
{
  const PhaseCurve *curve = &f->interface.curve;
  PetscReal        *v;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(4 * curve->n, &v));
  PetscCall(evaluate_nodes(f, c, u, curve, v));
  for (PetscInt k = 0; k < f->s->n; k++) {
    Drop *d = f->s->drop + k;

    PetscCall(PetscArrayzero(d->velocity, 3));
    for (PetscInt e = 0; e < curve->n && d->sums.area > 0; e++) {
      const PetscReal *last = v + 4 * curve->next[e];

      for (PetscInt g = 0; g < EDGE_NGAUSS && curve->drop[e] == d->number; g++) {
        PetscReal phi[3], dphi[3], y[2], t[2], through = 0;

        ElementLine(EDGE_GAUSS[g], phi, dphi);
        EdgeEvaluate(curve->x[e], EDGE_GAUSS[g], y, t);
        for (PetscInt a = 0; a < 2; a++)
          through += (a ? -t[0] : t[1]) * (phi[0] * v[4 * e + a] + phi[1] * v[4 * e + 2 + a] + phi[2] * last[a]);
        for (PetscInt a = 0; a < 2; a++)
          d->velocity[a] += EDGE_WEIGHT[g] * through * (y[a] - d->sums.centre[a]) / d->sums.area;
      }
    }
  }
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}
