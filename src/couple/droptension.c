/* CoupleDrops, tension: the surface tension on the edges between phases (drops.h), and what a step ends with. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "fem/edge.h"
#include "fem/element.h"
#include "fem/gauss.h"

/* u* at node i: the velocity that the prediction used */
static inline PetscReal extrapolated(const FlowStep *s, const PetscReal u[], const PetscReal u_old[], PetscInt i)
{
  return s->order == 1 || s->dt_old <= 0 ? u[i] : u[i] + s->dt / s->dt_old * (u[i] - u_old[i]);
}

/* K [3][3] = sigma int dphi_i/ds dphi_j/ds ds over an edge with nodes x */
static void edge_matrix(PetscReal sigma, PetscReal x[3][2], PetscReal K[3][3])
{
  for (PetscInt i = 0; i < 9; i++) K[i / 3][i % 3] = 0;
  for (PetscInt g = 0; g < EDGE_NGAUSS; g++) {
    PetscReal v[3], dv[3], t[2] = {0, 0};

    ElementLine(EDGE_GAUSS[g], v, dv);
    for (PetscInt j = 0; j < 3; j++)
      for (PetscInt a = 0; a < 2; a++) t[a] += dv[j] * x[j][a];
    for (PetscInt i = 0; i < 9; i++)
      K[i / 3][i % 3] += sigma * EDGE_WEIGHT[g] * dv[i / 3] * dv[i % 3] / PetscHypotReal(t[0], t[1]);
  }
}

/* Matrix [9][9] of a further cell, zero */
static PetscErrorCode add_term(CoupleDrops *f, PetscInt cell, PetscReal **M)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(f->nterm + 1, &f->term_capacity, &f->term_cell, sizeof(*f->term_cell), &f->term,
                         81 * sizeof(*f->term), NULL));
  *M = f->term + 81 * f->nterm;
  PetscCall(PetscArrayzero(*M, 81));
  f->term_cell[f->nterm++] = cell;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of local cell of a drop, sides next to the fluid around: matrix [9][9] (NULL: not needed so far), and the force of
   own cells */
static PetscErrorCode add_tension(CoupleDrops *f, Couple c, PetscInt cell, const PetscReal xc[], const PetscReal u[],
                                  const PetscReal u_old[], PetscReal **term)
{
  const MeshLocal *l     = c->loc;
  const FlowStep  *s     = c->step;
  const PetscReal  theta = DropsTheta(s) * s->dt,
                  sigma  = f->s->group[f->s->drop[DropsFind(f->s, f->cell_drop[cell])].group].tension;
  const PetscInt *node   = l->cell_node + cell * l->nb;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < 4; e++) {
    const PetscInt *slot = ELEMENT_EDGE[e];
    PetscReal       x[3][2], K[3][3];

    if (!DropsIsInterface(l, f->cell_drop, node[slot[1]])) continue;
    for (PetscInt j = 0; j < 6; j++) x[j / 2][j % 2] = xc[2 * slot[j / 2] + j % 2];
    edge_matrix(sigma, x, K);
    if (!*term) PetscCall(add_term(f, cell, term));
    for (PetscInt i = 0; i < 3; i++)
      for (PetscInt j = 0; j < 3; j++) {
        (*term)[9 * slot[i] + slot[j]] += theta * K[i][j];
        for (PetscInt a = 0; a < 2 && cell < l->ncell; a++)
          f->force[2 * node[slot[i]] + a] -= K[i][j] *
                                             (x[j][a] - theta * extrapolated(s, u, u_old, 2 * node[slot[j]] + a));
      }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_cell(CoupleDrops *f, Couple c, PetscInt cell, const PetscReal u[], const PetscReal u_old[])
{
  const PetscBool friction = (PetscBool)(f->side && DropsHasFriction(f, c->loc, cell));
  PetscReal       xc[18], *M = NULL;

  PetscFunctionBeginUser;
  if (f->cell_drop[cell] < 0 && !friction) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DropsCellCoordinates(f, c, cell, NULL, xc));
  if (friction) PetscCall(add_term(f, cell, &M));
  if (f->cell_drop[cell] >= 0) PetscCall(add_tension(f, c, cell, xc, u, u_old, &M));
  if (friction) DropsAddFriction(f, c->loc, cell, xc, M);
  if (f->side && f->cell_drop[cell] >= 0 && cell < c->loc->ncell) DropsAddPull(f, c->loc, cell);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAssemble(CoupleDrops *f, Couple c)
{
  PetscReal *u, *u_old;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u, &u_old, NULL));
  PetscCall(PetscArrayzero(f->force, 2 * c->loc->nnode_all));
  f->nterm = 0;
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) PetscCall(add_cell(f, c, e, u, u_old));
  PetscCall(FlowAddCellTerms(c->flow, f, f->nterm, f->term_cell, f->term));
  PetscCall(FlowAddForce(c->flow, f, f->force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the end of a step ---- */

/* sum [n][3]: volume, and integral of the velocity */
static PetscErrorCode integrate_velocity(CoupleDrops *f, Couple c, const PetscReal u[], PetscReal sum[])
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell; e++) {
    const PetscInt k = DropsFind(f->s, f->cell_drop[e]);
    PetscReal      xc[18];

    if (k < 0) continue;
    PetscCall(MeshCellCoordinates(c->mesh, e, xc));
    for (PetscInt q = 0; q < 9; q++) {
      const PetscReal xi[2] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3]};
      PetscReal       phi[9], dphi[18], x[2], J[4], w;

      ElementBasis(2, xi, phi, dphi);
      ElementMap(2, xc, xi, x, J);
      w = GAUSS3_WEIGHT[q % 3] * GAUSS3_WEIGHT[q / 3] * DenseDeterminant(2, J);
      sum[3 * k] += w;
      for (PetscInt j = 0; j < 18; j++)
        sum[3 * k + 1 + j % 2] += w * phi[j / 2] * u[2 * l->cell_node[9 * e + j / 2] + j % 2];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, (PetscMPIInt)(3 * f->s->n), MPIU_REAL, MPIU_SUM, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAccept(CoupleDrops *f, Couple c, const PetscReal u[])
{
  const FlowStep *s     = c->step;
  const PetscReal theta = DropsTheta(s) * s->dt;
  PetscReal      *now, *old, *sum;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &now, &old, NULL));
  for (PetscInt i = 0; i < 2 * c->loc->nnode_all; i++) f->corr[i] = theta * (u[i] - extrapolated(s, now, old, i));
  PetscCall(PhaseCurveDestroy(&f->s->curve));
  PetscCall(DropsGatherCurve(f, c, f->cell_drop, f->corr, &f->s->curve));
  PetscCall(DropsKeepVolumes(f, c, &f->s->curve, &f->s->shift));
  PetscCall(PetscCalloc1(3 * f->s->n, &sum));
  PetscCall(integrate_velocity(f, c, u, sum));
  for (PetscInt k = 0; k < f->s->n; k++) {
    Drop *d = f->s->drop + k;

    PhaseCurveMeasure(&f->s->curve, d->number, &d->sums);
    for (PetscInt a = 0; a < 2; a++) d->velocity[a] = sum[3 * k] > 0 ? sum[3 * k + 1 + a] / sum[3 * k] : 0;
    for (PetscInt a = 0; a < 2; a++) d->flux[a] = sum[3 * k + 1 + a];
  }
  f->first_order = (PetscBool)(s->order == 1);
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}
