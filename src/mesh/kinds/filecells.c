/* FileCells: see filecells.h. */
#include "compat.h"
#include "filecells.h"
#include "../impl.h"

/* Lattice positions in Gmsh's order of the nodes: corners, edges, faces, middle */
static const PetscInt QUAD[9] = {0, 2, 8, 6, 1, 5, 7, 3, 4};
static const PetscInt HEX[27] = {0,  2,  8,  6,  18, 20, 26, 24, 1,  3,  9,  5,  11, 7,
                                 17, 15, 19, 21, 23, 25, 4,  10, 12, 14, 16, 22, 13};

static PetscBool is_cell(const MshType *t)
{
  return (PetscBool)((t->dim == 2 && t->shape[0] == 'q') || (t->dim == 3 && t->shape[0] == 'h'));
}

/* "12 triangles, 3 quadrilaterals": what the file has of this dimension */
static void list_shapes(const Msh *m, PetscInt dim, char text[], size_t len)
{
  const char *shape[4] = {NULL};
  PetscInt    n[4]     = {0, 0, 0, 0};
  size_t      used     = 0;

  for (PetscInt i = 0; i < m->nelement; i++) {
    const MshType *t = m->element[i].type;
    PetscInt       k = 0;

    if (t->dim != dim) continue;
    while (k < 3 && shape[k] && strcmp(shape[k], t->shape)) k++;
    shape[k] = t->shape;
    n[k]++;
  }
  text[0] = 0;
  for (PetscInt k = 0; k < 4 && shape[k] && used < len; k++)
    used += (size_t)snprintf(text + used, len - used, "%s%" PetscInt_FMT " %s", k ? ", " : "", n[k], shape[k]);
}

/* Does the file have cells that we can take? */
static void check_shapes(const Msh *m, PetscInt *dim, char fault[])
{
  PetscInt other = 0, high = 0, order[3] = {0, 0, 0};
  char     shapes[128];

  *dim = 0;
  for (PetscInt i = 0; i < m->nelement; i++) *dim = PetscMax(*dim, m->element[i].type->dim);
  for (PetscInt i = 0; i < m->nelement; i++) {
    const MshType *t = m->element[i].type;

    if (t->dim != *dim) continue;
    other += !is_cell(t);
    high = PetscMax(high, t->order);
    if (t->order < 3) order[t->order]++;
  }
  list_shapes(m, *dim, shapes, sizeof(shapes));
  if (*dim < 2)
    (void)
      snprintf(fault, MSH_FAULT,
               "has no cells, only %s: Gmsh saves what has a physical name, so give the surface a physical name too (in space the volume), "
               "Physical Surface(\"fluid\") = {...};, and save it again",
               shapes);
  else if (other)
    (void)
      snprintf(fault, MSH_FAULT, "has %s: %s", shapes,
               *dim == 2
                 ? "cells must be quadrilaterals; in Gmsh write Recombine Surface{:}; and, where triangles are left, "
                   "Mesh.SubdivisionAlgorithm = 1;"
                 : "cells must be hexahedra; in Gmsh extrude recombined surfaces (Layers{n}; Recombine;), make volumes transfinite, "
                   "or write Mesh.SubdivisionAlgorithm = 2;");
  else if (high > 2)
    (void)snprintf(fault, MSH_FAULT,
                   "has cells of order %" PetscInt_FMT
                   ": write Mesh.ElementOrder = 2; (or 1) in Gmsh and save it again",
                   high);
  else if (order[1] && order[2])
    (void)snprintf(fault, MSH_FAULT, "has cells of order 1 and of order 2: save all with one Mesh.ElementOrder");
}

static PetscErrorCode collect(const Msh *m, FileCells *f, char fault[])
{
  const PetscInt *position = f->dim == 2 ? QUAD : HEX;
  PetscInt        n        = 0;

  PetscFunctionBeginUser;
  f->nb = f->dim == 2 ? 9 : 27;
  for (PetscInt i = 0; i < m->nelement; i++) f->ncell += m->element[i].type->dim == f->dim;
  if ((PetscReal)f->ncell * f->nb * f->dim > (PetscReal)PETSC_MAX_INT) {
    (void)snprintf(fault, MSH_FAULT,
                   "has %" PetscInt_FMT " cells, more than a PETSc with 32-bit integers can hold of one file",
                   f->ncell);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc3(f->ncell * f->nb, &f->lattice, f->ncell, &f->number, m->nnode, &f->vertex));
  for (PetscInt i = 0; i < f->ncell * f->nb; i++) f->lattice[i] = -1;
  for (PetscInt i = 0; i < m->nnode; i++) f->vertex[i] = -1;
  for (PetscInt i = 0; i < m->nelement; i++) {
    const MshElement *e = m->element + i;

    if (e->type->dim != f->dim) continue;
    for (PetscInt j = 0; j < e->type->nnode; j++) f->lattice[n * f->nb + position[j]] = m->node[e->start + j];
    for (PetscInt j = 0; j < 1 << f->dim; j++) f->vertex[m->node[e->start + j]] = 0;
    f->number[n++] = e->number;
  }
  for (PetscInt i = 0; i < m->nnode; i++)
    if (f->vertex[i] == 0) f->vertex[i] = f->nvertex++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The plane of a plane mesh must be that of x and y */
static void check_plane(const Msh *m, const FileCells *f, char fault[])
{
  PetscReal lower[3] = {PETSC_MAX_REAL, PETSC_MAX_REAL, PETSC_MAX_REAL},
            upper[3] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL}, size = 0;
  PetscInt flat = -1;

  for (PetscInt i = 0; i < m->nnode; i++) {
    for (PetscInt d = 0; d < 3 && f->vertex[i] >= 0; d++) {
      lower[d] = PetscMin(lower[d], m->x[3 * i + d]);
      upper[d] = PetscMax(upper[d], m->x[3 * i + d]);
      size     = PetscMax(size, upper[d] - lower[d]);
    }
  }
  for (PetscInt d = 0; d < 3; d++)
    if (upper[d] - lower[d] <= 1e-9 * size) flat = d;
  if (flat == 2) return;
  if (flat >= 0)
    (void)
      snprintf(fault, MSH_FAULT,
               "has its cells in the plane %c = %g, but z must be 0, since a plane mesh is read as x, y: turn it (Rotate, or exchange the coordinates) "
               "and save it again",
               (char)('x' + flat), (double)lower[flat]);
  else
    (void)
      snprintf(fault, MSH_FAULT,
               "has quadrilaterals in space (z from %g to %g) and no hexahedra: in the plane z must be 0; for a mesh in space give the volume a "
               "physical name, Physical Volume(\"fluid\") = {...};, mesh it with hexahedra, and save it again",
               (double)lower[2], (double)upper[2]);
}

/* ---- positions ---- */

/* Place `at` of the lattice of a cell from those of lower dimension: `free` axes along which it is in the middle. Where
   two axes are free: half the sum of the four edges less a quarter of the corners', three: half the sum of the six
   faces less a quarter of the twelve edges' and plus an eighth of the corners' */
static void interpolate(PetscInt dim, PetscInt at, PetscInt nfree, const PetscInt stride[3], PetscReal xc[])
{
  const PetscReal weight[4] = {nfree == 1 ? 0.5 : nfree == 2 ? -0.25 : 0.125, nfree == 2 ? 0.5 : -0.25, 0.5, 0};
  PetscReal       sum[3]    = {0, 0, 0};

  for (PetscInt i = 0; i < (nfree == 1 ? 3 : nfree == 2 ? 9 : 27); i++) {
    const PetscInt step[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    PetscInt       from = at, middle = 0;

    for (PetscInt k = 0; k < nfree; k++) {
      from += step[k] * stride[k];
      middle += step[k] == 0;
    }
    if (middle == nfree) continue;
    for (PetscInt d = 0; d < dim; d++) sum[d] += weight[middle] * xc[from * dim + d];
  }
  for (PetscInt d = 0; d < dim; d++) xc[at * dim + d] = sum[d];
}

/* lattice NULL: all but the corners are as with straight edges */
static void fill_slots(PetscInt dim, PetscInt nb, const PetscInt lattice[], PetscReal xc[])
{
  const PetscInt power[3] = {1, 3, 9};

  for (PetscInt wanted = 1; wanted <= dim; wanted++) {
    for (PetscInt j = 0; j < nb; j++) {
      PetscInt stride[3], nfree = 0;

      for (PetscInt d = 0; d < dim; d++)
        if (j / power[d] % 3 == 1) stride[nfree++] = power[d];
      if (nfree == wanted && (!lattice || lattice[j] < 0)) interpolate(dim, j, nfree, stride, xc);
    }
  }
}

void FileCellsPositions(const Msh *m, const FileCells *f, PetscInt c, PetscReal xc[])
{
  const PetscInt *lattice = f->lattice + c * f->nb;

  for (PetscInt j = 0; j < f->nb; j++)
    for (PetscInt d = 0; d < f->dim && lattice[j] >= 0; d++) xc[j * f->dim + d] = m->x[3 * lattice[j] + d];
  fill_slots(f->dim, f->nb, lattice, xc);
}

/* Does a cell differ from the one with straight edges? */
static PetscBool is_curved(const FileCells *f, const PetscReal xc[])
{
  const PetscInt n = f->nb * f->dim;
  PetscReal      straight[MESH_MAX_NB * 3], size = 0, max = 0;

  for (PetscInt i = 0; i < n; i++) straight[i] = xc[i];
  fill_slots(f->dim, f->nb, NULL, straight);
  for (PetscInt i = 0; i < n; i++) {
    size = PetscMax(size, PetscAbsReal(xc[i] - xc[i % f->dim]));
    max  = PetscMax(max, PetscAbsReal(xc[i] - straight[i]));
  }
  return (PetscBool)(max > 1e-11 * size);
}

/* Exchange the first two axes of a cell */
static void turn(const FileCells *f, PetscInt lattice[])
{
  for (PetscInt j = 0; j < f->nb; j++) {
    const PetscInt other = j / 9 * 9 + j % 3 * 3 + j / 3 % 3, node = lattice[j];

    if (other <= j) continue;
    lattice[j]     = lattice[other];
    lattice[other] = node;
  }
}

static void orient(const Msh *m, FileCells *f, char fault[])
{
  for (PetscInt c = 0; c < f->ncell && !*fault; c++) {
    PetscReal xc[MESH_MAX_NB * 3], smallest, volume;

    FileCellsPositions(m, f, c, xc);
    MeshMeasureCell(f->dim, xc, &smallest, &volume);
    if (volume < 0) {
      turn(f, f->lattice + c * f->nb);
      f->turned++;
      FileCellsPositions(m, f, c, xc);
      MeshMeasureCell(f->dim, xc, &smallest, &volume);
    }
    if (!f->curved && is_curved(f, xc)) f->curved = PETSC_TRUE;
    if (!(smallest > 0))
      (void)snprintf(fault, MSH_FAULT,
                     "has an inverted or flat cell, element %" PetscInt_FMT
                     " near (%g, %g%s%.6g) (Jacobian %g at a corner): repair the mesh",
                     f->number[c], (double)xc[0], (double)xc[1], f->dim == 3 ? ", " : "",
                     (double)(f->dim == 3 ? xc[2] : 0), (double)smallest);
  }
}

PetscErrorCode FileCellsFind(const Msh *m, FileCells *f, char fault[MSH_FAULT])
{
  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(f, sizeof(*f)));
  check_shapes(m, &f->dim, fault);
  if (*fault) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(collect(m, f, fault));
  if (!*fault && f->dim == 2) check_plane(m, f, fault);
  if (!*fault) orient(m, f, fault);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FileCellsClear(FileCells *f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree3(f->lattice, f->number, f->vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}
