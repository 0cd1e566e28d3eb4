/* Solids in space, layer: see space.h. Nodes: those of the mesh keep their numbers and are the inner side of the layer;
   a node k of the surface has two more, half way and outside. */
#include "compat.h"
#include "space.h"
#include "base/algebra.h"
#include "base/face.h"
#include "fem/element.h"
#include "fem/gauss.h"

#define POOR      0.1  /* smallest over largest determinant of a cell: such meshes get a layer */
#define THICKNESS 0.35 /* of the layer, cells of the box mesh */
#define SWEEPS    6
#define WEIGHT    0.5 /* of the mean of its neighbours, in a sweep */

static const PetscInt STEP[3] = {1, 3, 9}; /* from a node of a cell to the next */

typedef struct {
  PetscInt   nnode, ncell;
  PetscReal *X;                /* [nnode][3] */
  PetscInt  *cell_node;        /* [ncell][27] */
  PetscBool *vertex, *outside; /* [nnode] */
} Layered;

/* Smallest over largest determinant at the quadrature points, the smallest of all cells */
static PetscReal find_quality(PetscInt ncell, const PetscInt cell_node[], const PetscReal X[])
{
  PetscReal quality = 1;

  for (PetscInt c = 0; c < ncell; c++) {
    PetscReal xc[81], smallest = PETSC_MAX_REAL, largest = 0;

    for (PetscInt e = 0; e < 81; e++) xc[e] = X[3 * cell_node[27 * c + e / 3] + e % 3];
    for (PetscInt q = 0; q < 27; q++) {
      const PetscReal xi[3] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3 % 3], GAUSS3_POINT[q / 9]};
      PetscReal       x[3], J[9], det;

      ElementMap(3, xc, xi, x, J);
      det      = DenseDeterminant(3, J);
      smallest = PetscMin(smallest, det);
      largest  = PetscMax(largest, det);
    }
    quality = PetscMin(quality, largest > 0 ? smallest / largest : -1);
  }
  return quality;
}

/* n [nnode][3]: unit normals at the nodes of the surface, outwards, zero elsewhere */
static void find_normals(const SolidMesh *m, PetscReal n[])
{
  for (PetscInt f = 0; f < m->nside; f++) {
    PetscReal p[9][3], at[3];

    for (PetscInt e = 0; e < 27; e++) p[e / 3][e % 3] = m->X[3 * m->side[9 * f + e / 3] + e % 3];
    for (PetscInt j = 0; j < 9; j++) {
      FaceNodeNormal(p, j, at);
      for (PetscInt a = 0; a < 3; a++) n[3 * m->side[9 * f + j] + a] += at[a];
    }
  }
  for (PetscInt i = 0; i < m->nnode; i++) {
    const PetscReal norm = PetscSqrtReal(dot3(n + 3 * i, n + 3 * i));

    for (PetscInt a = 0; a < 3 && norm > 0; a++) n[3 * i + a] /= norm;
  }
}

/* Cells of the mesh, and one on each face of its surface */
static PetscErrorCode create_layered(const SolidMesh *m, Layered *l)
{
  PetscReal *n;
  PetscInt  *number, ns = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(3 * m->nnode, &n, m->nnode, &number));
  find_normals(m, n);
  for (PetscInt i = 0; i < m->nnode; i++) number[i] = dot3(n + 3 * i, n + 3 * i) > 0 ? ns++ : -1;
  *l = (Layered){.nnode = m->nnode + 2 * ns, .ncell = m->ncell + m->nside};
  PetscCall(PetscMalloc2(3 * l->nnode, &l->X, 27 * l->ncell, &l->cell_node));
  PetscCall(PetscCalloc2(l->nnode, &l->vertex, l->nnode, &l->outside));
  PetscCall(PetscArraycpy(l->cell_node, m->cell_node, 27 * m->ncell));
  for (PetscInt i = 0; i < m->nnode; i++)
    for (PetscInt a = 0; a < 3; a++) {
      const PetscReal X = m->X[3 * i + a], inwards = THICKNESS * m->h * n[3 * i + a];

      l->X[3 * i + a] = X - inwards;
      for (PetscInt side = 0; side < 2 && number[i] >= 0; side++)
        l->X[3 * (m->nnode + 2 * number[i] + side) + a] = X - (side ? 0 : 0.5) * inwards;
      if (number[i] >= 0) l->outside[m->nnode + 2 * number[i] + 1] = PETSC_TRUE;
    }
  for (PetscInt e = 0; e < 27 * m->nside; e++) {
    const PetscInt i = m->side[9 * (e / 27) + e % 9], level = e % 27 / 9;

    l->cell_node[27 * m->ncell + e] = level ? m->nnode + 2 * number[i] + level - 1 : i;
  }
  for (PetscInt e = 0; e < 27 * l->ncell; e++)
    if (e % 3 != 1 && e % 27 / 3 % 3 != 1 && e % 27 / 9 != 1) l->vertex[l->cell_node[e]] = PETSC_TRUE;
  PetscCall(PetscFree2(n, number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Vertices inside go towards the mean of their neighbours */
static PetscErrorCode smooth_vertices(Layered *l)
{
  PetscReal *sum, *count;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(3 * l->nnode, &sum, l->nnode, &count));
  for (PetscInt sweep = 0; sweep < SWEEPS; sweep++) {
    PetscCall(PetscArrayzero(sum, 3 * l->nnode));
    PetscCall(PetscArrayzero(count, l->nnode));
    for (PetscInt e = 0; e < 27 * l->ncell; e++) {
      const PetscInt i = l->cell_node[e];

      for (PetscInt d = 0; d < 3 && l->vertex[i]; d++) {
        const PetscInt to = l->cell_node[e % 27 / STEP[d] % 3 ? e - 2 * STEP[d] : e + 2 * STEP[d]];

        for (PetscInt a = 0; a < 3; a++) sum[3 * i + a] += l->X[3 * to + a];
        count[i] += 1;
      }
    }
    for (PetscInt i = 0; i < l->nnode; i++)
      for (PetscInt a = 0; a < 3 && l->vertex[i] && !l->outside[i]; a++)
        l->X[3 * i + a] += WEIGHT * (sum[3 * i + a] / count[i] - l->X[3 * i + a]);
  }
  PetscCall(PetscFree2(sum, count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes between vertices, but for those outside: edges, then faces and middles by transfinite interpolation */
static void place_between(Layered *l)
{
  for (PetscInt order = 1; order <= 3; order++)
    for (PetscInt e = 0; e < 27 * l->ncell; e++) {
      const PetscInt at[3] = {e % 3, e % 27 / 3 % 3, e % 27 / 9}, i = l->cell_node[e];
      PetscReal      sum[3] = {0, 0, 0};

      if ((at[0] == 1) + (at[1] == 1) + (at[2] == 1) != order || l->outside[i]) continue;
      for (PetscInt k = 0; k < 27; k++) { /* the corner, edge or face of the cell that is there from here */
        const PetscInt way[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
        PetscInt       to = e, off = 0;
        PetscBool      in = PETSC_TRUE;

        for (PetscInt d = 0; d < 3; d++) {
          in = (PetscBool)(in && (at[d] == 1 || !way[d]));
          to += way[d] * STEP[d];
          off += way[d] != 0;
        }
        if (!in || !off) continue;
        for (PetscInt a = 0; a < 3; a++)
          sum[a] += (off % 2 ? 1 : -1) * PetscPowRealInt(0.5, (int)off) * l->X[3 * l->cell_node[to] + a];
      }
      for (PetscInt a = 0; a < 3; a++) l->X[3 * i + a] = sum[a];
    }
}

PetscErrorCode SolidAddLayer(const SolidMesh *m, PetscInt *nnode, PetscReal **X, PetscInt *ncell, PetscInt **cell_node)
{
  const PetscReal quality = find_quality(m->ncell, m->cell_node, m->X);
  Layered         l;

  PetscFunctionBeginUser;
  *ncell = 0;
  if (quality >= POOR) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(create_layered(m, &l));
  PetscCall(smooth_vertices(&l));
  place_between(&l);
  PetscCall(PetscFree2(l.vertex, l.outside));
  if (find_quality(l.ncell, l.cell_node, l.X) > quality) {
    *nnode     = l.nnode;
    *X         = l.X;
    *ncell     = l.ncell;
    *cell_node = l.cell_node;
  } else PetscCall(PetscFree2(l.X, l.cell_node));
  PetscFunctionReturn(PETSC_SUCCESS);
}
