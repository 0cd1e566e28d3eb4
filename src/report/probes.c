/* Probes: see probes.h. A place belongs to the cell of the lowest global number that holds it, so that one rank alone
   evaluates the element there. */
#include "compat.h"
#include "probes.h"
#include "fem/element.h"
#include "base/opt.h"

#define NEAR 1e-9 /* beyond a cell in its reference coordinates */

struct _p_Probes {
  MPI_Comm         comm;
  Flow             flow;
  Monitor          monitor;
  const MeshLocal *loc;
  PetscInt         n, dim, column, moves, meshes; /* of the mesh in which they were found */
  PetscReal       *x, *phi, *v;                   /* [n][dim], [n][nb], [n][dim] scratch */
  PetscInt        *cell;                          /* [n] local, or -1: another rank's */
};

/* Does own cell c hold x? Then the basis there */
static PetscErrorCode try_cell(Probes p, Mesh mesh, PetscInt c, const PetscReal x[], PetscReal phi[], PetscBool *inside)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim;
  PetscReal        xc[MESH_MAX_NB * 3], xi[3] = {0, 0, 0}, y[3], size = 0, away = 0, dphi[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  *inside = PETSC_FALSE;
  PetscCall(MeshCellCoordinates(mesh, c, xc));
  for (PetscInt a = 0; a < dim; a++) {
    y[a] = xc[l->nb / 2 * dim + a] + MeshNearest(l, a, x[a] - xc[l->nb / 2 * dim + a]);
    away += PetscSqr(y[a] - xc[l->nb / 2 * dim + a]);
  }
  for (PetscInt j = 0; j < l->nb; j++) {
    PetscReal r = 0;

    for (PetscInt a = 0; a < dim; a++) r += PetscSqr(xc[j * dim + a] - xc[l->nb / 2 * dim + a]);
    size = PetscMax(size, r);
  }
  if (away > 1.5 * size || !ElementLocate(dim, xc, y, xi)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < dim; a++)
    if (PetscAbsReal(xi[a]) > 1 + NEAR) PetscFunctionReturn(PETSC_SUCCESS);
  ElementBasis(dim, xi, phi, dphi);
  *inside = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_cells(Probes p)
{
  Mesh mesh;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMesh(p->flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &p->loc));
  p->moves  = p->loc->moves;
  p->meshes = p->loc->meshes;
  for (PetscInt i = 0; i < p->n; i++) {
    PetscInt  best = PETSC_MAX_INT, lowest;
    PetscBool inside;
    PetscReal phi[MESH_MAX_NB];

    p->cell[i] = -1;
    for (PetscInt c = 0; c < p->loc->ncell; c++) {
      PetscCall(try_cell(p, mesh, c, p->x + i * p->dim, phi, &inside));
      if (!inside || p->loc->cell_global[c] > best) continue;
      best       = p->loc->cell_global[c];
      p->cell[i] = c;
      PetscCall(PetscArraycpy(p->phi + i * p->loc->nb, phi, p->loc->nb));
    }
    PetscCall(MPIU_Allreduce(&best, &lowest, 1, MPIU_INT, MPI_MIN, p->comm));
    PetscCheck(lowest < PETSC_MAX_INT, p->comm, PETSC_ERR_USER_INPUT,
               "Option -monitor_probes: probe %" PetscInt_FMT
               " of x = %g, y = %g lies in no cell of the mesh: move it into the domain",
               i, (double)p->x[i * p->dim], (double)p->x[i * p->dim + 1]);
    if (best > lowest) p->cell[i] = -1;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProbesCreate(Flow flow, Monitor monitor, Probes *probes)
{
  Probes    p;
  PetscInt  n;
  PetscBool given;
  Mesh      mesh;

  PetscFunctionBeginUser;
  *probes = NULL;
  PetscCall(OptCountItems("-monitor_probes", &n));
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&p));
  p->comm    = MonitorComm(monitor);
  p->flow    = flow;
  p->monitor = monitor;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &p->loc));
  p->dim = p->loc->dim;
  PetscCheck(n % p->dim == 0, p->comm, PETSC_ERR_USER_INPUT,
             "Option -monitor_probes has %" PetscInt_FMT " numbers: give %" PetscInt_FMT " for each probe", n, p->dim);
  p->n = n / p->dim;
  PetscCall(PetscMalloc4(n, &p->x, p->n * p->loc->nb, &p->phi, n, &p->v, p->n, &p->cell));
  PetscCall(OptRealArray("-monitor_probes", n, p->x, &given));
  PetscCall(find_cells(p));
  for (PetscInt i = 0; i < n; i++) {
    char     name[64];
    PetscInt column;

    PetscCall(PetscSNPrintf(name, sizeof(name), "probe_%" PetscInt_FMT "_%c", i / p->dim, "uvw"[i % p->dim]));
    PetscCall(MonitorAddColumn(monitor, name, &column));
    if (!i) p->column = column;
  }
  *probes = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProbesDestroy(Probes *probes)
{
  PetscFunctionBeginUser;
  if (!*probes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4((*probes)->x, (*probes)->phi, (*probes)->v, (*probes)->cell));
  PetscCall(PetscFree(*probes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ProbesStep(Probes p)
{
  Mesh             mesh;
  const MeshLocal *l;
  PetscReal       *u;
  PetscMPIInt      count;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetMesh(p->flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  if (l->moves != p->moves || l->meshes != p->meshes) PetscCall(find_cells(p));
  PetscCall(FlowGetFields(p->flow, &u, NULL, NULL));
  PetscCall(PetscArrayzero(p->v, p->n * p->dim));
  for (PetscInt i = 0; i < p->n; i++) {
    PetscReal ul[MESH_MAX_NB * 3];

    if (p->cell[i] < 0) continue;
    MeshCellValues(l, p->cell[i], p->dim, u, ul);
    for (PetscInt j = 0; j < l->nb; j++)
      for (PetscInt a = 0; a < p->dim; a++) p->v[i * p->dim + a] += p->phi[i * l->nb + j] * ul[j * p->dim + a];
  }
  PetscCall(PetscMPIIntCast(p->n * p->dim, &count));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, p->v, count, MPIU_REAL, MPIU_SUM, p->comm));
  for (PetscInt i = 0; i < p->n * p->dim; i++) PetscCall(MonitorSetColumn(p->monitor, p->column + i, p->v[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
