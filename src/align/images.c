/* Align, images: which periodic image of its surface a covered cell, or a wall node, is of.

   Two images of one surface are as far from being one as two surfaces are: a layer of fluid cells stays between them,
   walls of a narrow gap are drawn back, and no cell between them is filled. What is told apart is a "copy": a surface,
   and how many periods it is from where it is drawn, as seen from a node. Surfaces that touch or overlap their image
   across an axis, such as a fibre through the box, are one along that axis: there images are what they were before, the
   nearest one. */
#include "compat.h"
#include "impl.h"

#define SURFACE 1000 /* points of a surface that tell */
#define TOUCH   1e-6 /* radii */

/* Is axis a of surface k one along which images are told apart? */
static PetscBool is_apart(Align s, PetscInt k, PetscInt a)
{
  return (PetscBool)(s->loc->period[a] > 0 && !(s->images.joined[k] >> a & 1));
}

static PetscReal periods_between(Align s, PetscInt i, PetscInt j, PetscInt a)
{
  const MeshLocal *l = s->loc;

  return PetscFloorReal((l->x_start[l->dim * j + a] - l->x_start[l->dim * i + a]) / l->period[a] + 0.5);
}

PetscInt AlignCopyOf(Align s, PetscInt i, PetscInt c)
{
  PetscInt copy = s->cover[c] - 1, m = s->image[c], step[3] = {0, 0, 0};

  if (!s->cover[c]) return 0;
  for (PetscInt a = 0; a < s->loc->dim; a++, m /= 3)
    if (is_apart(s, copy, a)) step[a] = m % 3 - 1 - (PetscInt)periods_between(s, i, AlignCentre(s, c), a);
  for (PetscInt a = 2; a >= 0; a--) copy = 5 * copy + step[a] + 2;
  return copy + 1;
}

void AlignPositionInCopy(Align s, PetscInt i, PetscInt copy, PetscInt j, const PetscReal X[], PetscReal x[])
{
  const MeshLocal *l   = s->loc;
  const PetscInt   dim = l->dim;

  for (PetscInt a = 0; a < dim; a++) {
    PetscReal r = l->x_start[dim * j + a] - X[a];

    if (!is_apart(s, AlignCopySurface(copy), a)) r = MeshNearest(l, a, r);
    else r -= l->period[a] * ((PetscReal)AlignCopyStep(copy, a) + periods_between(s, i, j, a));
    x[a] = X[a] + r;
  }
}

void AlignOffset(Align s, PetscInt k, const PetscReal y[], PetscInt i, PetscBool displaced, PetscReal r[])
{
  const MeshLocal *l    = s->loc;
  PetscInt         copy = s->images.wide && s->code[i] ? s->images.copy[i] : 0;

  for (PetscInt e = l->node_cell_ptr[i]; s->images.periodic && !copy && e < l->node_cell_ptr[i + 1]; e++)
    if (s->cover[l->node_cell[e]] == k + 1) copy = AlignCopyOf(s, i, l->node_cell[e]);
  for (PetscInt a = 0; a < l->dim; a++) {
    const PetscReal x = displaced ? l->x_start[l->dim * i + a] + s->d[l->dim * i + a] : l->x_start[l->dim * i + a];

    r[a] = copy && is_apart(s, k, a) ? x - y[a] - l->period[a] * (PetscReal)AlignCopyStep(copy, a)
                                     : MeshNearest(l, a, x - y[a]);
  }
}

PetscErrorCode AlignShareCopies(Align s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  if (!s->images.wide) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt i = s->marked.i[e];

    if (i >= l->nnode) continue;
    s->images.copy[i] = 0;
    for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1] && !s->images.copy[i];
         m++) /* the periods alone */
      if (s->cover[l->node_cell[m]]) s->images.copy[i] = 1 + (AlignCopyOf(s, i, l->node_cell[m]) - 1) % 125;
  }
  PetscCall(MeshSyncNodesInt(s->mesh, s->images.copy));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- surfaces that are one with their images ---- */

/* Does surface k meet its image that is this far? Round ones that only touch do not. */
static PetscErrorCode meets_image(Align s, PetscInt k, const PetscReal X[3], const PetscReal shift[3], PetscInt n,
                                  const PetscReal x[], PetscBool *meets)
{
  const PetscReal radius = s->surfaces->radius[k],
                  far    = PetscSqrtReal(PetscSqr(shift[0]) + PetscSqr(shift[1]) + PetscSqr(shift[2]));
  PetscReal at[3]        = {X[0] + shift[0], X[1] + shift[1], X[2] + shift[2]}, *d;

  PetscFunctionBeginUser;
  *meets = PETSC_FALSE;
  if (far > 2 * radius * (1 + TOUCH)) PetscFunctionReturn(PETSC_SUCCESS);
  *meets = (PetscBool)(far < 2 * s->surfaces->round[k] * (1 - TOUCH));
  if (s->surfaces->round[k] > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(n, &d));
  PetscCall(AlignDistance(s, k, at, n, x, d));
  for (PetscInt p = 0; p < n; p++) *meets = (PetscBool)(*meets || d[p] < TOUCH * radius);
  PetscCall(PetscFree(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignFindImages(Align s)
{
  const PetscReal *period = s->loc->period;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal *x = NULL;
    PetscInt   n = 0;

    s->images.joined[k] = 0;
    for (PetscInt m = 14; s->images.wide && m < 27; m++) { /* half of all images */
      const PetscInt  step[3]  = {m % 3 - 1, m / 3 % 3 - 1, m / 9 - 1};
      const PetscReal shift[3] = {step[0] * period[0], step[1] * period[1], step[2] * period[2]},
                      radius   = s->surfaces->radius[k];
      PetscBool meets, is = PETSC_TRUE;

      for (PetscInt a = 0; a < 3; a++) is = (PetscBool)(is && (!step[a] || period[a] > 0));
      if (!is || PetscSqr(shift[0]) + PetscSqr(shift[1]) + PetscSqr(shift[2]) > PetscSqr(2 * radius * (1 + TOUCH)))
        continue;
      if (!x && s->surfaces->points) PetscCall(s->surfaces->points(s->surfaces->ctx, k, SURFACE, &n, &x));
      PetscCall(meets_image(s, k, AlignCentreOf(s, k), shift, n, x, &meets));
      for (PetscInt a = 0; a < 3 && meets; a++) s->images.joined[k] |= step[a] ? 1 << a : 0;
    }
    PetscCall(PetscFree(x));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void AlignMayMeetImages(Align s)
{
  const MeshLocal *l = s->loc;

  for (PetscInt a = 0; a < l->dim; a++) {
    s->images.periodic = (PetscBool)(s->images.periodic || l->period[a] > 0);
    s->images.wide     = (PetscBool)(s->images.wide ||
                                 (l->period[a] > 0 && 2 * s->surfaces->largest * (1 + TOUCH) >= l->period[a]));
  }
}
