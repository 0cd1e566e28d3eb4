/* CoupleDrops, tension: the surface tension on the edges between phases (drops.h), and what a step ends with. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "fem/edge.h"
#include "fem/element.h"
#include "fem/side.h"

#define MASS     0.12 /* of the diagonal of tension: mass for the pressure */
#define MIN_EDGE 1e-3 /* of a cell: half the length of the shortest edges that tension knows */

/* u* at node i: the velocity that the prediction used */
static inline PetscReal extrapolated(const FlowStep *s, const PetscReal u[], const PetscReal u_old[], PetscInt i)
{
  return s->order == 1 || s->dt_old <= 0 ? u[i] : u[i] + s->dt / s->dt_old * (u[i] - u_old[i]);
}

/* K [3][3] = sigma int dphi_i/ds dphi_j/ds ds over an edge with nodes x, as if it were nowhere shorter than `shortest`:
   where an interface is cut short two vertices may have the same place on it */
static void edge_matrix(PetscReal sigma, PetscReal shortest, PetscReal x[3][2], PetscReal K[3][3])
{
  for (PetscInt i = 0; i < 9; i++) K[i / 3][i % 3] = 0;
  for (PetscInt g = 0; g < EDGE_NGAUSS; g++) {
    PetscReal v[3], dv[3], t[2] = {0, 0};

    ElementLine(EDGE_GAUSS[g], v, dv);
    for (PetscInt j = 0; j < 3; j++)
      for (PetscInt a = 0; a < 2; a++) t[a] += dv[j] * x[j][a];
    for (PetscInt i = 0; i < 9; i++)
      K[i / 3][i % 3] += sigma * EDGE_WEIGHT[g] * dv[i / 3] * dv[i % 3] /
                         PetscMax(shortest, PetscHypotReal(t[0], t[1]));
  }
}

/* Matrix [nb][nb] of a further cell, zero */
static PetscErrorCode add_term(CoupleDrops *f, PetscInt nb, PetscInt cell, PetscReal **M)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(f->nterm + 1, &f->term_capacity, &f->term_cell, sizeof(*f->term_cell), &f->term,
                         nb * nb * sizeof(*f->term), NULL));
  *M = f->term + nb * nb * f->nterm;
  PetscCall(PetscArrayzero(*M, nb * nb));
  f->term_cell[f->nterm++] = cell;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* K [n][n] of a side of a cell, an edge in the plane, at these slots [n], with nodes xc of the cell */
static void side_matrix(const MeshLocal *l, PetscReal sigma, PetscInt n, const PetscInt slot[], const PetscReal xc[],
                        PetscReal K[])
{
  PetscReal x[27];

  for (PetscInt j = 0; j < n * l->dim; j++) x[j] = xc[l->dim * slot[j / l->dim] + j % l->dim];
  if (l->dim == 2) edge_matrix(sigma, MIN_EDGE * l->h, (PetscReal(*)[2])x, (PetscReal(*)[3])K);
  else DropsFaceMatrix(sigma, (PetscReal(*)[3])x, (PetscReal(*)[9])K);
}

/* K [n][n], the tension in it, of slots [n] of a local cell with nodes xc, into its matrix term [nb][nb]; and the force
   of own cells */
static void add_matrix(CoupleDrops *f, Couple c, PetscInt cell, const PetscReal xc[], PetscInt n, const PetscInt slot[],
                       const PetscReal K[], const PetscReal u[], const PetscReal u_old[], PetscReal term[])
{
  const MeshLocal *l     = c->loc;
  const FlowStep  *s     = c->step;
  const PetscReal  theta = DropsTheta(s) * s->dt;
  const PetscInt  *node = l->cell_node + cell * l->nb, dim = l->dim;

  for (PetscInt i = 0; i < n; i++)
    for (PetscInt j = 0; j < n; j++) {
      term[l->nb * slot[i] + slot[j]] += theta * K[n * i + j];
      for (PetscInt a = 0; a < dim && cell < l->ncell; a++)
        f->force[dim * node[slot[i]] + a] -= K[n * i + j] *
                                             (xc[dim * slot[j] + a] -
                                              theta * extrapolated(s, u, u_old, dim * node[slot[j]] + a));
    }
}

static PetscReal tension_of(const CoupleDrops *f, PetscInt cell)
{
  return f->s->group[f->s->drop[DropsFind(f->s, f->cell_drop[cell])].group].tension;
}

/* Of local cell of a drop, sides next to the fluid around: matrix [nb][nb] (NULL: not needed so far), and the force of
   own cells */
static PetscErrorCode add_tension(CoupleDrops *f, Couple c, PetscInt cell, const PetscReal xc[], const PetscReal u[],
                                  const PetscReal u_old[], PetscReal **term)
{
  const MeshLocal *l     = c->loc;
  const PetscReal  sigma = tension_of(f, cell);
  const PetscInt  *node = l->cell_node + cell * l->nb, dim = l->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < 2 * dim; e++) {
    PetscInt       slot[SIDE_MAX];
    const PetscInt n = DropsSideSlots(dim, e, slot);
    PetscReal      K[81];

    if (!DropsIsInterface(l, f->cell_drop, node[slot[n / 2]])) continue;
    side_matrix(l, sigma, n, slot, xc, K);
    if (!*term) PetscCall(add_term(f, l->nb, cell, term));
    add_matrix(f, c, cell, xc, n, slot, K, u, u_old, *term);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The regularised form: of every cell near the interface */
static PetscErrorCode add_bands(CoupleDrops *f, Couple c, const PetscReal u[], const PetscReal u_old[])
{
  const PetscInt nb = c->loc->nb;
  PetscInt       slot[MESH_MAX_NB];

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < nb; j++) slot[j] = j;
  for (PetscInt b = 0; b < f->nband; b++) {
    const PetscInt  cell  = f->band_cell[b];
    const PetscReal sigma = tension_of(f, cell);
    PetscReal       xc[3 * MESH_MAX_NB], K[81], *term;

    PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
    for (PetscInt i = 0; i < nb * nb; i++) K[i] = sigma * f->band[nb * nb * b + i];
    PetscCall(add_term(f, nb, cell, &term));
    add_matrix(f, c, cell, xc, nb, slot, K, u, u_old, term);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_cell(CoupleDrops *f, Couple c, PetscInt cell, const PetscReal u[], const PetscReal u_old[])
{
  const PetscBool friction = (PetscBool)(f->side && DropsHasFriction(f, c->loc, cell));
  PetscReal       xc[3 * MESH_MAX_NB], *M = NULL;

  PetscFunctionBeginUser;
  if (f->cell_drop[cell] < 0 && !friction) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DropsCellCoordinates(f, c, cell, NULL, xc));
  if (friction) PetscCall(add_term(f, c->loc->nb, cell, &M));
  if (f->cell_drop[cell] >= 0) PetscCall(add_tension(f, c, cell, xc, u, u_old, &M));
  if (friction) DropsAddFriction(f, c->loc, cell, xc, M);
  if (f->side && f->cell_drop[cell] >= 0 && cell < c->loc->ncell) DropsAddPull(f, c->loc, cell, xc);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Tension and friction are a mass on nodes that the pressure has to move with: of their diagonal a part counts as such
   (runs/studies/drops-space, "Cost"; in the plane runs/studies/drops, "Iterations") */
static PetscErrorCode count_terms(CoupleDrops *f, Couple c)
{
  const PetscInt nb = c->loc->nb;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(f->weight, c->loc->nnode_all));
  for (PetscInt t = 0; t < f->nterm; t++)
    for (PetscInt j = 0; j < nb; j++)
      f->weight[c->loc->cell_node[f->term_cell[t] * nb + j]] += MASS * f->term[nb * (nb * t + j) + j];
  PetscCall(MeshSyncNodes(c->mesh, 1, f->weight)); /* own nodes see all their cells */
  PetscCall(FlowCountCellTerms(c->flow, f, f->weight));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAssemble(CoupleDrops *f, Couple c)
{
  PetscReal *u, *u_old;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u, &u_old, NULL));
  PetscCall(PetscArrayzero(f->force, c->loc->dim * c->loc->nnode_all));
  for (PetscInt side = 0; side < 6 && f->wall; side++) PetscCall(PetscArrayzero(f->wall[side].pull, 3));
  f->nterm = 0;
  for (PetscInt e = 0; e < c->loc->ncell_all && !f->regular; e++) PetscCall(add_cell(f, c, e, u, u_old));
  PetscCall(add_bands(f, c, u, u_old));
  PetscCall(FlowAddCellTerms(c->flow, f, f->nterm, f->term_cell, f->term));
  PetscCall(count_terms(f, c));
  PetscCall(FlowAddForce(c->flow, f, f->force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the end of a step ---- */

/* sum [n][4]: volume, and integral of the velocity */
static PetscErrorCode integrate_velocity(CoupleDrops *f, Couple c, const PetscReal u[], PetscReal sum[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell; e++) {
    const PetscInt k = DropsFind(f->s, f->cell_drop[e]);
    PetscReal      xc[3 * MESH_MAX_NB], v[3 * MESH_MAX_NB];

    if (k < 0) continue;
    PetscCall(MeshCellCoordinates(c->mesh, e, xc));
    MeshCellValues(l, e, dim, u, v);
    for (PetscInt q = 0; q < nb; q++) {
      PetscReal       phi[MESH_MAX_NB];
      const PetscReal w = ElementGaussPoint(dim, xc, q, phi) * (f->fraction ? f->fraction[e] : 1);

      sum[4 * k] += w;
      for (PetscInt j = 0; j < dim * nb; j++) sum[4 * k + 1 + j % dim] += w * phi[j / dim] * v[j];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, (PetscMPIInt)(4 * f->s->n), MPIU_REAL, MPIU_SUM, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsMeasure(CoupleDrops *f, Couple c, const PetscReal u[])
{
  PetscReal *sum;

  PetscFunctionBeginUser;
  PetscCall(PhaseInterfaceDestroy(&f->s->interface));
  PetscCall(DropsGather(f, c, f->cell_drop, f->corr, &f->s->interface));
  PetscCall(DropsKeepVolumes(f, c, &f->s->interface, &f->s->shift));
  PetscCall(PetscCalloc1(4 * f->s->n, &sum));
  PetscCall(integrate_velocity(f, c, u, sum));
  for (PetscInt k = 0; k < f->s->n; k++) {
    Drop *d = f->s->drop + k;

    PhaseInterfaceMeasure(&f->s->interface, d->number, &d->sums);
    d->sums.area -= d->inside;
    for (PetscInt a = 0; a < 3; a++) d->velocity[a] = sum[4 * k] > 0 ? sum[4 * k + 1 + a] / sum[4 * k] : 0;
    for (PetscInt a = 0; a < 3; a++) d->flux[a] = sum[4 * k + 1 + a];
  }
  if (f->regular) PetscCall(DropsMeanVelocities(f, c, u));
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAccept(CoupleDrops *f, Couple c, const PetscReal u[])
{
  const FlowStep *s     = c->step;
  const PetscReal theta = DropsTheta(s) * s->dt;
  PetscReal      *now, *old;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &now, &old, NULL));
  for (PetscInt i = 0; i < c->loc->dim * c->loc->nnode_all; i++)
    f->corr[i] = theta * (u[i] - extrapolated(s, now, old, i));
  PetscCall(DropsMeasure(f, c, u));
  f->first_order = (PetscBool)(s->order == 1);
  PetscFunctionReturn(PETSC_SUCCESS);
}
