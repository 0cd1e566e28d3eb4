/* CutCells: see cutcells.h. */
#include "compat.h"
#include "cutcells.h"
#include "base/algebra.h"
#include "base/array.h"
#include "fem/element.h"

#define MAX_SAMPLES CUT_MAX_SAMPLES
#define NPAIR       6 /* products of two of the three functions of an axis */
#define CHUNK       256
#define BOX         1e-10 /* nodes of a box are at their places to this share of its sides */

static const PetscInt PAIR[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

/* The 6 products in a register */
typedef PetscReal Pairs __attribute__((vector_size(8 * sizeof(PetscReal)), aligned(sizeof(PetscReal))));

struct _p_CutCells {
  Flow             flow;
  Bodies           bodies;
  BodyState       *s;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nsample;
  PetscReal        phi[MAX_SAMPLES][3], dphi[MAX_SAMPLES][3]; /* at the samples of an axis */
  Pairs            pair[MAX_SAMPLES];
  unsigned char    moment[MESH_MAX_NB * MESH_MAX_NB]; /* by two functions */
  PetscReal        reach;                             /* largest distance of a node from the centre node of its cell */
  PetscInt         ncut, cut_capacity, nmoments, moments_capacity;
  CutCell         *cut;
  PetscReal       *moments;
  PetscReal       *x, *d; /* work: samples of a cell, twice, and three numbers of each */
};

/* ---- sizes of cells ---- */

PetscErrorCode CutCellRadius(Mesh mesh, PetscInt cell, PetscReal *radius)
{
  const MeshLocal *l;
  PetscReal        xc[MESH_MAX_NB * 3], r2 = 0;
  const PetscReal *centre;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshCellCoordinates(mesh, cell, xc));
  centre = xc + (l->nb / 2) * l->dim;
  for (PetscInt j = 0; j < l->nb; j++) {
    PetscReal s = 0;

    for (PetscInt a = 0; a < l->dim; a++) s += PetscSqr(xc[j * l->dim + a] - centre[a]);
    r2 = PetscMax(r2, s);
  }
  *radius = 1.1 * PetscSqrtReal(r2);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellReach(Mesh mesh, PetscReal *reach)
{
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  *reach = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal radius;

    PetscCall(CutCellRadius(mesh, c, &radius));
    *reach = PetscMax(*reach, radius);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- samples of a cell ---- */

static PetscInt sample_count(CutCells p)
{
  return p->loc->dim == 2 ? p->nsample * p->nsample : p->nsample * p->nsample * p->nsample;
}

static PetscInt moment_count(CutCells p)
{
  return p->loc->dim == 2 ? NPAIR * NPAIR : NPAIR * NPAIR * NPAIR;
}

/* Of a cell in space that is a box with these edges: places are products of those along the axes */
static void set_samples_in_box(CutCells p, const PetscReal xc[], const PetscReal edge[], PetscReal x[], PetscReal w[])
{
  const PetscInt n = p->nsample, step[3] = {1, 3, 9};
  PetscReal      size = PetscPowRealInt(1.0 / n, 3), at[3][MAX_SAMPLES];

  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal *v = xc + a;

    size *= edge[a];
    for (PetscInt s = 0; s < n; s++)
      at[a][s] = p->phi[s][0] * v[0] + p->phi[s][1] * v[step[a] * 3] + p->phi[s][2] * v[2 * step[a] * 3];
  }
  for (PetscInt z = 0, q = 0; z < n; z++)
    for (PetscInt y = 0; y < n; y++)
      for (PetscInt i = 0; i < n; i++, q++) {
        x[q * 3]     = at[0][i];
        x[q * 3 + 1] = at[1][y];
        x[q * 3 + 2] = at[2][z];
        w[q]         = size;
      }
}

/* One axis after the other (sum factorisation): v holds the place and its slopes along the axes
   that are done, at what is still nodes (last axis) or samples already (first) */
static void set_samples_in_space(CutCells p, const PetscReal xc[], PetscReal x[], PetscReal w[])
{
  const PetscInt  n     = p->nsample;
  const PetscReal scale = PetscPowRealInt(2.0 / n, 3);

  for (PetscInt z = 0; z < n; z++) {
    PetscReal plane[9][2][3] = {{{0}}}; /* [node of the plane][place, slope along z][component] */

    for (PetscInt j = 0; j < 27; j++)
      for (PetscInt a = 0; a < 3; a++) {
        plane[j % 9][0][a] += p->phi[z][j / 9] * xc[j * 3 + a];
        plane[j % 9][1][a] += p->dphi[z][j / 9] * xc[j * 3 + a];
      }
    for (PetscInt y = 0; y < n; y++) {
      PetscReal line[3][3][3] = {{{0}}}; /* [node of the line][place, slope along y, along z][component] */

      for (PetscInt j = 0; j < 9; j++)
        for (PetscInt a = 0; a < 3; a++) {
          line[j % 3][0][a] += p->phi[y][j / 3] * plane[j][0][a];
          line[j % 3][1][a] += p->dphi[y][j / 3] * plane[j][0][a];
          line[j % 3][2][a] += p->phi[y][j / 3] * plane[j][1][a];
        }
      for (PetscInt i = 0; i < n; i++) {
        const PetscReal *f = p->phi[i], *g = p->dphi[i];
        const PetscInt   q = (z * n + y) * n + i;
        PetscReal        J[9];

        for (PetscInt a = 0; a < 3; a++) {
          x[q * 3 + a] = f[0] * line[0][0][a] + f[1] * line[1][0][a] + f[2] * line[2][0][a];
          J[a * 3]     = g[0] * line[0][0][a] + g[1] * line[1][0][a] + g[2] * line[2][0][a];
          J[a * 3 + 1] = f[0] * line[0][1][a] + f[1] * line[1][1][a] + f[2] * line[2][1][a];
          J[a * 3 + 2] = f[0] * line[0][2][a] + f[1] * line[1][2][a] + f[2] * line[2][2][a];
        }
        w[q] = scale * DenseDeterminant(3, J);
      }
    }
  }
}

static void set_samples_in_plane(CutCells p, const PetscReal xc[], PetscReal x[], PetscReal w[])
{
  const PetscInt  n     = p->nsample;
  const PetscReal scale = PetscPowRealInt(2.0 / n, 2);

  for (PetscInt y = 0; y < n; y++) {
    PetscReal line[3][2][2]; /* [node of the line][place, slope along y][component] */

    for (PetscInt j = 0; j < 3; j++)
      for (PetscInt a = 0; a < 2; a++) {
        line[j][0][a] = p->phi[y][0] * xc[j * 2 + a] + p->phi[y][1] * xc[(j + 3) * 2 + a] +
                        p->phi[y][2] * xc[(j + 6) * 2 + a];
        line[j][1][a] = p->dphi[y][0] * xc[j * 2 + a] + p->dphi[y][1] * xc[(j + 3) * 2 + a] +
                        p->dphi[y][2] * xc[(j + 6) * 2 + a];
      }
    for (PetscInt i = 0; i < n; i++) {
      const PetscReal *f = p->phi[i], *g = p->dphi[i];
      const PetscInt   q = y * n + i;
      PetscReal        J[4];

      for (PetscInt a = 0; a < 2; a++) {
        x[q * 2 + a] = f[0] * line[0][0][a] + f[1] * line[1][0][a] + f[2] * line[2][0][a];
        J[a * 2]     = g[0] * line[0][0][a] + g[1] * line[1][0][a] + g[2] * line[2][0][a];
        J[a * 2 + 1] = f[0] * line[0][1][a] + f[1] * line[1][1][a] + f[2] * line[2][1][a];
      }
      w[q] = scale * DenseDeterminant(2, J);
    }
  }
}

/* Places x [samples][dim] and volumes w [samples] of the samples of a cell with node coordinates xc. Is it a box in
   space? */
static PetscBool set_samples(CutCells p, const PetscReal xc[], PetscReal x[], PetscReal w[])
{
  const PetscInt dim = p->loc->dim;
  PetscReal      edge[3];
  PetscBool      box = (PetscBool)(dim == 3 && MeshIsBox(3, p->loc->nb, xc, BOX, edge));

  if (box) set_samples_in_box(p, xc, edge, x, w);
  else if (dim == 3) set_samples_in_space(p, xc, x, w);
  else set_samples_in_plane(p, xc, x, w);
  return box;
}

/* m [6]^dim: sums of the weights with the products of functions of each axis, first axis fastest */
static void sum_moments(CutCells p, const PetscReal w[], PetscReal m[])
{
  const PetscInt n = p->nsample, dim = p->loc->dim, planes = dim == 2 ? 1 : n, blocks = dim == 2 ? 1 : NPAIR;
  Pairs          sum[NPAIR][NPAIR] = {{{0}}};

  for (PetscInt z = 0; z < planes; z++) {
    Pairs plane[NPAIR] = {{0}};

    for (PetscInt y = 0; y < n; y++) {
      Pairs line = {0};

      for (PetscInt x = 0; x < n; x++) line += w[(z * n + y) * n + x] * p->pair[x];
      for (PetscInt j = 0; j < NPAIR; j++) plane[j] += p->pair[y][j] * line;
    }
    for (PetscInt k = 0; k < blocks; k++)
      for (PetscInt j = 0; j < NPAIR; j++) sum[k][j] += (dim == 2 ? 1 : p->pair[z][k]) * plane[j];
  }
  for (PetscInt e = 0; e < blocks * NPAIR * NPAIR; e++) m[e] = sum[e / (NPAIR * NPAIR)][e / NPAIR % NPAIR][e % NPAIR];
}

/* ---- parts of cells ---- */

/* Rows of samples along the first axis, of octant o of a box: *n of them from sample row[] on, each `length` long */
static void get_octant(const struct _p_CutCells *p, PetscInt o, PetscInt *n, PetscInt *length, PetscInt row[])
{
  const PetscInt all = p->nsample, half = all / 2;
  PetscInt       first[3], size[3];

  for (PetscInt a = 0; a < 3; a++) {
    first[a] = (o >> a) & 1 ? half : 0;
    size[a]  = (o >> a) & 1 ? all - half : half;
  }
  *n      = size[1] * size[2];
  *length = size[0];
  for (PetscInt r = 0; r < *n; r++) row[r] = ((first[2] + r / size[1]) * all + first[1] + r % size[1]) * all + first[0];
}

/* Distances of the samples of a box. An octant farther from the surface than `near` by that of its centre has the
   centre's: the signed distance changes by at most the way. *outside: all octants, on the outside. */
static PetscErrorCode measure_box(CutCells p, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal near,
                                  PetscBool *outside)
{
  const PetscInt all = sample_count(p);
  PetscReal     *x = p->x + 3 * all, *d = p->d + 2 * all, centre[8 * 3], dc[8], radius[8];
  PetscInt       n, length, row[MAX_SAMPLES * MAX_SAMPLES], m = 0;

  PetscFunctionBeginUser;
  for (PetscInt o = 0; o < 8; o++) {
    PetscReal square = 0;

    get_octant(p, o, &n, &length, row);
    for (PetscInt a = 0; a < 3; a++) {
      const PetscReal low = p->x[3 * row[0] + a], high = p->x[3 * (row[n - 1] + length - 1) + a];

      centre[3 * o + a] = 0.5 * (low + high);
      square += PetscSqr(0.5 * (high - low));
    }
    radius[o] = (1 + BOX) * PetscSqrtReal(square);
  }
  PetscCall(BodiesDistance(p->bodies, k, X, q, 8, centre, dc));
  *outside = PETSC_TRUE;
  for (PetscInt o = 0; o < 8; o++) {
    const PetscReal far = near + radius[o];

    if (dc[o] > far) continue;
    *outside = PETSC_FALSE;
    if (dc[o] < -far) continue;
    get_octant(p, o, &n, &length, row);
    for (PetscInt r = 0; r < n; r++, m += length) PetscCall(PetscArraycpy(x + 3 * m, p->x + 3 * row[r], 3 * length));
  }
  if (*outside) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesDistance(p->bodies, k, X, q, m, x, d));
  for (PetscInt o = 0; o < 8; o++) {
    const PetscBool far = (PetscBool)(PetscAbsReal(dc[o]) > near + radius[o]);

    get_octant(p, o, &n, &length, row);
    for (PetscInt r = 0; r < n; r++)
      for (PetscInt i = 0; i < length; i++) p->d[row[r] + i] = far ? dc[o] : *d++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Weights w [n] times the part of each sample that is inside at a distance d, which falls linearly over `width`: a loop
   for registers. Are all inside? */
static PetscBool take_inside(PetscInt n, PetscReal width, const PetscReal *restrict d, PetscReal *restrict w)
{
  PetscInt64 less = 0;

  for (PetscInt i = 0; i < n; i++) {
    const PetscReal part = 0.5 - d[i] / width, some = part > 0.0 ? part : 0.0, chi = some < 1.0 ? some : 1.0;

    less += chi < 1.0;
    w[i] *= chi;
  }
  return (PetscBool)(less == 0);
}

/* The part of a cell in a body near its surface: samples with the smoothed indicator; *whole if they are all inside,
   *volume 0 if none is; m: of others */
static PetscErrorCode cut_cell(CutCells p, PetscInt cell, PetscInt k, const PetscReal X[3], const PetscReal q[4],
                               PetscReal m[], PetscBool *whole, PetscReal *volume)
{
  const PetscInt   n = sample_count(p);
  const PetscReal *size;
  PetscReal        xc[MESH_MAX_NB * 3], *w = p->d + n, width;
  PetscBool        outside = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(p->flow, &size));
  PetscCall(MeshCellCoordinates(p->mesh, cell, xc));
  width   = size[cell] / p->nsample;
  *volume = 0;
  if (set_samples(p, xc, p->x, w) && p->nsample > 3) PetscCall(measure_box(p, k, X, q, 0.5 * width, &outside));
  else PetscCall(BodiesDistance(p->bodies, k, X, q, n, p->x, p->d));
  if (outside) PetscFunctionReturn(PETSC_SUCCESS);
  *whole = take_inside(n, width, p->d, w);
  for (PetscInt i = 0; i < n; i++) *volume += w[i];
  if (*volume > 0 && !*whole) sum_moments(p, w, m);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_cut_cell(CutCells p, PetscInt cell, PetscInt k, const PetscReal P[3], PetscBool whole,
                                   PetscReal volume)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(p->ncut + 1, &p->cut_capacity, &p->cut, sizeof(*p->cut), NULL));
  p->cut[p->ncut++] = (CutCell){.cell    = cell,
                                .body    = k,
                                .volume  = volume,
                                .moments = whole ? -1 : p->nmoments,
                                .P       = {P[0], P[1], P[2]}};
  if (!whole) p->nmoments += moment_count(p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cut_image(CutCells p, PetscInt k, const PetscReal X[3], const PetscReal q[4],
                                const PetscReal P[3])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim;
  const PetscReal  far = BodiesGetRadius(p->s, k) + p->reach;
  PetscReal        x[CHUNK * 3], d[CHUNK];
  const PetscReal *size;
  const PetscInt  *list;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(p->flow, &size));
  PetscCall(MeshNodesInBox(p->mesh, X, far, &n, &list));
  for (PetscInt i = 0; i < n;) {
    PetscInt cell[CHUNK], m = 0;

    for (; i < n && m < CHUNK; i++) {
      if (l->centre_cell[list[i]] < 0) continue;
      for (PetscInt a = 0; a < dim; a++) x[m * dim + a] = l->x[list[i] * dim + a];
      cell[m++] = l->centre_cell[list[i]];
    }
    PetscCall(BodiesDistance(p->bodies, k, X, q, m, x, d));
    for (PetscInt j = 0; j < m; j++) {
      PetscReal radius, volume = 0;
      PetscBool whole = PETSC_TRUE;

      if (d[j] > p->reach) continue;
      PetscCall(CutCellRadius(p->mesh, cell[j], &radius));
      if (d[j] > radius) continue;
      /* where the next cut cell puts its moments */
      PetscCall(
        ArrayReserve(p->nmoments + moment_count(p), &p->moments_capacity, &p->moments, sizeof(*p->moments), NULL));
      if (d[j] < -radius) volume = PetscPowRealInt(size[cell[j]], (int)dim);
      else PetscCall(cut_cell(p, cell[j], k, X, q, p->moments + p->nmoments, &whole, &volume));
      if (volume > 0) PetscCall(add_cut_cell(p, cell[j], k, P, whole, volume));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsCut(CutCells p, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal (*P)[3], const PetscBool omit[])
{
  PetscFunctionBeginUser;
  p->ncut = p->nmoments = 0;
  for (PetscInt k = 0; k < p->s->n; k++) {
    /* the mesh itself ends at bodies that are its holes */
    if ((omit && omit[k]) || BodiesGetGroup(p->s, k)->body_fitted) continue;
    for (DomainImages i = {0}; MeshNextImage(p->loc, X[k], BodiesGetRadius(p->s, k), &i);) {
      PetscReal Pi[3];

      for (PetscInt a = 0; a < 3; a++) Pi[a] = P[k][a] + (i.at[a] - X[k][a]);
      PetscCall(cut_image(p, k, i.at, q[k], Pi));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what is known of the parts ---- */

/* Moments of a whole cell */
static PetscErrorCode take_whole_cell(CutCells p, PetscInt cell, PetscReal m[])
{
  PetscReal xc[MESH_MAX_NB * 3], *w = p->d + sample_count(p);

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(p->mesh, cell, xc));
  (void)set_samples(p, xc, p->x, w);
  sum_moments(p, w, m);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsGetMoments(CutCells p, const CutCell *cut, PetscReal sigma, PetscReal moment[])
{
  PetscFunctionBeginUser;
  if (cut->moments < 0) PetscCall(take_whole_cell(p, cut->cell, moment));
  for (PetscInt e = 0; e < CUT_MOMENTS; e++)
    moment[e] = sigma * (cut->moments < 0 ? moment : p->moments + cut->moments)[e];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsGetMatrix(CutCells p, const CutCell *cut, PetscReal sigma, PetscReal pen[])
{
  const PetscInt   nb = p->loc->nb;
  PetscReal        whole[NPAIR * NPAIR * NPAIR];
  const PetscReal *m = cut->moments < 0 ? whole : p->moments + cut->moments;

  PetscFunctionBeginUser;
  if (cut->moments < 0) PetscCall(take_whole_cell(p, cut->cell, whole));
  for (PetscInt e = 0; e < nb * nb; e++) pen[e] = sigma * m[p->moment[e]];
  MeshCellMatrix(p->loc, cut->cell, 1, nb, pen);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsGet(CutCells p, PetscInt *n, const CutCell *cut[])
{
  PetscFunctionBeginUser;
  *n   = p->ncut;
  *cut = p->cut;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static void tabulate_samples(CutCells p)
{
  for (PetscInt s = 0; s < p->nsample; s++) {
    ElementLine((2 * s + 1.0) / p->nsample - 1, p->phi[s], p->dphi[s]);
    for (PetscInt a = 0; a < 3; a++)
      for (PetscInt b = a; b < 3; b++) p->pair[s][PAIR[a][b]] = p->phi[s][a] * p->phi[s][b];
  }
}

static void tabulate_moments(CutCells p)
{
  const PetscInt nb = p->loc->nb;

  for (PetscInt i = 0; i < nb; i++)
    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt z = p->loc->dim == 2 ? 0 : PAIR[i / 9][j / 9];

      p->moment[i * nb + j] = (unsigned char)((z * NPAIR + PAIR[(i / 3) % 3][(j / 3) % 3]) * NPAIR +
                                              PAIR[i % 3][j % 3]);
    }
}

PetscErrorCode CutCellsMeasureCells(CutCells p)
{
  PetscFunctionBeginUser;
  PetscCall(CutCellReach(p->mesh, &p->reach));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsCreate(Flow flow, Bodies bodies, PetscInt nsample, CutCells *cut_cells)
{
  CutCells p;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  p->flow    = flow;
  p->bodies  = bodies;
  p->nsample = nsample;
  PetscCall(BodiesGetState(bodies, &p->s));
  PetscCall(FlowGetMesh(flow, &p->mesh));
  PetscCall(MeshGetLocal(p->mesh, &p->loc));
  tabulate_samples(p);
  tabulate_moments(p);
  PetscCall(PetscMalloc2(2 * sample_count(p) * p->loc->dim, &p->x, 3 * sample_count(p), &p->d));
  PetscCall(CutCellsMeasureCells(p));
  *cut_cells = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsDestroy(CutCells *cut_cells)
{
  CutCells p = *cut_cells;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2(p->x, p->d));
  PetscCall(PetscFree(p->cut));
  PetscCall(PetscFree(p->moments));
  PetscCall(PetscFree(*cut_cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}
