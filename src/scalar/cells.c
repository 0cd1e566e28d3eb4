/* Scalars, a cell: its matrix and right-hand side in a step (scalar.h). */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define BOX 1e-10 /* nodes of a box are at their positions to this part of its edges */

PetscBool ScalarCellIsActive(const Scalar *s, PetscInt c)
{
  return (PetscBool)(!s->cells.conductivity || s->cells.conductivity[c] >= 0 ||
                     (s->cells.sample && s->cells.sample[c] >= 0));
}

PetscErrorCode ScalarCellCoordinates(Scalars all, PetscInt c, PetscReal xc[])
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(all->mesh, c, xc));
  for (PetscInt j = 0; j < l->nb && all->shift; j++)
    for (PetscInt a = 0; a < l->dim; a++) xc[j * l->dim + a] += all->shift[l->cell_node[c * l->nb + j] * l->dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Edges of all cells that are boxes, where nodes are now */
static PetscErrorCode find_boxes(Scalars all)
{
  const MeshLocal *l = all->loc;

  PetscFunctionBeginUser;
  if (!all->edge) PetscCall(PetscMalloc1(l->ncell_all * 3, &all->edge));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3], *edge = all->edge + 3 * c;

    PetscCall(ScalarCellCoordinates(all, c, xc));
    if (!MeshIsBox(l->dim, l->nb, xc, BOX, edge)) edge[0] = 0;
  }
  all->moves = l->moves;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellBox(Scalars all, PetscInt c, const PetscReal *edge[])
{
  PetscFunctionBeginUser;
  if (all->moves != all->loc->moves) PetscCall(find_boxes(all));
  *edge = all->edge[3 * c] > 0 ? all->edge + 3 * c : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellMetric(Scalars all, PetscInt c, ElementMetric *m)
{
  const PetscInt   dim = all->loc->dim;
  const PetscReal *edge;
  PetscReal        xc[MESH_MAX_NB * 3], inverse[9] = {0}, det = 1;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellBox(all, c, &edge));
  if (!edge) {
    PetscCall(ScalarCellCoordinates(all, c, xc));
    ElementSetMetric(&all->element, xc, m);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt d = 0; d < dim; d++) {
    inverse[d * dim + d] = 2 / edge[d];
    det *= 0.5 * edge[d];
  }
  ElementSetAffine(&all->element, inverse, det, m);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellIntegrate(Scalars all, PetscInt c, PetscReal scale, const PetscReal v[], PetscReal r[])
{
  const PetscInt   dim = all->loc->dim, nb = all->loc->nb, nbp = all->element.nbp;
  const PetscReal *edge;
  PetscReal        y[ELEMENT_MAX_NBP] = {0};
  ElementMetric    m;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellBox(all, c, &edge));
  if (edge) {
    for (PetscInt a = 0; a < dim; a++) scale *= 0.5 * edge[a];
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt i = 0; i < nbp; i++) y[i] += all->element.mass[j * nbp + i] * v[j];
    for (PetscInt i = 0; i < nb; i++) r[i] = scale * y[i];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(ScalarCellMetric(all, c, &m));
  for (PetscInt i = 0; i < nb; i++) r[i] = 0;
  for (PetscInt q = 0; q < all->element.nq; q++) {
    const PetscReal *phi = all->element.phi + q * nbp;
    PetscReal        sum = 0;

    for (PetscInt j = 0; j < nb; j++) sum += phi[j] * v[j];
    for (PetscInt j = 0; j < nb; j++) r[j] += scale * m.weight[q] * sum * phi[j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y [nb] = M x */
static void multiply(PetscInt nb, PetscInt nbp, const PetscReal M[], const PetscReal x[], PetscReal y[])
{
  for (PetscInt i = 0; i < nb; i++) {
    PetscReal sum = 0;

    for (PetscInt j = 0; j < nb; j++) sum += M[i * nbp + j] * x[j];
    y[i] = sum;
  }
}

/* A side with the flux q - h T, has [nq][2]: A += theta h (phi_i, phi_j), f += (q, phi_i) */
static PetscErrorCode add_side(Scalars all, PetscInt c, PetscInt side, const PetscReal has[], PetscReal A[],
                               PetscReal f[])
{
  const PetscInt nb = all->loc->nb, nbp = all->element.nbp, nq = all->loc->dim == 2 ? 3 : 9;
  PetscReal      x[27], weight[9], phi[9 * MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(ScalarSidePoints(all, c, side, x, weight, phi, NULL));
  for (PetscInt q = 0; q < nq; q++, has += 2) {
    const PetscReal *p = phi + q * MESH_MAX_NB;

    for (PetscInt j = 0; j < nb; j++) {
      f[j] += weight[q] * has[0] * p[j];
      for (PetscInt k = 0; k < nb && has[1] != 0; k++)
        A[j * nbp + k] += all->step.theta * weight[q] * has[1] * p[j] * p[k];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Those on boundaries, and others */
static PetscErrorCode add_sides(Scalars all, const Scalar *s, PetscInt c, PetscReal A[], PetscReal f[])
{
  const PetscInt nq = all->loc->dim == 2 ? 3 : 9;

  PetscFunctionBeginUser;
  for (PetscInt i = all->cell_face[c]; i >= 0; i = all->next_face[i])
    if (s->condition[all->face[i].boundary].kind == SCALAR_FLUX)
      PetscCall(add_side(all, c, all->face[i].side, s->input.face + i * nq * 2, A, f));
  for (PetscInt i = s->cell_side ? s->cell_side[c] : -1; i >= 0 && i < s->nside && s->side[i].cell == c; i++)
    PetscCall(add_side(all, c, s->side[i].side, s->input.side + i * nq * 2, A, f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ScalarSampleBasis(Scalars all, PetscInt n, PetscInt q, const PetscReal xc[], PetscReal phi[],
                            PetscReal g[3][MESH_MAX_NB])
{
  const PetscInt dim = all->loc->dim, nb = all->loc->nb, at[3] = {q % n, q / n % n, q / (n * n)};
  PetscReal      xi[3], dphi[3 * MESH_MAX_NB], x[3], J[9], inverse[9], det;

  for (PetscInt a = 0; a < dim; a++) xi[a] = (2 * at[a] + 1.0) / n - 1;
  ElementBasis(dim, xi, phi, dphi);
  ElementMap(dim, xc, xi, x, J);
  det = DenseInvertMap(dim, J, inverse);
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt j = 0; j < nb; j++) {
      g[a][j] = 0;
      for (PetscInt e = 0; e < dim; e++) g[a][j] += inverse[e * dim + a] * dphi[e * nb + j];
    }
  return PetscPowRealInt(2.0 / n, (int)dim) * det;
}

void ScalarCellGetInput(Scalars all, const Scalar *s, PetscInt c, ScalarCellInput *in)
{
  in->acts  = (PetscBool)((s->input.q || s->decay != 0) &&
                         !(s->cells.fluid && s->cells.fluid[c] == SCALAR_COUNTS_NOTHING));
  in->decay = (in->acts ? s->decay : 0) + (s->cells.decay ? s->cells.decay[c] : 0);
  if (!in->acts) return;
  for (PetscInt j = 0; j < all->loc->nb; j++) in->q[j] = in->slope[j] = 0;
  if (s->input.q) MeshCellValues(all->loc, c, 1, s->input.q, in->q);
  if (s->input.slope) MeshCellValues(all->loc, c, 1, s->input.slope, in->slope);
}

PetscReal ScalarSamplePart(const Scalar *s, PetscInt c, PetscInt k)
{
  if (!s->cells.fluid || s->cells.fluid[c] == SCALAR_COUNTS_NOTHING) return 0;
  return s->cells.fluid[c] == SCALAR_COUNTS_ALL ? 1 : s->cells.outside[s->cells.fluid[c] + k];
}

/* Of cell c of samples: sums over the midpoints of its sub-cells */
static void add_sampled(Scalars all, const Scalar *s, PetscInt cell, const PetscReal xc[], const PetscReal wl[],
                        PetscReal A[], PetscReal M[], PetscReal f[])
{
  const ScalarSamples *p   = s->cells.samples + s->cells.sample[cell];
  const PetscInt       dim = all->loc->dim, nb = all->loc->nb, nbp = all->element.nbp, count = PetscPowInt(p->n, dim);
  const PetscReal      theta = all->step.theta, ct = all->step.ct;
  ScalarCellInput      in;

  ScalarCellGetInput(all, s, cell, &in);
  for (PetscInt q = 0; q < count; q++) {
    const PetscReal c = p->capacity[q], k = p->conductivity[q], part = in.acts ? ScalarSamplePart(s, cell, q) : 0;
    PetscReal       phi[MESH_MAX_NB], g[3][MESH_MAX_NB], flux[3][MESH_MAX_NB], along[MESH_MAX_NB] = {0}, w[3] = {0};
    const PetscReal weight = ScalarSampleBasis(all, p->n, q, xc, phi, g);
    PetscReal       r, source;

    ScalarSampleTerms(s, cell, q, &r, &source);
    for (PetscInt j = 0; j < nb && wl; j++)
      for (PetscInt a = 0; a < dim; a++) w[a] += phi[j] * wl[j * dim + a];
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++) {
        along[j] += w[a] * g[a][j];
        flux[a][j] = k * g[a][j];
      }
    for (PetscInt i = 0; i < nb; i++) {
      for (PetscInt j = 0; j < nb; j++) {
        PetscReal L = phi[i] * (c * along[j] + r * phi[j]);

        for (PetscInt a = 0; a < dim; a++) L += g[a][i] * flux[a][j];
        M[i * nbp + j] += weight * c * phi[i] * phi[j];
        A[i * nbp + j] += weight * (ct * c * phi[i] * phi[j] + theta * L);
      }
      f[i] += weight * source * phi[i];
    }
    for (PetscInt e = 0; e < nb * nb && part > 0; e++) {
      const PetscInt  i = e / nb, j = e % nb;
      const PetscReal both = weight * part * phi[i] * phi[j];

      A[i * nbp + j] += theta * both * (in.decay * s->par.capacity + in.slope[j]);
      f[i] += both * in.q[j];
    }
  }
}

/* Of a cell of one material */
static PetscErrorCode set_uniform(Scalars all, const Scalar *s, PetscInt c, PetscReal wl[], PetscReal A[],
                                  PetscReal M[], PetscReal f[])
{
  const MeshLocal *l  = all->loc;
  const PetscInt   nb = l->nb, nbp = all->element.nbp;
  const PetscReal  capacity    = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity,
                  conductivity = s->cells.conductivity ? s->cells.conductivity[c] : s->par.conductivity,
                  theta = all->step.theta, uniform = s->cells.source ? s->cells.source[c] : 0;
  PetscReal       q[MESH_MAX_NB], y[MESH_MAX_NB];
  ElementMetric   m;
  ScalarCellInput in;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellMetric(all, c, &m));
  ScalarCellGetInput(all, s, c, &in);
  for (PetscInt i = 0; i < nb * l->dim && wl; i++) wl[i] *= theta * capacity;
  ElementOperator(&all->element, &m, capacity * (all->step.ct + theta * in.decay), theta * conductivity, wl, 0, A);
  if (m.affine)
    for (PetscInt i = 0; i < nb * nbp; i++) M[i] = capacity * m.det * all->element.mass[i];
  else ElementOperator(&all->element, &m, capacity, 0, NULL, 0, M);
  if (!in.acts && uniform == 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt j = 0; j < nb; j++) q[j] = ((in.acts ? in.q[j] : 0) + uniform) / capacity;
  multiply(nb, nbp, M, q, y);
  for (PetscInt j = 0; j < nb; j++) f[j] += y[j];
  if (!in.acts || !s->input.slope) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < nb * nb; i++)
    A[i / nb * nbp + i % nb] += theta / capacity * M[i / nb * nbp + i % nb] * in.slope[i % nb];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellLinear(Scalars all, const Scalar *s, PetscInt c, PetscReal linear[])
{
  const PetscInt dim = all->loc->dim, nb = all->loc->nb;
  PetscReal      xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(linear, nb));
  if (!s->par.periodic_gradient) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarCellCoordinates(all, c, xc));
  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt a = 0; a < dim; a++) linear[j] += s->par.gradient[a] * xc[j * dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Right-hand side of the step: f += M d(T) - L ((1 - theta) T^n + G.x), with theta L = A - c_t M */
static PetscErrorCode add_history(Scalars all, const Scalar *s, PetscInt c, ScalarCell *cell)
{
  const MeshLocal  *l  = all->loc;
  const ScalarStep *p  = &all->step;
  const PetscInt    nb = l->nb, nbp = all->element.nbp;
  PetscReal         now[MESH_MAX_NB], old[MESH_MAX_NB], d[MESH_MAX_NB], y[MESH_MAX_NB], z[MESH_MAX_NB];

  PetscFunctionBeginUser;
  MeshCellValues(l, c, 1, s->T, now);
  MeshCellValues(l, c, 1, s->T_old, old);
  for (PetscInt j = 0; j < nb; j++) d[j] = p->d0 * now[j] + p->d1 * old[j];
  multiply(nb, nbp, cell->M, d, y);
  for (PetscInt j = 0; j < nb; j++) cell->f[j] += y[j];
  if (p->theta == 1 && !s->par.periodic_gradient) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarCellLinear(all, s, c, cell->linear));
  for (PetscInt j = 0; j < nb; j++) d[j] = (1 - p->theta) * now[j] + cell->linear[j];
  multiply(nb, nbp, cell->A, d, y);
  multiply(nb, nbp, cell->M, d, z);
  for (PetscInt j = 0; j < nb; j++) cell->f[j] -= (y[j] - p->ct * z[j]) / p->theta;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellMatrices(Scalars all, const Scalar *s, PetscInt c, ScalarCell *cell)
{
  const MeshLocal *l  = all->loc;
  const PetscInt   nb = l->nb, nbp = all->element.nbp, sample = s->cells.sample ? s->cells.sample[c] : -1;
  PetscReal        wl[MESH_MAX_NB * 3], xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(cell->f, nb));
  if (s->w) MeshCellValues(l, c, l->dim, s->w, wl);
  if (sample >= 0) {
    PetscCall(ScalarCellCoordinates(all, c, xc));
    PetscCall(PetscArrayzero(cell->A, nb * nbp));
    PetscCall(PetscArrayzero(cell->M, nb * nbp));
    add_sampled(all, s, c, xc, s->w ? wl : NULL, cell->A, cell->M, cell->f);
  } else PetscCall(set_uniform(all, s, c, s->w ? wl : NULL, cell->A, cell->M, cell->f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCellSet(Scalars all, const Scalar *s, PetscInt c, ScalarCell *cell)
{
  PetscFunctionBeginUser;
  PetscCall(ScalarCellMatrices(all, s, c, cell));
  if (s->limit.part && s->limit.part[c] > 0 && s->w) ScalarLimitCell(all, s, c, cell->A, cell->M);
  PetscCall(add_sides(all, s, c, cell->A, cell->f));
  PetscCall(add_history(all, s, c, cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}
