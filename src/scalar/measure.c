/* Scalars, what a step amounts to: the equation tested with 1, its terms one by one. What nodes with a prescribed value
   let in is what their rows lack: the flux that is consistent with the method, as accurate as the balance. */
#include "compat.h"
#include "impl.h"

/* A cell's nodal values: rate of change and sources; its decay */
typedef struct {
  ScalarValues at; /* its x with G.x */
  PetscReal    rate[MESH_MAX_NB], q[MESH_MAX_NB], decay;
} Values;

static PetscErrorCode set_values(Scalars all, const Scalar *s, PetscInt c, Values *v)
{
  const MeshLocal  *l = all->loc;
  const ScalarStep *p = &all->step;
  ScalarCellInput   in;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellValues(all, s, c, &v->at));
  ScalarCellGetInput(all, s, c, &in);
  v->decay = in.decay;
  for (PetscInt j = 0; j < l->nb; j++) {
    v->rate[j] = p->ct * v->at.x[j] - p->d0 * v->at.now[j] - p->d1 * v->at.old[j];
    v->at.x[j] += v->at.linear[j];
    v->q[j] = in.acts ? in.q[j] - in.slope[j] * v->at.theta[j] : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* With a uniform source and a reaction; part of it with the nodal sources. Its T_theta. */
static PetscReal add_point(PetscInt dim, PetscInt nb, const ScalarPoint *p, PetscReal part, PetscReal source,
                           PetscReal reaction, const Values *v, ScalarBalance *b)
{
  const PetscReal along = ScalarConvected(dim, nb, p, &v->at);
  PetscReal       theta = 0, rate = 0, q = source;

  for (PetscInt j = 0; j < nb; j++) {
    theta += p->phi[j] * v->at.theta[j];
    rate += p->phi[j] * v->rate[j];
    q += part * p->phi[j] * v->q[j];
  }
  b->change += p->weight * p->capacity * rate;
  b->size += PetscAbsReal(p->weight * p->capacity * rate);
  b->convected += p->weight * p->capacity * along;
  b->source += p->weight * (q - reaction * theta);
  return theta;
}

/* A point of what counts, with its part of it */
static void add_content(PetscInt nb, const ScalarPoint *p, PetscReal capacity, const PetscReal nodal[],
                        ScalarBalance *b)
{
  PetscReal x = 0;

  for (PetscInt j = 0; j < nb; j++) x += p->phi[j] * nodal[j];
  b->mean += p->weight * capacity; /* divided in the end */
  b->content += p->weight * capacity * x;
}

/* Sub-cells of a cell of which a part counts */
static PetscErrorCode add_outside(Scalars all, const Scalar *s, PetscInt c, const PetscReal outside[],
                                  const PetscReal nodal[], ScalarBalance *b)
{
  const PetscInt n = s->cells.noutside;
  PetscReal      xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(ScalarCellCoordinates(all, c, xc));
  for (PetscInt q = 0; q < PetscPowInt(n, all->loc->dim); q++) {
    ScalarPoint p;

    if (outside[q] == 0) continue;
    p.weight = ScalarSampleBasis(all, n, q, xc, p.phi, p.g);
    add_content(all->loc->nb, &p, outside[q] * s->par.capacity, nodal, b);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a cell, with a uniform source; counts: does all of it count? flux [bodies]: of samples that a surface cuts */
static PetscErrorCode add_cell(Scalars all, const Scalar *s, PetscInt c, PetscReal uniform, PetscBool counts, Values *v,
                               ScalarBalance *b, PetscReal flux[])
{
  ScalarPoints points;

  PetscFunctionBeginUser;
  PetscCall(ScalarCellPoints(all, s, c, &points));
  for (PetscInt q = 0; q < points.n; q++) {
    const PetscReal part = points.sample ? ScalarSamplePart(s, c, q) : 1;
    ScalarPoint     p;
    PetscReal       r = 0, source = uniform, fluid, theta;

    PetscCall(ScalarCellPoint(all, &points, q, &p));
    if (points.sample) ScalarSampleTerms(s, c, q, &r, &source);
    if (points.sample && points.sample->lump >= 0) r = 0;
    fluid = part * v->decay * (points.sample ? s->par.capacity : p.capacity);
    theta = add_point(all->loc->dim, all->loc->nb, &p, part, source, r + fluid, v, b);
    if (points.sample && flux) flux[points.sample->body] += p.weight * (source - r * theta);
    if (counts) add_content(all->loc->nb, &p, p.capacity, v->at.x, b);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same of a cell of one material without reactions, by sums of its matrices: nodes in place of points */
static void add_sums(Scalars all, const Scalar *s, PetscInt c, PetscReal uniform, PetscBool counts, const Values *v,
                     ScalarBalance *b)
{
  const PetscInt   nb = all->loc->nb;
  const PetscReal *M = s->sums + 2 * c * nb, *L = M + nb;
  const PetscReal  capacity = s->cells.capacity ? s->cells.capacity[c] : s->par.capacity;

  for (PetscInt j = 0; j < nb; j++) {
    if (counts) b->mean += M[j];
    if (counts) b->content += M[j] * v->at.x[j];
    b->change += M[j] * v->rate[j];
    b->size += PetscAbsReal(M[j] * v->rate[j]);
    b->convected += L[j] * v->at.theta[j];
    b->source += M[j] / capacity * (uniform + v->q[j]);
  }
}

/* What is in a cell and changes there */
static PetscErrorCode add_inside(Scalars all, const Scalar *s, PetscInt c, Values *v, ScalarBalance *b,
                                 PetscReal flux[])
{
  const PetscReal uniform = s->cells.source ? s->cells.source[c] : 0;
  const PetscInt  counts  = s->cells.counts ? s->cells.counts[c] : SCALAR_COUNTS_ALL;
  const PetscBool whole   = (PetscBool)(counts == SCALAR_COUNTS_ALL);

  PetscFunctionBeginUser;
  if (counts >= 0) PetscCall(add_outside(all, s, c, s->cells.outside + counts, v->at.x, b));
  if (s->has_sums[c]) add_sums(all, s, c, uniform, whole, v, b);
  else PetscCall(add_cell(all, s, c, uniform, whole, v, b, flux));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What goes in through a side with the flux q - h T, has [nq][2] */
static PetscErrorCode add_side(Scalars all, PetscInt c, PetscInt side, const PetscReal has[], const Values *v,
                               PetscReal *sum)
{
  PetscReal x[27], weight[9], phi[9 * MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(ScalarSidePoints(all, c, side, x, weight, phi, NULL));
  for (PetscInt q = 0; q < (all->loc->dim == 2 ? 3 : 9); q++, has += 2) {
    PetscReal T = 0;

    for (PetscInt j = 0; j < all->loc->nb; j++) T += phi[q * MESH_MAX_NB + j] * v->at.theta[j];
    *sum += weight[q] * (has[0] - has[1] * T);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Through faces of a cell on boundaries, sum [nboundary], and through sides of bodies, flux [bodies] */
static PetscErrorCode add_sides(Scalars all, const Scalar *s, PetscInt c, const Values *v, PetscReal sum[],
                                PetscReal *source, PetscReal flux[])
{
  const PetscInt nq = all->loc->dim == 2 ? 3 : 9;

  PetscFunctionBeginUser;
  for (PetscInt i = all->cell_face[c]; i >= 0; i = all->next_face[i])
    if (s->condition[all->face[i].boundary].kind == SCALAR_FLUX)
      PetscCall(add_side(all, c, all->face[i].side, s->input.face + i * nq * 2, v, sum + all->face[i].boundary));
  for (PetscInt i = s->cell_side ? s->cell_side[c] : -1; i >= 0 && i < s->nside && s->side[i].cell == c; i++) {
    PetscReal q = 0;

    PetscCall(add_side(all, c, s->side[i].side, s->input.side + i * nq * 2, v, &q));
    *source += q;
    if (flux) flux[s->side[i].body] += q;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the rows of fixed nodes lack in a cell, by owner: sum [owner], the boundary or, the last, ScalarNodes, whose
   bodies have flux [bodies] */
static PetscErrorCode add_fixed(Scalars all, const Scalar *s, PetscInt c, PetscReal sum[], PetscReal flux[])
{
  const MeshLocal *l    = all->loc;
  const PetscInt  *node = l->cell_node + c * l->nb;
  PetscBool        any  = PETSC_FALSE;
  PetscReal        x[MESH_MAX_NB], r[MESH_MAX_NB];
  ScalarCell       cell;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < l->nb; j++) any = (PetscBool)(any || s->owner[node[j]] >= 0);
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarCellSet(all, s, c, &cell));
  MeshCellValues(l, c, 1, s->x, x);
  for (PetscInt i = 0; i < l->nb; i++) {
    r[i] = -cell.f[i];
    for (PetscInt j = 0; j < l->nb; j++) r[i] += cell.A[i * all->element.nbp + j] * x[j];
  }
  MeshCellScatter(l, c, 1, r);
  for (PetscInt j = 0; j < l->nb; j++) {
    const PetscInt owner = s->owner[node[j]];

    if (owner >= 0) sum[owner] += r[j];
    /* a steady field that nothing holds at a level has such a node that is no body's */
    if (flux && owner == all->nboundary && s->nodes.fixed[node[j]]) flux[s->nodes.body[node[j]]] += r[j];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* int k |grad T|^2 over the own cells, from their matrices without convection */
static PetscErrorCode find_effective(Scalars all, const Scalar *s, ScalarBalance *b)
{
  const MeshLocal *l      = all->loc;
  const PetscInt   nb     = l->nb;
  Scalar           still  = *s;
  PetscReal        volume = 1, slope = 0;
  ScalarCell       cell;

  PetscFunctionBeginUser;
  still.w = NULL;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal v[MESH_MAX_NB];

    if (!ScalarCellIsActive(s, c)) continue;
    PetscCall(ScalarCellSet(all, &still, c, &cell));
    MeshCellValues(l, c, 1, s->x, v);
    for (PetscInt j = 0; j < nb; j++) v[j] += cell.linear[j];
    for (PetscInt i = 0; i < nb * nb; i++) {
      const PetscInt at = i / nb * all->element.nbp + i % nb;

      b->effective += v[i / nb] * v[i % nb] * (cell.A[at] - all->step.ct * cell.M[at]) / all->step.theta;
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &b->effective, 1, MPIU_REAL, MPIU_SUM, all->comm));
  for (PetscInt a = 0; a < l->dim; a++) {
    volume *= l->upper[a] - l->lower[a];
    slope += PetscSqr(s->par.gradient[a]);
  }
  b->effective /= volume * slope;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Extremes over the nodes of the problem; without a mean gradient alone */
static PetscErrorCode find_extremes(Scalars all, const Scalar *s, ScalarBalance *b)
{
  PetscReal v[2] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->loc->nnode; i++) {
    if (!s->seen[i] && s->owner[i] < 0) continue;
    v[0] = PetscMax(v[0], s->x[i]);
    v[1] = PetscMax(v[1], -s->x[i]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, 2, MPIU_REAL, MPIU_MAX, all->comm));
  b->max = v[0];
  b->min = -v[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* sum [nboundary + 1], the last through ScalarNodes */
static PetscErrorCode sum_balance(Scalars all, ScalarBalance *b, PetscReal sum[])
{
  const PetscInt n        = all->nboundary + 1;
  PetscReal      terms[6] = {b->mean, b->content, b->change, b->convected, b->source, b->size};

  PetscFunctionBeginUser;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, terms, 6, MPIU_REAL, MPIU_SUM, all->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, (PetscMPIInt)n, MPIU_REAL, MPIU_SUM, all->comm));
  b->content   = terms[1];
  b->mean      = terms[1] / terms[0];
  b->change    = terms[2];
  b->convected = terms[3];
  b->source    = terms[4];
  b->size      = terms[5] + PetscAbsReal(b->convected) + PetscAbsReal(b->source);
  for (PetscInt k = 0; k < n; k++) {
    if (k < all->nboundary) b->boundary += sum[k];
    else b->nodes += sum[k];
    b->size += PetscAbsReal(sum[k]);
  }
  b->residual = b->change + b->convected - b->source - b->boundary - b->nodes;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsMeasure(Scalars all, PetscInt i, ScalarBalance *b, PetscReal boundary[], PetscReal flux[])
{
  const MeshLocal *l = all->loc;
  const Scalar    *s = all->scalar + i;
  PetscReal       *sum;

  PetscFunctionBeginUser;
  *b = (ScalarBalance){0};
  PetscCall(PetscCalloc1(all->nboundary + 1, &sum));
  for (PetscInt c = 0; c < l->ncell; c++) {
    Values v;

    if (!ScalarCellIsActive(s, c)) continue;
    PetscCall(set_values(all, s, c, &v));
    PetscCall(add_sides(all, s, c, &v, sum, &b->source, flux));
    PetscCall(add_fixed(all, s, c, sum, flux));
    PetscCall(add_inside(all, s, c, &v, b, flux));
  }
  ScalarLumpsMeasure(all, s, b, flux);
  if (s->par.periodic_gradient) PetscCall(find_effective(all, s, b));
  PetscCall(find_extremes(all, s, b));
  PetscCall(sum_balance(all, b, sum));
  PetscCall(PetscArraycpy(boundary, sum, all->nboundary));
  PetscCall(PetscFree(sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsGetAreas(Scalars all, PetscReal area[])
{
  const PetscInt nq = all->loc->dim == 2 ? 3 : 9;

  PetscFunctionBeginUser;
  PetscCall(ScalarsSetUp(all));
  PetscCall(PetscArrayzero(area, all->nboundary));
  for (PetscInt i = 0; i < all->nface; i++) {
    PetscReal x[27], weight[9], phi[9 * MESH_MAX_NB];

    if (all->face[i].cell >= all->loc->ncell) continue;
    PetscCall(ScalarFacePoints(all, i, x, weight, phi));
    for (PetscInt q = 0; q < nq; q++) area[all->face[i].boundary] += weight[q];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, area, (PetscMPIInt)all->nboundary, MPIU_REAL, MPIU_SUM, all->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}
