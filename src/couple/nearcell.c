/* NearCell: see nearcell.h. */
#include "compat.h"
#include "nearcell.h"
#include "fem/element.h"

#define BOX 1e-6

/* How far place y is from the middle of cell e, 1: on its edge */
static PetscReal measure_distance(const MeshLocal *l, const PetscReal h[], PetscInt e, const PetscReal y[])
{
  const PetscInt  *node = l->cell_node + e * l->nb;
  const PetscReal *x = NearCellMiddle(l, e), *a = l->x + node[0] * l->dim, *b = l->x + node[l->nb - 1] * l->dim;
  PetscReal        max = 0;

  for (PetscInt d = 0; d < l->dim; d++) {
    const PetscReal extent = PetscAbsReal(MeshNearest(l, d, b[d] - a[d])),
                    side   = MeshCellHang(l, e) || extent < 0.3 * h[e] ? h[e] : extent;

    max = PetscMax(max, 2 * PetscAbsReal(MeshNearest(l, d, y[d] - x[d])) / side);
  }
  return max;
}

/* Node in the slot at corner v of cell e */
static inline PetscInt corner_of(const MeshLocal *l, PetscInt e, PetscInt v)
{
  return l->cell_node[e * l->nb + 2 * (v & 1) + 6 * ((v >> 1) & 1) + 18 * (v >> 2)];
}

/* The node among the corners of cell e that is nearest to y */
static PetscInt nearest_corner(const MeshLocal *l, PetscInt e, const PetscReal y[])
{
  PetscReal best = PETSC_MAX_REAL;
  PetscInt  node = -1;

  for (PetscInt v = 0; v < (1 << l->dim); v++) {
    const PetscInt i = corner_of(l, e, v);
    PetscReal      r = 0;

    for (PetscInt d = 0; d < l->dim; d++) r += PetscSqr(MeshNearest(l, d, y[d] - l->x[i * l->dim + d]));
    if (r < best) node = i;
    best = PetscMin(best, r);
  }
  return node;
}

PetscInt NearCellFind(const MeshLocal *l, const PetscReal h[], PetscInt e, const PetscReal y[])
{
  PetscReal max  = measure_distance(l, h, e, y);
  PetscInt  last = -1;

  while (max > 1 + 1e-9 && last != e) {
    const PetscInt i = nearest_corner(l, e, y);

    last = e;
    for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1]; m++) {
      const PetscReal there = l->node_cell[m] == last ? max : measure_distance(l, h, l->node_cell[m], y);

      if (there < max) e = l->node_cell[m];
      max = PetscMin(max, there);
    }
  }
  return e;
}

PetscErrorCode NearCellLocate(Mesh mesh, const MeshLocal *l, const PetscReal h[], PetscInt e, const PetscReal y[],
                              PetscReal xi[3], PetscBool *found)
{
  const PetscReal *x = NearCellMiddle(l, e), *a = l->x + corner_of(l, e, 0) * l->dim;
  PetscBool        box = (PetscBool)!MeshCellHang(l, e);
  PetscReal        xc[MESH_MAX_NB * 3], at[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  *found = PETSC_TRUE;
  for (PetscInt axis = 0; axis < l->dim && box; axis++) {
    const PetscReal *b = l->x + corner_of(l, e, 1 << axis) * l->dim;

    for (PetscInt d = 0; d < l->dim && box; d++) {
      const PetscReal side = MeshNearest(l, d, b[d] - a[d]);

      if (d == axis) {
        xi[d] = 2 * MeshNearest(l, d, y[d] - x[d]) / side;
        box   = (PetscBool)(side > 0 && PetscAbsReal(MeshNearest(l, d, x[d] - a[d]) - 0.5 * side) < BOX * side);
      } else box = (PetscBool)(PetscAbsReal(side) < BOX * h[e]);
    }
  }
  if (box) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshCellCoordinates(mesh, e, xc));
  for (PetscInt d = 0; d < l->dim; d++) at[d] = xc[l->nb / 2 * l->dim + d] + MeshNearest(l, d, y[d] - x[d]);
  *found = ElementLocate(l->dim, xc, at, xi);
  PetscFunctionReturn(PETSC_SUCCESS);
}
