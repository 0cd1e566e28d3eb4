/* Contact, packing: the gaps between bodies that are packed, and between them and the faces of their boxes. */
#include "compat.h"
#include "pack.h"

#define DOUBT            0.04                       /* gaps that surface points may miss, in radii */
#define SEARCH_STEP(dim) ((dim) == 2 ? 0.06 : 0.15) /* first step of a search on a surface, in radii */
#define SEARCH_HALVINGS  14

/* Distance of the point at r from the centre of body i to body j (apart: centre of i from that of j), or its place
   along the inner normal of a face of the box, from the centre */
static PetscErrorCode measure_gap(Pack *p, PetscInt j, const PetscReal apart[3], const PetscReal r[3], PetscReal *d)
{
  const PetscReal zero[3] = {0, 0, 0}, x[3] = {apart[0] + r[0], apart[1] + r[1], apart[2] + r[2]};

  PetscFunctionBeginUser;
  if (j >= 0) PetscCall(BodiesDistance(p->c->bodies, j, zero, p->c->q[j], 1, x, d));
  else *d = ((-1 - j) % 2 ? -1 : 1) * r[(-1 - j) / 2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From a point near the surface of body i at r to the surface point nearby that is nearest to j: steps along two
   tangents, halved where none of them gains */
static PetscErrorCode search_surface(Pack *p, PetscInt i, PetscInt j, const PetscReal apart[3],
                                     const PetscReal normal[3], PetscReal r[3], PetscReal *gap)
{
  const PetscInt  dim     = p->c->dim;
  const PetscReal zero[3] = {0, 0, 0},
                  axis[3] = {dim == 3 && PetscAbsReal(normal[2]) > 0.7, 0, dim == 2 || PetscAbsReal(normal[2]) <= 0.7};
  PetscReal t[2][3], step = SEARCH_STEP(dim) * ContactKind(p->c, i)->radius;

  PetscFunctionBeginUser;
  cross(axis, normal, t[0]);
  cross(normal, t[0], t[1]);
  PetscCall(BodiesProject(p->c->bodies, i, zero, p->c->q[i], 1, r, r));
  PetscCall(measure_gap(p, j, apart, r, gap));
  for (PetscInt halving = 0; halving < SEARCH_HALVINGS; halving++) {
    PetscReal best[3], min = *gap;

    for (PetscInt e = 0; e < 2 * (dim - 1); e++) {
      PetscReal y[3] = {0, 0, 0}, d;

      for (PetscInt a = 0; a < dim; a++) y[a] = r[a] + (e % 2 ? -step : step) * t[e / 2][a];
      PetscCall(BodiesProject(p->c->bodies, i, zero, p->c->q[i], 1, y, y));
      PetscCall(measure_gap(p, j, apart, y, &d));
      if (d >= min) continue;
      min = d;
      PetscCall(PetscArraycpy(best, y, 3));
    }
    if (min < *gap) {
      PetscCall(PetscArraycpy(r, best, 3));
      *gap = min;
    } else step *= 0.5;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bounding circles, where body j stays as it is only that of i. At first, because bodies that lie on each other have
   surface points that seem not to overlap. */
static PetscErrorCode look_at_circles(Pack *p, PetscInt i, PetscInt j, Touch *t)
{
  Contact         c  = p->c;
  const PetscReal ri = ContactKind(c, i)->radius, rj = ContactKind(c, j)->radius, zero[3] = {0, 0, 0};
  PetscReal       apart[3], y[3] = {0, 0, 0}, d;

  PetscFunctionBeginUser;
  ContactDiscGap(c, i, ri, j, rj, t->normal, &t->gap);
  for (PetscInt a = 0; a < 3; a++) apart[a] = (t->gap + ri + rj) * t->normal[a];
  if (p->inverse_mass[j] == 0) {
    PetscCall(BodiesDistance(c->bodies, j, zero, c->q[j], 1, apart, &d));
    PetscCall(BodiesProject(c->bodies, j, zero, c->q[j], 1, apart, y));
    t->gap = d - ri;
    if (d != 0)
      for (PetscInt a = 0; a < c->dim; a++) t->normal[a] = (apart[a] - y[a]) / d;
  }
  for (PetscInt a = 0; a < 3; a++) {
    t->ri[a] = -ri * t->normal[a];
    t->rj[a] = apart[a] + t->ri[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Centres in each other: only bodies that lie on each other */
static PetscErrorCode lie_on_each_other(Pack *p, PetscInt i, PetscInt j, const PetscReal apart[3], PetscBool *yes)
{
  const PetscReal zero[3] = {0, 0, 0}, back[3] = {-apart[0], -apart[1], -apart[2]};
  PetscReal       di, dj;

  PetscFunctionBeginUser;
  PetscCall(BodiesDistance(p->c->bodies, j, zero, p->c->q[j], 1, apart, &dj));
  PetscCall(BodiesDistance(p->c->bodies, i, zero, p->c->q[i], 1, back, &di));
  *yes = (PetscBool)(di < 0 || dj < 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PackLookAtPair(Pack *p, PetscInt i, PetscInt j, Touch *t)
{
  Contact     c  = p->c;
  const Kind *ki = ContactKind(c, i), *kj = ContactKind(c, j);
  PetscReal   gap, apart[3];
  PetscInt    n;
  PetscBool   inside = PETSC_FALSE;

  PetscFunctionBeginUser;
  t->gap = PETSC_MAX_REAL;
  if (p->round && p->inverse_mass[i] > 0) {
    PetscCall(look_at_circles(p, i, j, t));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(ContactFindTouch(c, i, j, &n, &gap));
  for (PetscInt k = 0; k < n; k++)
    if (c->touch[k].gap < t->gap) *t = c->touch[k];
  if (!p->fine || (ki->disc > 0 && kj->disc > 0)) PetscFunctionReturn(PETSC_SUCCESS);
  if (t->gap > PackMargin(p, i, j) + p->slack + DOUBT * PetscMin(ki->radius, kj->radius))
    PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++) apart[a] = t->rj[a] - t->ri[a];
  PetscCall(lie_on_each_other(p, i, j, apart, &inside));
  if (inside) PetscCall(look_at_circles(p, i, j, t));
  else PetscCall(search_surface(p, i, j, apart, t->normal, t->ri, &t->gap));
  for (PetscInt a = 0; a < 3; a++) t->rj[a] = t->ri[a] + apart[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PackLookAtFace(Pack *p, PetscInt k, PetscInt face, Touch *t)
{
  Contact         c    = p->c;
  const Kind     *kind = ContactKind(c, k);
  const PetscInt  a = face / 2, g = c->s->body_group[k];
  const PetscReal sign = face % 2 ? -1 : 1, from = sign * (c->x[k][a] - (face % 2 ? p->upper[g][a] : p->lower[g][a]));
  PetscReal       R[9], lowest = PETSC_MAX_REAL, zero[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  t->gap = PETSC_MAX_REAL;
  for (PetscInt b = 0; b < 3; b++) t->normal[b] = b == a ? sign : 0;
  if (from > kind->radius + PackMargin(p, k, -1) + p->slack) PetscFunctionReturn(PETSC_SUCCESS);
  if (kind->disc > 0) {
    for (PetscInt b = 0; b < 3; b++) t->ri[b] = -kind->disc * t->normal[b];
    t->gap = from - kind->disc;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  RotationMatrix(c->q[k], R);
  for (PetscInt i = 0; i < kind->npoints; i++) {
    const PetscReal *y = kind->point + i * c->dim;
    PetscReal        r[3];

    for (PetscInt b = 0; b < 3; b++)
      r[b] = kind->scale * (R[3 * b] * y[0] + R[3 * b + 1] * y[1] + (c->dim == 3 ? R[3 * b + 2] * y[2] : 0));
    if (sign * r[a] >= lowest) continue;
    lowest = sign * r[a];
    PetscCall(PetscArraycpy(t->ri, r, 3));
  }
  if (p->fine) PetscCall(search_surface(p, k, -1 - face, zero, t->normal, t->ri, &lowest));
  t->gap = from + lowest;
  PetscFunctionReturn(PETSC_SUCCESS);
}
