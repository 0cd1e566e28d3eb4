/* Helpers of the tests of the numerical core: options, meshes, numbers that do not depend on the number of ranks,
   comparisons that print. */
#pragma once
#include "compat.h"
#include "mesh/mesh.h"
#include "base/opt.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#define OK(call) assert_int_equal(call, 0)
/* cmocka's own comparison of floats is single precision */
#define NEAR(got, want, tolerance) \
  near_at((PetscReal)(got), (PetscReal)(want), (PetscReal)(tolerance), #got, __FILE__, __LINE__)
#define BELOW(got, bound) near_at((PetscReal)(got), 0, (PetscReal)(bound), #got, __FILE__, __LINE__)

static inline void near_at(PetscReal got, PetscReal want, PetscReal tolerance, const char text[], const char file[],
                           int line)
{
  if (PetscAbsReal(got - want) <= tolerance) return;
  print_error("%s is %.17g, expected %.17g within %.3g\n", text, (double)got, (double)want, (double)tolerance);
  _fail(file, line);
}

/* Errors on two meshes (or with two steps), each half the one before, must fall with this rate */
static inline void expect_rate(const char what[], PetscReal coarse, PetscReal fine, PetscReal rate)
{
  const PetscReal got = PetscLog2Real(coarse / fine);

  if (got < rate - 0.25 || got > rate + 1)
    fail_msg("%s: errors %g and %g give rate %.2f, expected %g (-0.25, +1)", what, (double)coarse, (double)fine,
             (double)got, (double)rate);
}

/* ---- numbers ---- */

static inline PetscReal total(PetscReal x)
{
  OK(MPI_Allreduce(MPI_IN_PLACE, &x, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  return x;
}

static inline PetscReal largest(PetscReal x)
{
  OK(MPI_Allreduce(MPI_IN_PLACE, &x, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  return x;
}

/* A number in [-1, 1] that looks random and depends on the key alone (integer mixing of splitmix64, Steele et al.
   2014) */
static inline PetscReal noise(PetscInt key)
{
  uint64_t z = ((uint64_t)key + 1) * 0x9e3779b97f4a7c15u;

  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return (PetscReal)((z ^ (z >> 31)) >> 11) / 4503599627370496.0 - 1;
}

/* Noise that does not depend on the number of ranks */
static inline void fill_noise_vec(PetscInt seed, Vec v)
{
  PetscInt   first, last;
  PetscReal *a;

  OK(VecGetOwnershipRange(v, &first, &last));
  OK(VecGetArray(v, &a));
  for (PetscInt i = first; i < last; i++) a[i - first] = noise(seed * 10007 + i);
  OK(VecRestoreArray(v, &a));
}

/* Noise on nodes [nnode_all][dim] (ghosts agree with their owners) and on pressures [own cells][dim + 1] */
static inline void fill_noise(const MeshLocal *l, PetscInt seed, PetscReal v[])
{
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++)
    v[i] = noise(seed * 1000003 + l->node_global[i / l->dim] * l->dim + i % l->dim);
}

static inline void fill_noise_pressure(const MeshLocal *l, PetscInt seed, PetscReal q[])
{
  const PetscInt nk = l->dim + 1;

  for (PetscInt i = 0; i < l->ncell * nk; i++) q[i] = noise(seed * 1000003 + l->cell_start * nk + i);
}

typedef void (*Field)(const PetscReal x[], PetscReal v[]);

static inline void fill_field(const MeshLocal *l, Field field, PetscReal v[])
{
  for (PetscInt i = 0; i < l->nnode_all; i++) field(l->x + i * l->dim, v + i * l->dim);
}

/* Over the own values of all ranks */
static inline PetscReal dot(PetscInt n, const PetscReal a[], const PetscReal b[])
{
  PetscReal sum = 0;

  for (PetscInt i = 0; i < n; i++) sum += a[i] * b[i];
  return total(sum);
}

static inline PetscReal max_difference(PetscInt n, const PetscReal a[], const PetscReal b[])
{
  PetscReal top = 0;

  for (PetscInt i = 0; i < n; i++) top = PetscMax(top, PetscAbsReal(a[i] - b[i]));
  return largest(top);
}

static inline PetscReal max_abs(PetscInt n, const PetscReal a[])
{
  PetscReal top = 0;

  for (PetscInt i = 0; i < n; i++) top = PetscMax(top, PetscAbsReal(a[i]));
  return largest(top);
}

/* ---- scenes ---- */

/* These options and nothing else: no defaults of an earlier scene either */
static inline void give(const char options[])
{
  OK(OptFinalize());
  OK(PetscOptionsClear(NULL));
  OK(PetscOptionsInsertString(NULL, options));
}

static inline PetscInt vertex_number(const PetscInt n[3], PetscInt i, PetscInt j, PetscInt k)
{
  return 1 + i + (n[0] + 1) * (j + (n[1] + 1) * k);
}

/* Gmsh 2.2 file of the box [0, 1.5] x [0, 1] (x [0, 1]) with n cells along each axis, inner vertices displaced by up to
   0.2 cells: cells that are no parallelograms. One boundary, "wall". */
static inline void write_skewed_mesh(const char name[], PetscInt dim, const PetscInt cells[3])
{
  const PetscInt  n[3]      = {cells[0], cells[1], dim == 3 ? cells[2] : 0};
  const PetscReal length[3] = {1.5, 1, 1};
  FILE           *f         = fopen(name, "w");
  PetscInt        nface = 0, ncell = 0;

  assert_non_null(f);
  fprintf(f,
          "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n%d 1 \"wall\"\n%d 2 \"fluid\"\n$EndPhysicalNames\n$Nodes\n%d\n",
          (int)dim - 1, (int)dim, (int)((n[0] + 1) * (n[1] + 1) * (n[2] + 1)));
  for (PetscInt v = 0; v < (n[0] + 1) * (n[1] + 1) * (n[2] + 1); v++) {
    const PetscInt at[3] = {v % (n[0] + 1), v / (n[0] + 1) % (n[1] + 1), v / ((n[0] + 1) * (n[1] + 1))};
    PetscReal      x[3]  = {0, 0, 0};

    for (PetscInt d = 0; d < dim; d++) {
      const PetscInt on_face = (dim == 3 && (at[2] == 0 || at[2] == n[2])) || at[0] == 0 || at[0] == n[0] ||
                               at[1] == 0 || at[1] == n[1];

      x[d] = length[d] * (at[d] + (on_face ? 0 : 0.2 * noise(3 * v + d))) / n[d];
    }
    fprintf(f, "%d %.17g %.17g %.17g\n", (int)v + 1, (double)x[0], (double)x[1], (double)x[2]);
  }
  ncell = n[0] * n[1] * (dim == 3 ? n[2] : 1);
  nface = dim == 2 ? 2 * (n[0] + n[1]) : 2 * (n[0] * n[1] + n[1] * n[2] + n[0] * n[2]);
  fprintf(f, "$EndNodes\n$Elements\n%d\n", (int)(ncell + nface));
  nface = 0;
  for (PetscInt c = 0; c < ncell; c++) {
    const PetscInt at[3] = {c % n[0], c / n[0] % n[1], c / (n[0] * n[1])};

    for (PetscInt d = 0; d < dim; d++) { /* faces of this cell on the boundary */
      for (PetscInt side = 0; side < 2; side++) {
        const PetscInt e = (d + 1) % dim, g = (d + 2) % dim, walk[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};

        if (at[d] != (side ? n[d] - 1 : 0)) continue;
        fprintf(f, "%d %d 2 1 1", (int)++nface, dim == 2 ? 1 : 3);
        for (PetscInt q = 0; q < 2 * (dim - 1); q++) {
          PetscInt p[3] = {at[0], at[1], at[2]};

          p[d] += side;
          p[e] += walk[q][0];
          if (dim == 3) p[g] += walk[q][1];
          fprintf(f, " %d", (int)vertex_number(n, p[0], p[1], p[2]));
        }
        fprintf(f, "\n");
      }
    }
  }
  for (PetscInt c = 0; c < ncell; c++) {
    const PetscInt i = c % n[0], j = c / n[0] % n[1], k = c / (n[0] * n[1]);

    fprintf(f, "%d %d 2 2 2", (int)(nface + c) + 1, dim == 2 ? 3 : 5);
    for (PetscInt up = 0; up < dim - 1; up++)
      fprintf(f, " %d %d %d %d", (int)vertex_number(n, i, j, k + up), (int)vertex_number(n, i + 1, j, k + up),
              (int)vertex_number(n, i + 1, j + 1, k + up), (int)vertex_number(n, i, j + 1, k + up));
    fprintf(f, "\n");
  }
  fprintf(f, "$EndElements\n");
  fclose(f);
}

/* The skewed mesh, through a file that is gone afterwards. Collective. */
static inline void create_skewed_mesh(PetscInt dim, const PetscInt n[3], Mesh *mesh)
{
  char        name[64];
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  snprintf(name, sizeof(name), "/tmp/tumble-skewed-%d.msh", (int)getpid());
  OK(MPI_Bcast(name, sizeof(name), MPI_CHAR, 0, PETSC_COMM_WORLD));
  if (!rank) write_skewed_mesh(name, dim, n);
  OK(PetscOptionsSetValue(NULL, "-mesh_kind", "file"));
  OK(PetscOptionsSetValue(NULL, "-mesh_file", name));
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  OK(MeshCreate(PETSC_COMM_WORLD, mesh));
  if (!rank) unlink(name);
}
