/* Sample: see sample.h. */
#include "compat.h"
#include "report/sample.h"
#include "base/grid.h"
#include "base/hdf5.h"
#include "fem/element.h"
#include "points.h"
#include <dirent.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* A snapshot with its mesh, whole on every rank */
typedef struct {
  MPI_Comm   comm;
  PetscInt   dim, nb, npoint, ncell, width;
  PetscReal *x, *v; /* [npoint][3], [npoint][width] */
  PetscInt  *cell;  /* [ncell][nb] in the order of VTK */
  PetscReal  lower[3], upper[3];
  Grid       grid; /* of the cells */
} Snapshot;

/* ---- files ---- */

/* The largest step of files <stem>_<step>.h5 in the folder that is at most `most`; -1: none */
static PetscInt find_last(const char dir[], const char stem[], PetscInt bound)
{
  DIR           *d    = opendir(dir);
  PetscInt       last = -1;
  struct dirent *e;
  char           pattern[64];

  (void)snprintf(pattern, sizeof(pattern), "%s_%%d.h5%%n", stem);
  while (d && (e = readdir(d))) {
    int step, n = 0;

    if (sscanf(e->d_name, pattern, &step, &n) == 1 && n > 0 && !e->d_name[n] && step <= bound)
      last = PetscMax(last, step);
  }
  if (d) closedir(d);
  return last;
}

/* Rank 0: name[0] file of the fields, name[1] of their mesh; "": there is none */
static void find_files(const char path[], char name[2][PETSC_MAX_PATH_LEN])
{
  struct stat info;
  char        dir[PETSC_MAX_PATH_LEN];
  const char *slash = strrchr(path, '/');
  int         step = -1, n = 0;

  name[0][0] = name[1][0] = 0;
  if (stat(path, &info)) return;
  (void)snprintf(dir, sizeof(dir), "%s", path);
  if (S_ISDIR(info.st_mode)) step = (int)find_last(dir, "fields", PETSC_MAX_INT);
  else {
    if (slash) dir[slash - path] = 0;
    else (void)snprintf(dir, sizeof(dir), ".");
    if (sscanf(slash ? slash + 1 : path, "fields_%d.h5%n", &step, &n) != 1 || n == 0) return;
  }
  if (step < 0) return;
  n = (int)find_last(dir, "mesh", step); /* the mesh that was written last before */
  if (snprintf(name[0], PETSC_MAX_PATH_LEN, "%s/fields_%d.h5", dir, step) >= PETSC_MAX_PATH_LEN) name[0][0] = 0;
  if (n < 0 && snprintf(name[1], PETSC_MAX_PATH_LEN, "%s/mesh.h5", dir) >= PETSC_MAX_PATH_LEN) name[0][0] = 0;
  if (n >= 0 && snprintf(name[1], PETSC_MAX_PATH_LEN, "%s/mesh_%d.h5", dir, n) >= PETSC_MAX_PATH_LEN) name[0][0] = 0;
}

/* A dataset [rows][bs] of a file, whole, allocated */
static PetscErrorCode read_whole(MPI_Comm comm, const char option[], const char file[], const char name[],
                                 Hdf5Type type, PetscInt *rows, PetscInt *bs, void **v)
{
  Hdf5         h;
  PetscBool    open, good = PETSC_FALSE;
  const size_t size = type == HDF5_REAL ? sizeof(PetscReal) : sizeof(PetscInt);

  PetscFunctionBeginUser;
  *v = NULL;
  PetscCall(Hdf5Open(comm, file, &h, &open));
  if (open) {
    PetscCall(Hdf5GetSize(h, name, rows, bs));
    if (*rows > 0) {
      PetscCall(PetscMalloc((size_t)(*rows * PetscMax(1, *bs)) * size, v));
      PetscCall(Hdf5Read(h, name, type, (Hdf5Rows){.n = *rows, .start = 0, .total = *rows}, *bs, *v, &good));
    }
  }
  PetscCall(Hdf5Close(&h, NULL, 0));
  PetscCheck(good, comm, PETSC_ERR_FILE_READ,
             "%s: '%s' of %s cannot be read: give the output folder of a finished run that has it, or one of its fields_<step>.h5",
             option, name, file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_snapshot(const char option[], const char path[], const char field[], PetscInt dim,
                                    Snapshot *s)
{
  char        name[2][PETSC_MAX_PATH_LEN];
  PetscMPIInt rank;
  PetscInt    bs, n, nb;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(s->comm, &rank));
  if (rank == 0) find_files(path, name);
  PetscCallMPI(MPI_Bcast(name, sizeof(name), MPI_CHAR, 0, s->comm));
  PetscCheck(name[0][0], s->comm, PETSC_ERR_USER_INPUT,
             "%s %s: no fields there. Give the output folder of a run with -output_every or -output_interval, or a file fields_<step>.h5",
             option, path);
  PetscCall(read_whole(s->comm, option, name[1], "coordinates", HDF5_REAL, &s->npoint, &bs, (void **)&s->x));
  PetscCall(read_whole(s->comm, option, name[1], "cells", HDF5_INT, &s->ncell, &nb, (void **)&s->cell));
  PetscCall(read_whole(s->comm, option, name[0], field, HDF5_REAL, &n, &s->width, (void **)&s->v));
  s->width = PetscMax(1, s->width);
  PetscCheck(n == s->npoint, s->comm, PETSC_ERR_FILE_READ, "%s: %s and %s do not belong together", option, name[0],
             name[1]);
  s->dim = nb == 9 ? 2 : 3;
  s->nb  = nb;
  PetscCheck(s->dim == dim, s->comm, PETSC_ERR_USER_INPUT,
             "%s %s is a run in %" PetscInt_FMT " dimensions, this scene has %" PetscInt_FMT, option, path, s->dim,
             dim);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- places ---- */

/* Places of the nodes of cell c in the order of the lattice, and centre and half-width of a cube around them */
static void get_cell(const Snapshot *s, PetscInt c, PetscReal xc[], PetscReal middle[3], PetscReal *half)
{
  const PetscInt *order = PointsVtkOrder(s->dim);
  PetscReal       lo[3] = {0, 0, 0}, hi[3] = {0, 0, 0};

  for (PetscInt k = 0; k < s->nb; k++) {
    for (PetscInt d = 0; d < s->dim; d++) {
      const PetscReal x = s->x[3 * s->cell[c * s->nb + k] + d];

      xc[order[k] * s->dim + d] = x;
      lo[d]                     = k ? PetscMin(lo[d], x) : x;
      hi[d]                     = k ? PetscMax(hi[d], x) : x;
    }
  }
  *half = 0;
  for (PetscInt d = 0; d < 3; d++) {
    middle[d] = 0.5 * (lo[d] + hi[d]);
    *half     = PetscMax(*half, 0.51 * (hi[d] - lo[d]));
  }
}

static PetscErrorCode sort_cells(Snapshot *s)
{
  PetscReal xc[MESH_MAX_NB * 3], middle[3], half, widest = 0;

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < 3; d++) {
    s->lower[d] = PETSC_MAX_REAL;
    s->upper[d] = -PETSC_MAX_REAL;
    for (PetscInt i = 0; i < s->npoint; i++) {
      s->lower[d] = PetscMin(s->lower[d], s->x[3 * i + d]);
      s->upper[d] = PetscMax(s->upper[d], s->x[3 * i + d]);
    }
    widest = PetscMax(widest, s->upper[d] - s->lower[d]);
  }
  PetscCall(GridCreate(s->dim, s->lower, s->upper, widest / PetscPowReal((PetscReal)s->ncell, 1. / s->dim),
                       4 * s->ncell + 64, &s->grid));
  for (PetscInt c = 0; c < s->ncell; c++) {
    get_cell(s, c, xc, middle, &half);
    PetscCall(GridInsert(s->grid, c, middle, half));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* v [n] at x [3], by the cell in which x lies deepest; false: in none */
static PetscBool evaluate(const Snapshot *s, const PetscReal x[3], PetscInt n, PetscReal v[])
{
  const PetscInt *order = PointsVtkOrder(s->dim);
  PetscReal       best = 1 + 1e-6, xi_best[3] = {0, 0, 0}, phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB];
  PetscInt        cell = -1;

  for (PetscInt e = GridFirst(s->grid, x); e >= 0; e = GridNext(s->grid, e)) {
    PetscReal xc[MESH_MAX_NB * 3], xi[3] = {0, 0, 0}, middle[3], half, far = 0;

    get_cell(s, GridItem(s->grid, e), xc, middle, &half);
    for (PetscInt d = 0; d < s->dim; d++) far = PetscMax(far, PetscAbsReal(x[d] - middle[d]) - half);
    if (far > 0 || !ElementLocate(s->dim, xc, x, xi)) continue;
    for (PetscInt d = 0; d < s->dim; d++) far = PetscMax(far, PetscAbsReal(xi[d]));
    if (far > best || (far == best && cell >= 0)) continue;
    best = far;
    cell = GridItem(s->grid, e);
    for (PetscInt d = 0; d < s->dim; d++) xi_best[d] = PetscMax(-1, PetscMin(1, xi[d]));
  }
  if (cell < 0) return PETSC_FALSE;
  ElementBasis(s->dim, xi_best, phi, dphi);
  for (PetscInt d = 0; d < n; d++) v[d] = 0;
  for (PetscInt k = 0; k < s->nb; k++)
    for (PetscInt d = 0; d < n; d++) v[d] += phi[order[k]] * s->v[s->width * s->cell[cell * s->nb + k] + d];
  return PETSC_TRUE;
}

/* ---- public ---- */

PetscErrorCode SampleField(const char option[], const char path[], const char field[], PetscInt width, Mesh mesh,
                           const PetscReal at[], PetscReal v[], PetscReal box[2][3], SampleCount *count)
{
  const MeshLocal *l;
  Snapshot         s    = {0};
  PetscInt         n[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetComm(mesh, &s.comm));
  PetscCall(read_snapshot(option, path, field, l->dim, &s));
  PetscCall(sort_cells(&s));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal x[3] = {0, 0, 0}, beyond = 0;

    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscReal tolerance = 1e-9 * (s.upper[a] - s.lower[a]);

      x[a] = at[i * l->dim + a];
      if (l->period[a] > 0 && x[a] < s.lower[a] - tolerance)
        x[a] += l->period[a] * PetscCeilReal((s.lower[a] - tolerance - x[a]) / l->period[a]);
      if (l->period[a] > 0 && x[a] > s.upper[a] + tolerance)
        x[a] -= l->period[a] * PetscCeilReal((x[a] - s.upper[a] - tolerance) / l->period[a]);
      beyond = PetscMax(beyond, PetscMax(s.lower[a] - x[a], x[a] - s.upper[a]) - tolerance);
      x[a]   = PetscMax(s.lower[a], PetscMin(s.upper[a], x[a]));
    }
    if (!evaluate(&s, x, width, v + i * width)) n[2]++;
    else if (beyond > 0) n[1]++;
    else n[0]++;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, n, 3, MPIU_INT, MPI_SUM, s.comm));
  *count = (SampleCount){n[0], n[1], n[2]};
  PetscCall(MeshSyncNodes(mesh, width, v));
  PetscCall(PetscArraycpy(box[0], s.lower, 3));
  PetscCall(PetscArraycpy(box[1], s.upper, 3));
  PetscCall(GridDestroy(&s.grid));
  PetscCall(PetscFree(s.x));
  PetscCall(PetscFree(s.v));
  PetscCall(PetscFree(s.cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}
