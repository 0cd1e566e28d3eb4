/* SolidFields: see report/solidfields.h. */
#include "compat.h"
#include "report/solidfields.h"
#include "base/algebra.h"
#include "base/hdf5.h"
#include "files.h"
#include "points.h"

static const PetscInt    EDGE[3]     = {0, 2, 1}; /* in VTK's order */
static const char *const TOPOLOGY[4] = {"", "Edge_3", "Quadrilateral_9", "Hexahedron_27"};

static PetscInt count_cells(const SolidsState *s)
{
  PetscInt n = 0;

  for (PetscInt k = 0; k < s->n; k++) n += s->group[s->group_of[k]].mesh.ncell;
  return n;
}

/* Nodal vectors v [nnode][dim], less those of minus (may be NULL), with three components */
static PetscErrorCode write_nodal(Hdf5 file, const SolidsState *s, PetscInt n, const char name[], const PetscReal v[],
                                  const PetscReal minus[])
{
  PetscReal *w;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(3 * n, &w));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0; a < s->dim; a++) w[3 * i + a] = v[s->dim * i + a] - (minus ? minus[s->dim * i + a] : 0);
  PetscCall(Hdf5WriteReals(file, name, n, 3, w));
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Means over a cell: J, and the stress P F^T/J as xx yy zz xy xz yz */
static void measure_cell(const SolidGroup *g, PetscInt c, const PetscReal x[], PetscReal *J, PetscReal stress[6])
{
  static const PetscInt ROW[6] = {0, 1, 2, 0, 0, 1}, COLUMN[6] = {0, 1, 2, 1, 2, 2};
  const SolidMesh      *m      = &g->mesh;
  SolidMaterial         law    = g->material;
  PetscReal             volume = 0, xc[SOLID_MAX_N];

  law.bulk = 0; /* that is as much the flow's as the pressure, which is not here either */
  *J       = 0;
  for (PetscInt e = 0; e < 6; e++) stress[e] = 0;
  SolidGather(m, c, x, xc);
  for (PetscInt q = 0; q < m->nq; q++) {
    const PetscReal w = m->weight[c * m->nq + q];
    PetscReal       F[9], P[9], j;

    (void)SolidGradient(m, c, q, xc, F);
    j = SolidLawStress(m->dim, &law, F, P, NULL);
    *J += w * j;
    volume += w;
    for (PetscInt e = 0; e < 6; e++)
      for (PetscInt A = 0; A < m->nd && COLUMN[e] < m->dim && ROW[e] < m->dim; A++)
        stress[e] += w / j * P[ROW[e] * m->nd + A] * F[COLUMN[e] * m->nd + A];
  }
  *J /= volume;
  for (PetscInt e = 0; e < 6; e++) stress[e] /= volume;
}

/* Cells in VTK's order, with their numbers; rows: 0 but on rank 0 */
static PetscErrorCode write_cells(Hdf5 file, const SolidsState *s, PetscInt rows)
{
  const PetscInt  nb    = s->group[0].mesh.nb;
  const PetscInt *order = s->group[0].mesh.nd == 1 ? EDGE : PointsVtkOrder(s->group[0].mesh.nd);
  PetscInt       *cell, *solid, n = 0;
  PetscReal      *J, *stress;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(rows * nb, &cell, rows, &solid, rows, &J, 6 * rows, &stress));
  for (PetscInt k = 0; k < s->n && rows; k++) {
    const SolidGroup *g = s->group + s->group_of[k];

    for (PetscInt c = 0; c < g->mesh.ncell; c++, n++) {
      for (PetscInt j = 0; j < nb; j++) cell[n * nb + j] = s->first[k] + g->mesh.cell_node[c * nb + order[j]];
      solid[n] = k;
      measure_cell(g, c, s->x + s->dim * s->first[k], &J[n], stress + 6 * n);
    }
  }
  PetscCall(Hdf5WriteInts(file, "cells", rows, nb, cell));
  PetscCall(Hdf5WriteInts(file, "solid", rows, 1, solid));
  PetscCall(Hdf5WriteReals(file, "J", rows, 1, J));
  PetscCall(Hdf5WriteReals(file, "stress", rows, 6, stress));
  PetscCall(PetscFree4(cell, solid, J, stress));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int write_xdmf(const SolidsState *s, const char path[], const char file[], PetscReal time)
{
  const PetscInt ncell = count_cells(s);
  FILE          *f;
  int            err = XdmfBegin(path, NULL, &f);

  if (err) return err;
  fprintf(f, "      <Grid Name=\"solids\" GridType=\"Uniform\">\n        <Time Value=\"%.15g\"/>\n", (double)time);
  fprintf(f, "        <Topology TopologyType=\"%s\" NumberOfElements=\"%" PetscInt_FMT "\">",
          TOPOLOGY[s->group[0].mesh.nd], ncell);
  XdmfItem(f, PETSC_TRUE, ncell, s->group[0].mesh.nb, file, "cells");
  fprintf(f, "</Topology>\n        <Geometry GeometryType=\"XYZ\">");
  XdmfItem(f, PETSC_FALSE, s->nnode, 3, file, "coordinates");
  fprintf(f, "</Geometry>\n");
  XdmfAttribute(f, PETSC_FALSE, s->nnode, 3, "Node", "displacement", file, "displacement");
  XdmfAttribute(f, PETSC_FALSE, s->nnode, 3, "Node", "velocity", file, "velocity");
  XdmfAttribute(f, PETSC_TRUE, ncell, 1, "Cell", "solid", file, "solid");
  XdmfAttribute(f, PETSC_FALSE, ncell, 1, "Cell", "J", file, "J");
  XdmfAttribute(f, PETSC_FALSE, ncell, 6, "Cell", "stress", file, "stress");
  fprintf(f, "      </Grid>\n");
  return XdmfEnd(path, NULL, &f);
}

PetscErrorCode SolidFieldsWrite(MPI_Comm comm, Solids solids, const char dir[], PetscInt step, PetscReal time)
{
  SolidsState *s;
  PetscMPIInt  rank;
  PetscInt     n, one;
  Hdf5         file;
  char         name[64], path[PETSC_MAX_PATH_LEN];
  int          err = 0;

  PetscFunctionBeginUser;
  if (!solids) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(SolidsGetState(solids, &s));
  n   = rank ? 0 : s->nnode;
  one = rank ? 0 : 1;
  (void)snprintf(name, sizeof(name), "solid_%" PetscInt_FMT ".h5", step);
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, name));
  PetscCall(Hdf5Create(comm, path, &file));
  PetscCall(Hdf5WriteReals(file, "time", one, 1, &time));
  PetscCall(write_nodal(file, s, n, "coordinates", s->x, NULL));
  PetscCall(write_nodal(file, s, n, "displacement", s->x, s->X));
  PetscCall(write_nodal(file, s, n, "velocity", s->u, NULL));
  PetscCall(write_cells(file, s, rank ? 0 : count_cells(s)));
  PetscCall(FileCloseHdf5(comm, path, &file));
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/solid_%" PetscInt_FMT ".xdmf", dir, step));
  if (!rank) err = write_xdmf(s, path, name, time);
  PetscCall(FileCheck(comm, err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}
