/* ScalarCover: see scalarcover.h. */
#include "compat.h"
#include "impl.h"
#include "cutcells.h"
#include "scalarcover.h"
#include "base/array.h"
#include "fem/element.h"

#define CHUNK 256

/* Distances at the samples of a cell, and its part inside */
static PetscErrorCode sample_cell(ScalarCover *s, Couple c, PetscInt cell, PetscInt k, const PetscReal X[3],
                                  const PetscReal q[4], CoveredCell *at)
{
  const PetscInt dim = c->loc->dim, n = s->nsample, nb = c->loc->nb;
  PetscReal      xc[MESH_MAX_NB * 3], x[SCALAR_MAX_SAMPLES * 3], J[9], *d, size = 0, h;
  PetscReal      inside = 0;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(s->ndistance + s->count, &s->distance_capacity, &s->distance, sizeof(*s->distance), NULL));
  d = s->distance + s->ndistance;
  PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
  for (PetscInt p = 0; p < s->count; p++) {
    const PetscReal xi[3] = {(2 * (p % n) + 1.0) / n - 1, (2 * (p / n % n) + 1.0) / n - 1,
                             (2 * (p / (n * n)) + 1.0) / n - 1};

    ElementMap(dim, xc, xi, x + p * dim, J);
  }
  PetscCall(BodiesDistance(c->bodies, k, X, q, s->count, x, d));
  for (PetscInt a = 0; a < dim; a++) size += PetscSqr(xc[(nb - 1) * dim + a] - xc[a]);
  h = PetscSqrtReal(size / dim) / n;
  for (PetscInt p = 0; p < s->count; p++) inside += ScalarCoverPart(d[p], h);
  at->inside = inside / s->count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cover(ScalarCover *s, Couple c, PetscInt cell, PetscInt k, const PetscReal X[3],
                            const PetscReal q[4], PetscReal d)
{
  PetscReal   r;
  CoveredCell at = {.cell = cell, .body = k, .distance = -1, .inside = 1};

  PetscFunctionBeginUser;
  PetscCall(CutCellRadius(c->mesh, cell, &r));
  if (d > r) PetscFunctionReturn(PETSC_SUCCESS);
  if (d > -r) {
    PetscCall(sample_cell(s, c, cell, k, X, q, &at));
    if (at.inside == 0) PetscFunctionReturn(PETSC_SUCCESS);
    at.distance = at.inside < 1 ? s->ndistance : -1;
    if (at.inside < 1) s->ndistance += s->count;
  }
  PetscCall(ArrayReserve(s->n + 1, &s->capacity, &s->covered, sizeof(*s->covered), NULL));
  s->covered[s->n++] = at;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that the image of body k at X meets */
static PetscErrorCode cover_image(ScalarCover *s, Couple c, PetscInt k, const PetscReal X[3], const PetscReal q[4])
{
  const MeshLocal *l = c->loc;
  PetscReal        x[CHUNK * 3], d[CHUNK];
  PetscInt         n, cell[CHUNK];
  const PetscInt  *list;

  PetscFunctionBeginUser;
  PetscCall(MeshNodesInBox(c->mesh, X, BodiesGetRadius(c->s, k) + s->reach, &n, &list));
  for (PetscInt i = 0; i < n;) {
    PetscInt m = 0;

    for (; i < n && m < CHUNK; i++) {
      if (l->centre_cell[list[i]] < 0) continue;
      for (PetscInt a = 0; a < l->dim; a++) x[m * l->dim + a] = l->x[list[i] * l->dim + a];
      cell[m++] = l->centre_cell[list[i]];
    }
    PetscCall(BodiesDistance(c->bodies, k, X, q, m, x, d));
    for (PetscInt j = 0; j < m; j++) PetscCall(cover(s, c, cell[j], k, X, q, d[j]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where several bodies meet in a cell the first has it */
static PetscErrorCode find_first(ScalarCover *s, Couple c)
{
  PetscBool *taken;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->loc->ncell_all, &taken));
  for (PetscInt e = 0; e < s->n; e++) {
    s->covered[e].first       = (PetscBool)!taken[s->covered[e].cell];
    taken[s->covered[e].cell] = PETSC_TRUE;
  }
  PetscCall(PetscFree(taken));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCoverFind(ScalarCover *s, Couple c, const PetscReal (*X)[3], const PetscReal (*q)[4])
{
  const PetscInt *inactive = MeshUpdateGetInactive(c->mesh_update);

  PetscFunctionBeginUser;
  s->n = s->ndistance = 0;
  if (s->reach == 0) PetscCall(CutCellReach(c->mesh, &s->reach));
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (c->s->removed[k] || BodiesGetGroup(c->s, k)->body_fitted || CoupleIsInactiveInside(c, k)) continue;
    for (DomainImages i = {0}; MeshNextImage(c->loc, X[k], BodiesGetRadius(c->s, k), &i);)
      PetscCall(cover_image(s, c, k, i.at, q[k]));
  }
  for (PetscInt e = 0; e < c->loc->ncell_all && inactive; e++) {
    if (inactive[e] < 0 || !CoupleIsInactiveInside(c, inactive[e])) continue;
    PetscCall(ArrayReserve(s->n + 1, &s->capacity, &s->covered, sizeof(*s->covered), NULL));
    s->covered[s->n++] = (CoveredCell){.cell = e, .body = inactive[e], .distance = -1, .inside = 1};
  }
  PetscCall(find_first(s, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCoverOutside(const ScalarCover *s, Couple c, PetscReal *outside[])
{
  const PetscReal *size;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(c->flow, &size));
  PetscCall(PetscRealloc(PetscMax(1, (size_t)s->ndistance) * sizeof(PetscReal), outside));
  for (PetscInt e = 0; e < s->n; e++) {
    const CoveredCell *at = s->covered + e;

    for (PetscInt p = 0; p < s->count && at->distance >= 0; p++)
      (*outside)[at->distance + p] = 1 - ScalarCoverPart(s->distance[at->distance + p], size[at->cell] / s->nsample);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCoverCreate(PetscInt dim, ScalarCover *s)
{
  PetscFunctionBeginUser;
  *s         = (ScalarCover){0};
  s->nsample = dim == 2 ? 10 : 6;
  s->count   = PetscPowInt(s->nsample, dim);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarCoverDestroy(ScalarCover *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(s->covered));
  PetscCall(PetscFree(s->distance));
  PetscFunctionReturn(PETSC_SUCCESS);
}
