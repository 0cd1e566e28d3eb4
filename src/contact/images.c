/* Contact, images: bodies and their own periodic images.

   A body that overlaps its image is no body: its mass, its volume and what moves it count twice there. And a body that
   turns has its arms, by which points at its surface move, from the nearest of its images: they are right as long as
   it reaches at most half a period from its centre. Bodies that stand still may do both: they are drawn as what all
   images cover. Asked of bodies whose bounding sphere is wider than a period; others cost nothing. */
#include "compat.h"
#include "impl.h"

#define OVERLAP 1e-6 /* in radii, as at the start of other pairs */

/* Does a body turn, so that along axis a its arms count? Not about that axis itself. */
static PetscBool turns(Contact c, PetscInt k, PetscInt a)
{
  const BodyGroup *g = BodiesGetGroup(c->state, k);
  const Motion    *m = &g->motion;
  const PetscReal *w = c->s->w[k];

  if (c->dim == 2)
    return (PetscBool)(g->free & BODY_FREE_ROTATION || m->omega || m->rotation[0] != 0 || m->track || w[2] != 0);
  if (g->free & BODY_FREE_ROTATION) return (PetscBool)(!m->has_hinge || PetscAbsReal(m->hinge[a]) < 1);
  if (m->omega || m->track) return PETSC_TRUE;
  for (PetscInt b = 0; b < 3; b++)
    if (b != a && w[b] != 0) return PETSC_TRUE;
  return (PetscBool)(m->rotation[0] != 0 && a != 2);
}

/* Points of a body's surface from its centre, space axes, its corners among them; free r */
static PetscErrorCode list_points(Contact c, PetscInt k, PetscInt *n, PetscReal (**r)[3])
{
  const Kind      *kind  = ContactKind(c, k);
  const BodyGroup *g     = BodiesGetGroup(c->state, k);
  const PetscInt   nface = c->dim == 2 ? 500 : 1000;
  const PetscReal *corner;
  PetscReal        R[9], *x, *w;
  PetscInt         ncorners;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetCorners(g->shape, &ncorners, &corner));
  PetscCall(PetscMalloc2(nface * c->dim, &x, nface, &w));
  PetscCall(ShapeSurface(g->shape, nface, x, w));
  RotationMatrix(c->s->q[k], R);
  *n = nface + ncorners;
  PetscCall(PetscMalloc1(*n, r));
  for (PetscInt p = 0; p < *n; p++) {
    const PetscReal *at   = p < nface ? x + p * c->dim : corner + (p - nface) * c->dim;
    PetscReal        y[3] = {0, 0, 0};

    for (PetscInt b = 0; b < c->dim; b++) y[b] = at[b] - g->mass.centroid[b];
    for (PetscInt a = 0; a < 3; a++)
      (*r)[p][a] = kind->scale * (R[3 * a] * y[0] + R[3 * a + 1] * y[1] + R[3 * a + 2] * y[2]);
  }
  PetscCall(PetscFree2(x, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How deep the image of body k at `shift` is in the body; 0: it is not */
static PetscErrorCode measure_overlap(Contact c, PetscInt k, const PetscReal shift[3], PetscInt n, PetscReal (*r)[3],
                                      PetscReal *depth)
{
  const Kind *kind = ContactKind(c, k);

  PetscFunctionBeginUser;
  *depth = 0;
  if (kind->disc > 0) {
    *depth = PetscMax(0, 2 * kind->disc - PetscSqrtReal(dot3(shift, shift)));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt p = 0; p < n; p++) {
    PetscReal x[3], d;

    for (PetscInt a = 0; a < 3; a++) x[a] = c->s->x[k][a] + r[p][a] + shift[a];
    PetscCall(BodiesDistance(c->bodies, k, c->s->x[k], NULL, 1, x, &d));
    *depth = PetscMax(*depth, -d);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "x", or "x and y" of a diagonal image */
static void name_axes(const PetscReal shift[3], char text[32])
{
  text[0] = 0;
  for (PetscInt a = 0; a < 3; a++)
    if (shift[a] != 0) (void)snprintf(text + strlen(text), 32 - strlen(text), "%s%c", text[0] ? " and " : "", "xyz"[a]);
}

static PetscErrorCode refuse_overlap(Contact c, PetscInt k, const PetscReal shift[3], PetscReal depth, PetscBool start)
{
  const BodyGroup *g = BodiesGetGroup(c->state, k);
  char             axes[32], when[64] = "at the start";

  PetscFunctionBeginUser;
  name_axes(shift, axes);
  if (!start) (void)snprintf(when, sizeof(when), "at t = %g", (double)c->s->time);
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Body %" PetscInt_FMT
          " of group '%s' overlaps its own periodic image along %s by %g %s: make the body smaller or the domain longer, or if it stands still hold it with "
          "-particle_%s_free none",
          BodiesIndexInGroup(c->state, k), g->name, axes, (double)depth, when, g->name);
}

static PetscErrorCode refuse_reach(Contact c, PetscInt k, PetscInt a, PetscReal reach, PetscBool start)
{
  const BodyGroup *g = BodiesGetGroup(c->state, k);

  PetscFunctionBeginUser;
  if (start)
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
            "Body %" PetscInt_FMT
            " of group '%s' reaches %g from its centre along %c, more than half the period of %g: it turns, and would meet its own periodic image. Make the "
            "body smaller or the domain longer, or let it not turn (-particle_%s_free x, y)",
            BodiesIndexInGroup(c->state, k), g->name, (double)reach, (int)"xyz"[a], (double)c -> domain.period[a],
            g->name);
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Body %" PetscInt_FMT
          " of group '%s' has turned until at t = %g it reaches %g from its centre along %c, more than half the period of %g, and meets its own periodic "
          "image: make the domain longer than the body, or let it not turn (-particle_%s_free x, y)",
          BodiesIndexInGroup(c->state, k), g->name, (double)c->s->time, (double)reach, (int)"xyz"[a],
          (double)c -> domain.period[a], g->name);
}

static PetscErrorCode check_body(Contact c, PetscInt k, PetscBool start)
{
  const PetscReal radius = BodiesGetRadius(c->state, k);
  const PetscBool moves  = (PetscBool)(BodiesGetGroup(c->state, k)->free != 0);
  PetscReal(*r)[3], depth;
  PetscInt n = 0;

  PetscFunctionBeginUser;
  PetscCall(list_points(c, k, &n, &r));
  for (PetscInt m = 14; m < 27 && moves; m++) { /* half of all images: the others are these, seen from there */
    const PetscReal shift[3] = {(m % 3 - 1) * c->domain.period[0], (m / 3 % 3 - 1) * c->domain.period[1],
                                (m / 9 - 1) * c->domain.period[2]};

    if ((c->domain.period[2] == 0 && m > 17) || dot3(shift, shift) == 0 || dot3(shift, shift) >= 4 * radius * radius)
      continue;
    PetscCall(measure_overlap(c, k, shift, n, r, &depth));
    if (depth > OVERLAP * radius) PetscCall(refuse_overlap(c, k, shift, depth, start));
  }
  for (PetscInt a = 0; a < c->dim; a++) {
    PetscReal reach = ContactKind(c, k)->disc;

    if (c->domain.period[a] == 0 || !turns(c, k, a)) continue;
    for (PetscInt p = 0; p < n && ContactKind(c, k)->disc == 0; p++) reach = PetscMax(reach, PetscAbsReal(r[p][a]));
    if (reach > 0.5 * c->domain.period[a] + OVERLAP * radius) PetscCall(refuse_reach(c, k, a, reach, start));
  }
  PetscCall(PetscFree(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCheckImages(Contact c, PetscBool start)
{
  PetscReal shortest = PETSC_MAX_REAL;
  PetscBool wide     = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < c->dim; a++)
    if (c->domain.period[a] > 0) shortest = PetscMin(shortest, c->domain.period[a]);
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    const BodyGroup *group = &c->s->group[g];

    wide = (PetscBool)(wide || (group->count > 0 && 2 * group->radius * group->largest > shortest));
  }
  for (PetscInt k = 0; k < c->s->n && wide; k++) {
    const BodyGroup *g = BodiesGetGroup(c->state, k);

    if (!c->s->own[k] || c->s->removed[k] || g->obstacle || 2 * BodiesGetRadius(c->state, k) <= shortest) continue;
    PetscCall(check_body(c, k, start));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
