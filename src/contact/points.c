/* Contact, points: the surface points of shapes, by which bodies that are no discs touch. */
#include "compat.h"
#include "impl.h"

void ContactPlacePoints(Contact c, PetscInt k, PetscInt first, PetscInt n, PetscReal r[][3])
{
  const Kind *kind = ContactKind(c, k);
  PetscReal   R[9];

  RotationMatrix(c->q[k], R);
  for (PetscInt p = 0; p < n; p++) ContactTurnPoint(c->dim, R, kind->scale, kind->point + (first + p) * c->dim, r[p]);
}

/* Points about one range apart on the largest body, at least 32, at most `max`. A disc needs them only against bodies
   that are no discs. */
static PetscErrorCode create_points(Contact c, const BodyGroup *g, PetscInt max, PetscInt *n, PetscReal **point)
{
  PetscReal *x, *w, area = 0;

  PetscFunctionBeginUser;
  if (g->disc > 0) area = c->dim == 2 ? 2 * PETSC_PI * g->disc : 4 * PETSC_PI * PetscSqr(g->disc);
  else {
    PetscCall(PetscMalloc2(64 * c->dim, &x, 64, &w));
    PetscCall(ShapeSurface(g->shape, 64, x, w));
    for (PetscInt p = 0; p < 64; p++) area += w[p];
    PetscCall(PetscFree2(x, w));
  }
  *n = (PetscInt)PetscMin(max, PetscMax(32, PetscCeilReal(area / PetscPowRealInt(c->range / g->largest, c->dim - 1))));
  PetscCall(PetscMalloc1(*n * c->dim, point));
  PetscCall(PetscMalloc1(*n, &w));
  PetscCall(ShapeSurface(g->shape, *n, *point, w));
  for (PetscInt p = 0; p < *n; p++)
    for (PetscInt a = 0; a < c->dim; a++) (*point)[p * c->dim + a] -= g->mass.centroid[a];
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ContactCopyPoints(Contact c)
{
  for (PetscInt i = 0; i < c->kinds.n; i++) {
    c->kinds.kind[i].npoints = c->kinds.npoints[c->kinds.kind[i].group];
    c->kinds.kind[i].point   = c->kinds.point[c->kinds.kind[i].group];
  }
}

PetscErrorCode ContactCreatePoints(Contact c, PetscInt max)
{
  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    PetscCall(PetscFree(c->kinds.point[g]));
    PetscCall(create_points(c, &c->s->group[g], max, &c->kinds.npoints[g], &c->kinds.point[g]));
  }
  ContactCopyPoints(c);
  PetscFunctionReturn(PETSC_SUCCESS);
}
