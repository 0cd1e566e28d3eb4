/* CutCells: see cutcells.h. */
#include "compat.h"
#include "cutcells.h"
#include "base/algebra.h"
#include "base/array.h"
#include "fem/element.h"

#define MAX_SAMPLES CUT_MAX_SAMPLES
#define NPAIR       6 /* products of two of the three functions of an axis */
#define CHUNK       256
#define ROUND_OFF   1e-14
#define EVERYWHERE  1e100 /* radius of a ball that holds all */
#define BOX         1e-10 /* nodes of a box are at their places to this share of its sides */

static const PetscInt PAIR[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

/* The 6 products in a register */
typedef PetscReal Pairs __attribute__((vector_size(8 * sizeof(PetscReal)), aligned(sizeof(PetscReal))));

/* Samples of a cell from `first` on along each axis */
typedef struct {
  unsigned char first[3], size[3];
} SampleBlock;

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
  PetscReal       *moments, whole[CUT_MOMENTS]; /* of the last whole cell that was asked for */
  PetscReal       *x, *d;                       /* work: samples of a cell, and two numbers of each */
  PetscInt        *sample;
  unsigned char   *filled;       /* [samples] rows along the first axis that may have weights */
  SampleBlock     *block, *half; /* [samples] */
};

/* ---- samples of a cell ---- */

static PetscInt sample_count(CutCells p)
{
  return p->loc->dim == 2 ? p->nsample * p->nsample : p->nsample * p->nsample * p->nsample;
}

static PetscInt moment_count(CutCells p)
{
  return p->loc->dim == 2 ? NPAIR * NPAIR : NPAIR * NPAIR * NPAIR;
}

/* Of a cell in space that is a box: places along the axes and from one to the next, and the volume of each */
typedef struct {
  PetscReal at[3][MAX_SAMPLES], step[3], size;
} BoxSamples;

/* Is the cell one? Then b. */
static PetscBool set_samples_in_box(CutCells p, const PetscReal xc[], BoxSamples *b)
{
  const PetscInt n = p->nsample, step[3] = {1, 3, 9};
  PetscReal      edge[3];

  if (p->loc->dim == 2 || !MeshIsBox(3, p->loc->nb, xc, BOX, edge)) return PETSC_FALSE;
  b->size = PetscPowRealInt(1.0 / n, 3);
  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal *v = xc + a;

    b->step[a] = edge[a] / n;
    b->size *= edge[a];
    for (PetscInt s = 0; s < n; s++)
      b->at[a][s] = p->phi[s][0] * v[0] + p->phi[s][1] * v[step[a] * 3] + p->phi[s][2] * v[2 * step[a] * 3];
  }
  return PETSC_TRUE;
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

/* Places x [samples][dim] and volumes w [samples] of the samples of a cell with node coordinates xc */
static void set_samples(CutCells p, const PetscReal xc[], PetscReal x[], PetscReal w[])
{
  for (PetscInt r = 0; r < p->nsample * p->nsample; r++) p->filled[r] = 1;
  if (p->loc->dim == 3) set_samples_in_space(p, xc, x, w);
  else set_samples_in_plane(p, xc, x, w);
}

/* ---- moments ---- */

static void add_line(const struct _p_CutCells *p, PetscInt y, Pairs line, Pairs plane[NPAIR])
{
  for (PetscInt j = 0; j < NPAIR; j++) plane[j] += p->pair[y][j] * line;
}

static void add_plane(const struct _p_CutCells *p, PetscInt z, const Pairs plane[NPAIR], Pairs sum[NPAIR][NPAIR])
{
  for (PetscInt k = 0; k < (p->loc->dim == 2 ? 1 : NPAIR); k++)
    for (PetscInt j = 0; j < NPAIR; j++) sum[k][j] += (p->loc->dim == 2 ? 1 : p->pair[z][k]) * plane[j];
}

static void put_moments(CutCells p, Pairs sum[NPAIR][NPAIR], PetscReal m[])
{
  for (PetscInt k = 0; k < (p->loc->dim == 2 ? 1 : NPAIR); k++)
    for (PetscInt j = 0; j < NPAIR; j++)
      for (PetscInt i = 0; i < NPAIR; i++) *m++ = sum[k][j][i];
}

/* m [6]^dim: sums of the weights with the products of functions of each axis, first axis fastest; *volume: of the
   weights. Rows along the first axis that are not `filled` have none. */
static void sum_moments(CutCells p, const PetscReal w[], PetscReal m[], PetscReal *volume)
{
  const PetscInt n = p->nsample, planes = p->loc->dim == 2 ? 1 : n;
  Pairs          sum[NPAIR][NPAIR] = {{{0}}};
  PetscReal      v                 = 0;

  for (PetscInt z = 0; z < planes; z++) {
    Pairs     plane[NPAIR] = {{0}};
    PetscBool any          = PETSC_FALSE;

    for (PetscInt y = 0; y < n; y++, w += n) {
      Pairs line = {0};

      if (!p->filled[z * n + y]) continue;
      any = PETSC_TRUE;
      for (PetscInt x = 0; x < n; x++) {
        line += w[x] * p->pair[x];
        v += w[x];
      }
      add_line(p, y, line, plane);
    }
    if (any) add_plane(p, z, plane, sum);
  }
  put_moments(p, sum, m);
  *volume = v;
}

/* The same of a whole box with samples of this size: all rows are alike, and all planes */
static void sum_box(CutCells p, PetscReal size, PetscReal m[])
{
  const PetscInt n                 = p->nsample;
  Pairs          sum[NPAIR][NPAIR] = {{{0}}}, plane[NPAIR] = {{0}}, line = {0};

  for (PetscInt x = 0; x < n; x++) line += size * p->pair[x];
  for (PetscInt y = 0; y < n; y++) add_line(p, y, line, plane);
  for (PetscInt z = 0; z < n; z++) add_plane(p, z, plane, sum);
  put_moments(p, sum, m);
}

/* ---- parts of cells ---- */

/* All of a block is inside */
static void fill_block(CutCells p, const SampleBlock *b, PetscReal size, PetscReal w[])
{
  for (PetscInt z = b->first[2]; z < b->first[2] + b->size[2]; z++)
    for (PetscInt y = b->first[1]; y < b->first[1] + b->size[1]; y++) {
      const PetscInt row = z * p->nsample + y;

      p->filled[row] = 1;
      for (PetscInt x = b->first[0]; x < b->first[0] + b->size[0]; x++) w[row * p->nsample + x] = size;
    }
}

/* The eight halves of a block, and their centres */
static void halve_block(const SampleBlock *b, const BoxSamples *box, SampleBlock half[8], PetscReal centre[8 * 3])
{
  for (PetscInt o = 0; o < 8; o++)
    for (PetscInt a = 0; a < 3; a++) {
      const PetscInt low = b->size[a] / 2, upper = (o >> a) & 1;

      half[o].first[a]  = (unsigned char)(b->first[a] + (upper ? low : 0));
      half[o].size[a]   = (unsigned char)(upper ? b->size[a] - low : low);
      centre[3 * o + a] = 0.5 * (box->at[a][half[o].first[a]] + box->at[a][half[o].first[a] + half[o].size[a] - 1]);
    }
}

/* Half the diagonal of a block */
static PetscReal block_radius(const SampleBlock *b, const BoxSamples *box)
{
  PetscReal square = 0;

  for (PetscInt a = 0; a < 3; a++) square += PetscSqr(0.5 * (b->size[a] - 1) * box->step[a]);
  return (1 + BOX) * PetscSqrtReal(square);
}

/* Blocks of a box that may be within `near` of the surface, halved until no side has more than three samples: the
   signed distance changes by at most the way from their centres. Others inside get their weights, outside none. Are
   there none outside? */
static PetscErrorCode find_near_blocks(CutCells p, PetscInt k, const PetscReal X[3], const PetscReal q[4],
                                       PetscReal near, const BoxSamples *box, PetscInt *nblock, PetscReal w[],
                                       PetscBool *whole)
{
  PetscInt n = 1;

  PetscFunctionBeginUser;
  p->block[0] = (SampleBlock){
    .size = {(unsigned char)p->nsample, (unsigned char)p->nsample, (unsigned char)p->nsample}};
  for (PetscInt side = p->nsample; side > 3 && n > 0; side -= side / 2) {
    const PetscInt m = 8 * n;

    for (PetscInt b = 0; b < n; b++) halve_block(p->block + b, box, p->half + 8 * b, p->x + 24 * b);
    PetscCall(BodiesDistance(p->bodies, k, X, q, m, p->x, p->d));
    n = 0;
    for (PetscInt b = 0; b < m; b++) {
      const PetscReal far = near + block_radius(p->half + b, box);

      if (p->d[b] < -far) fill_block(p, p->half + b, box->size, w);
      else if (p->d[b] <= far) p->block[n++] = p->half[b];
      else *whole = PETSC_FALSE;
    }
  }
  *nblock = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* d [n]: distances, then the part of each sample that is inside, which falls linearly over `width`: loops for
   registers. Are all inside? */
static PetscBool take_inside(PetscInt n, PetscReal width, PetscReal d[])
{
  PetscInt less = 0;

  for (PetscInt i = 0; i < n; i++) {
    const PetscReal part = 0.5 - d[i] / width, some = part > 0.0 ? part : 0.0;

    d[i] = some < 1.0 ? some : 1.0;
  }
  for (PetscInt i = 0; i < n; i++) less |= d[i] < 1.0;
  return (PetscBool)(less == 0);
}

/* Weights w [samples] of the part of a box that is inside. *whole: all of it. */
static PetscErrorCode sample_box(CutCells p, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal width,
                                 const BoxSamples *box, PetscReal w[], PetscBool *whole)
{
  const PetscInt n      = p->nsample;
  PetscInt       nblock = 0, m = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(w, sample_count(p)));
  PetscCall(PetscArrayzero(p->filled, n * n));
  *whole = PETSC_TRUE;
  PetscCall(find_near_blocks(p, k, X, q, 0.5 * width, box, &nblock, w, whole));
  for (PetscInt b = 0; b < nblock; b++) {
    const unsigned char *first = p->block[b].first, *size = p->block[b].size;

    for (PetscInt z = first[2]; z < first[2] + size[2]; z++)
      for (PetscInt y = first[1]; y < first[1] + size[1]; y++) {
        const PetscInt row = z * n + y;

        p->filled[row] = 1;
        for (PetscInt x = first[0]; x < first[0] + size[0]; x++, m++) {
          p->x[3 * m]     = box->at[0][x];
          p->x[3 * m + 1] = box->at[1][y];
          p->x[3 * m + 2] = box->at[2][z];
          p->sample[m]    = row * n + x;
        }
      }
  }
  PetscCall(BodiesDistance(p->bodies, k, X, q, m, p->x, p->d));
  if (!take_inside(m, width, p->d)) *whole = PETSC_FALSE;
  for (PetscInt i = 0; i < m; i++) w[p->sample[i]] = box->size * p->d[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The part of a cell in a body near its surface: samples with the smoothed indicator; *whole if they are all inside,
   *volume 0 if none is; m: of others */
static PetscErrorCode cut_cell(CutCells p, PetscInt cell, PetscInt k, const PetscReal X[3], const PetscReal q[4],
                               PetscReal m[], PetscBool *whole, PetscReal *volume)
{
  const PetscInt   n = sample_count(p);
  const PetscReal *size;
  PetscReal        xc[MESH_MAX_NB * 3], *w = p->d + n, width;
  BoxSamples       box;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(p->flow, &size));
  PetscCall(MeshCellCoordinates(p->mesh, cell, xc));
  width = size[cell] / p->nsample;
  if (set_samples_in_box(p, xc, &box)) PetscCall(sample_box(p, k, X, q, width, &box, w, whole));
  else {
    set_samples(p, xc, p->x, w);
    PetscCall(BodiesDistance(p->bodies, k, X, q, n, p->x, p->d));
    *whole = take_inside(n, width, p->d);
    for (PetscInt i = 0; i < n; i++) w[i] *= p->d[i];
  }
  sum_moments(p, w, m, volume);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* part: of which body */
static PetscErrorCode add_cut_cell(CutCells p, const CutCell *part, PetscInt cell, PetscBool whole, PetscReal volume)
{
  CutCell *cut;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(p->ncut + 1, &p->cut_capacity, &p->cut, sizeof(*p->cut), NULL));
  cut          = p->cut + p->ncut++;
  *cut         = *part;
  cut->cell    = cell;
  cut->volume  = volume;
  cut->moments = whole ? -1 : p->nmoments;
  if (!whole) p->nmoments += moment_count(p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The radius of body k if its distance is that of a ball to round-off, inside and outside, else 0 */
static PetscErrorCode find_ball(CutCells p, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal *radius)
{
  const PetscReal r = BodiesGetDisc(p->s, k);
  PetscReal       x[16 * 3], d[16];

  PetscFunctionBeginUser;
  *radius = r;
  if (!(r > 0)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 16; i++)
    for (PetscInt a = 0; a < 3; a++)
      x[3 * i + a] = X[a] + ((i >> a) & 1 ? 1 : -1) * (a + 1) * r / PetscSqrtReal(14.0) * (i < 8 ? 0.9 : 1.1);
  PetscCall(BodiesDistance(p->bodies, k, X, q, 16, x, d));
  for (PetscInt i = 0; i < 16; i++)
    if (!(PetscAbsReal(PetscAbsReal(d[i]) - 0.1 * r) <=
          ROUND_OFF * (r + PetscAbsReal(X[0]) + PetscAbsReal(X[1]) + PetscAbsReal(X[2]))))
      *radius = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cut_image(CutCells p, PetscInt k, const PetscReal X[3], const PetscReal q[4],
                                const PetscReal P[3])
{
  const MeshLocal *l    = p->loc;
  const PetscInt   dim  = l->dim;
  const PetscReal  far  = BodiesGetRadius(p->s, k) + p->reach;
  CutCell          part = {.body = k, .P = {P[0], P[1], P[2]}, .X = {X[0], X[1], X[2]}};
  PetscReal        x[CHUNK * 3], d[CHUNK];
  const PetscReal *size;
  const PetscInt  *list;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(p->flow, &size));
  if (dim == 3 && FlowGetQueue(p->flow)) PetscCall(find_ball(p, k, X, q, &part.radius));
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
      if (volume > 0) PetscCall(add_cut_cell(p, &part, cell[j], whole, volume));
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

static PetscErrorCode take_whole_cell(CutCells p, PetscInt cell, PetscReal m[])
{
  PetscReal  xc[MESH_MAX_NB * 3], *w = p->d + sample_count(p), volume;
  BoxSamples box;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(p->mesh, cell, xc));
  if (set_samples_in_box(p, xc, &box)) sum_box(p, box.size, m);
  else {
    set_samples(p, xc, p->x, w);
    sum_moments(p, w, m, &volume);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsGetMoments(CutCells p, const CutCell *cut, const PetscReal *moment[])
{
  PetscFunctionBeginUser;
  *moment = cut->moments < 0 ? p->whole : p->moments + cut->moments;
  if (cut->moments < 0) PetscCall(take_whole_cell(p, cut->cell, p->whole));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void CutCellsGetMatrix(CutCells p, const CutCell *cut, const PetscReal moment[], PetscReal sigma, PetscReal pen[])
{
  const PetscInt nb = p->loc->nb;

  for (PetscInt e = 0; e < nb * nb; e++) pen[e] = sigma * moment[p->moment[e]];
  MeshCellMatrix(p->loc, cut->cell, 1, nb, pen);
}

PetscErrorCode CutCellsGetBall(CutCells p, const CutCell *cut, PetscReal sigma, DeviceBall *ball)
{
  PetscReal        xc[MESH_MAX_NB * 3];
  const PetscReal *size;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(p->flow, &size));
  PetscCall(MeshCellCoordinates(p->mesh, cut->cell, xc));
  *ball = (DeviceBall){.radius = cut->moments < 0 ? EVERYWHERE : cut->radius,
                       .width  = size[cut->cell] / p->nsample,
                       .factor = sigma};
  for (PetscInt a = 0; a < 3; a++) ball->lower[a] = xc[a] - cut->X[a];
  if (ball->radius <= 0 || !MeshIsBox(3, p->loc->nb, xc, BOX, ball->edge)) ball->edge[0] = 0;
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
  PetscInt n;

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
  n = sample_count(p);
  PetscCall(
    PetscMalloc6(n * p->loc->dim, &p->x, 2 * n, &p->d, n, &p->sample, n, &p->filled, n, &p->block, n, &p->half));
  PetscCall(CutCellsMeasureCells(p));
  *cut_cells = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellsDestroy(CutCells *cut_cells)
{
  CutCells p = *cut_cells;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree6(p->x, p->d, p->sample, p->filled, p->block, p->half));
  PetscCall(PetscFree(p->cut));
  PetscCall(PetscFree(p->moments));
  PetscCall(PetscFree(*cut_cells));
  PetscFunctionReturn(PETSC_SUCCESS);
}
