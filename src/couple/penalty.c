/* Penalty: see penalty.h. Every rank treats its own and its ghost cells, so that the sums at own nodes are complete without communication; ghosts take theirs from the owner.

   Products of basis functions factorise over the axes, so the integrals of all phi_i phi_j over the body's part of a cell follow from the 6^dim moments of the samples with the
   six products of the one-dimensional functions. */
#include "compat.h"
#include "penalty.h"
#include "base/algebra.h"
#include "mesh/element.h"
#include "base/opt.h"

#define MAX_SAMPLES 20
#define NPAIR       6 /* products of two of the three functions of an axis */
#define CHUNK       256

static const PetscInt PAIR[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

/* The part of a cell that lies in one body; cells that lie inside as a whole are parts as well */
typedef struct {
  PetscInt  cell, body, moments; /* moments: offset in the pool, -1 for a whole cell */
  PetscReal P[3];                /* reference point of the body, as the image that meets the cell */
} Part;

struct _p_Penalty {
  Flow             flow;
  Bodies           bodies;
  BodyState       *s;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscReal        viscous, inertial; /* a, b of sigma */
  PetscInt         nsample;
  PetscReal        phi[MAX_SAMPLES][3], dphi[MAX_SAMPLES][3], pair[MAX_SAMPLES][NPAIR]; /* at the samples of an axis */
  PetscReal        reach;          /* largest distance of a node from the centre node of its cell */
  PetscInt        *cell_of_centre; /* [nnode_all] cell whose centre node it is, or -1 */
  /* the parts of this step */
  PetscInt   npart, part_room, nmoments, moments_room, nown;
  Part      *part;
  PetscReal *moments;
  PetscInt  *own_cell, *own_body; /* [nown] of own cells */
  PetscReal *own_volume;
  /* scalar part for the flow */
  PetscInt   nterm, term_room, *term_cell, *term_body;
  PetscReal *term; /* [nterm][nb*nb] */
  /* the rest */
  PenaltyTerm soft;
  PetscInt    entry_room, more_room, *first, *next; /* entries of a node: first[node], next[entry]; -1 ends */
  PetscReal  *entry_weight;
  PetscReal (*P)[3];         /* [nbodies] reference points of the last draw */
  PetscInt  *strong, *count; /* [nnode_all] */
  PetscReal *x, *d;          /* work: samples of a cell */
};

/* ---- samples of a cell ---- */

static PetscInt sample_count(Penalty p)
{
  return p->loc->dim == 2 ? p->nsample * p->nsample : p->nsample * p->nsample * p->nsample;
}

/* Places x [samples][dim] and volumes w [samples] of the samples of a cell with node coordinates xc */
static void place_samples(Penalty p, const PetscReal xc[], PetscReal x[], PetscReal w[])
{
  const PetscInt  dim = p->loc->dim, nb = p->loc->nb, n = p->nsample, total = sample_count(p);
  const PetscReal part = PetscPowRealInt(2.0 / n, (int)dim);

  for (PetscInt q = 0; q < total; q++) {
    const PetscInt s[3] = {q % n, (q / n) % n, q / (n * n)};
    PetscReal      J[9] = {0};

    for (PetscInt a = 0; a < dim; a++) x[q * dim + a] = 0;
    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt l[3]  = {j % 3, (j / 3) % 3, j / 9};
      PetscReal      value = 1;

      for (PetscInt e = 0; e < dim; e++) value *= p->phi[s[e]][l[e]];
      for (PetscInt a = 0; a < dim; a++) x[q * dim + a] += value * xc[j * dim + a];
      for (PetscInt e = 0; e < dim; e++) {
        PetscReal slope = 1;

        for (PetscInt o = 0; o < dim; o++) slope *= o == e ? p->dphi[s[o]][l[o]] : p->phi[s[o]][l[o]];
        for (PetscInt a = 0; a < dim; a++) J[a * dim + e] += slope * xc[j * dim + a];
      }
    }
    w[q] = part * DenseDeterminant(dim, J);
  }
}

/* m [6]^dim: sums of the weights with the products of functions of each axis, first axis fastest */
static void sum_moments(Penalty p, const PetscReal w[], PetscReal m[])
{
  const PetscInt n = p->nsample, planes = p->loc->dim == 2 ? 1 : n, nn = NPAIR * NPAIR;

  for (PetscInt i = 0; i < (p->loc->dim == 2 ? nn : nn * NPAIR); i++) m[i] = 0;
  for (PetscInt z = 0; z < planes; z++) {
    PetscReal plane[NPAIR * NPAIR] = {0};

    for (PetscInt y = 0; y < n; y++) {
      PetscReal line[NPAIR] = {0};

      for (PetscInt x = 0; x < n; x++)
        for (PetscInt i = 0; i < NPAIR; i++) line[i] += w[(z * n + y) * n + x] * p->pair[x][i];
      for (PetscInt j = 0; j < NPAIR; j++)
        for (PetscInt i = 0; i < NPAIR; i++) plane[j * NPAIR + i] += p->pair[y][j] * line[i];
    }
    for (PetscInt i = 0; i < nn; i++) {
      if (p->loc->dim == 2) m[i] += plane[i];
      else
        for (PetscInt k = 0; k < NPAIR; k++) m[k * nn + i] += p->pair[z][k] * plane[i];
    }
  }
}

/* pen [nb][nb] = sum of moments, with the products of basis functions put together again */
static void spread_moments(Penalty p, const PetscReal m[], PetscReal sigma, PetscReal pen[])
{
  const PetscInt nb = p->loc->nb;

  for (PetscInt i = 0; i < nb; i++) {
    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt z = p->loc->dim == 2 ? 0 : PAIR[i / 9][j / 9];

      pen[i * nb + j] = sigma * m[(z * NPAIR + PAIR[(i / 3) % 3][(j / 3) % 3]) * NPAIR + PAIR[i % 3][j % 3]];
    }
  }
}

/* ---- parts of cells ---- */

/* The part of a cell in a body near its surface: samples with the smoothed indicator; *whole if they are all inside, *volume 0 if none is */
static PetscErrorCode cut_cell(Penalty p, PetscInt cell, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal m[], PetscBool *whole,
                               PetscReal *volume)
{
  const PetscInt   n = sample_count(p);
  const PetscReal *size;
  PetscReal        xc[MESH_MAX_NB * 3], *w = p->d + n, width;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(p->flow, &size));
  PetscCall(MeshCellCoordinates(p->mesh, cell, xc));
  place_samples(p, xc, p->x, w);
  PetscCall(BodiesDistance(p->bodies, k, X, q, n, p->x, p->d));
  width   = size[cell] / p->nsample;
  *volume = 0;
  *whole  = PETSC_TRUE;
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal chi = PetscMin(1, PetscMax(0, 0.5 - p->d[i] / width));

    if (chi < 1) *whole = PETSC_FALSE;
    w[i] *= chi;
    *volume += w[i];
  }
  sum_moments(p, w, m);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Moments of a whole cell */
static PetscErrorCode take_whole_cell(Penalty p, PetscInt cell, PetscReal m[])
{
  PetscReal xc[MESH_MAX_NB * 3], *w = p->d + sample_count(p);

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(p->mesh, cell, xc));
  place_samples(p, xc, p->x, w);
  sum_moments(p, w, m);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One more part; moments point behind the pool, where the next cut cell puts its own */
static PetscErrorCode make_room_for_part(Penalty p)
{
  const PetscInt size = p->loc->dim == 2 ? NPAIR * NPAIR : NPAIR * NPAIR * NPAIR;

  PetscFunctionBeginUser;
  if (p->npart == p->part_room) {
    p->part_room = 2 * p->part_room + 64;
    PetscCall(PetscRealloc(p->part_room * sizeof(Part), &p->part));
    PetscCall(PetscRealloc(p->part_room * sizeof(PetscInt), &p->own_cell));
    PetscCall(PetscRealloc(p->part_room * sizeof(PetscInt), &p->own_body));
    PetscCall(PetscRealloc(p->part_room * sizeof(PetscReal), &p->own_volume));
  }
  if (p->nmoments + size > p->moments_room) {
    p->moments_room = 2 * p->moments_room + 64 * size;
    PetscCall(PetscRealloc(p->moments_room * sizeof(PetscReal), &p->moments));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_part(Penalty p, PetscInt cell, PetscInt k, const PetscReal P[3], PetscBool whole, PetscReal volume)
{
  Part *part = p->part + p->npart++;

  PetscFunctionBeginUser;
  part->cell    = cell;
  part->body    = k;
  part->moments = whole ? -1 : p->nmoments;
  for (PetscInt a = 0; a < 3; a++) part->P[a] = P[a];
  if (!whole) p->nmoments += p->loc->dim == 2 ? NPAIR * NPAIR : NPAIR * NPAIR * NPAIR;
  if (cell < p->loc->ncell) {
    p->own_cell[p->nown]     = cell;
    p->own_body[p->nown]     = k;
    p->own_volume[p->nown++] = volume;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Radius of the ball about the centre node that holds the cell (1.1: curved edges). The signed distance changes by at most the way, so the ball decides what is far. */
static PetscErrorCode cell_radius(Penalty p, PetscInt cell, PetscReal *radius)
{
  const PetscInt   dim = p->loc->dim, nb   = p->loc->nb;
  PetscReal        xc[MESH_MAX_NB * 3], r2 = 0;
  const PetscReal *centre = xc + (nb / 2) * dim;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(p->mesh, cell, xc));
  for (PetscInt j = 0; j < nb; j++) {
    PetscReal s = 0;

    for (PetscInt a = 0; a < dim; a++) s += PetscSqr(xc[j * dim + a] - centre[a]);
    r2 = PetscMax(r2, s);
  }
  *radius = 1.1 * PetscSqrtReal(r2);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cut_image(Penalty p, PetscInt k, const PetscReal X[3], const PetscReal q[4], const PetscReal P[3])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim;
  const PetscReal  far = BodiesGetGroup(p->s, k)->radius + p->reach;
  PetscReal        lo[3], hi[3], x[CHUNK * 3], d[CHUNK];
  const PetscReal *size;
  const PetscInt  *list;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(p->flow, &size));
  for (PetscInt a = 0; a < dim; a++) {
    lo[a] = X[a] - far;
    hi[a] = X[a] + far;
  }
  PetscCall(MeshNodesInBox(p->mesh, lo, hi, &n, &list));
  for (PetscInt i = 0; i < n;) {
    PetscInt cell[CHUNK], m = 0;

    for (; i < n && m < CHUNK; i++) {
      if (p->cell_of_centre[list[i]] < 0) continue;
      for (PetscInt a = 0; a < dim; a++) x[m * dim + a] = l->x[list[i] * dim + a];
      cell[m++] = p->cell_of_centre[list[i]];
    }
    PetscCall(BodiesDistance(p->bodies, k, X, q, m, x, d));
    for (PetscInt j = 0; j < m; j++) {
      PetscReal radius, volume = 0;
      PetscBool whole = PETSC_TRUE;

      if (d[j] > p->reach) continue;
      PetscCall(cell_radius(p, cell[j], &radius));
      if (d[j] > radius) continue;
      PetscCall(make_room_for_part(p));
      if (d[j] < -radius) volume = PetscPowRealInt(size[cell[j]], (int)dim);
      else PetscCall(cut_cell(p, cell[j], k, X, q, p->moments + p->nmoments, &whole, &volume));
      if (volume > 0) PetscCall(add_part(p, cell[j], k, P, whole, volume));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cut_cells(Penalty p, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal (*P)[3], const PetscBool omit[])
{
  PetscFunctionBeginUser;
  p->npart = p->nmoments = p->nown = 0;
  for (PetscInt k = 0; k < p->s->n; k++) {
    for (PetscInt image = 0; image < (p->loc->dim == 2 ? 9 : 27) && !(omit && omit[k]); image++) {
      PetscReal Xi[3], Pi[3];

      if (!IndicatorImage(p->loc, X[k], BodiesGetGroup(p->s, k)->radius, image, Xi)) continue;
      for (PetscInt a = 0; a < 3; a++) Pi[a] = P[k][a] + (Xi[a] - X[k][a]);
      PetscCall(cut_image(p, k, Xi, q[k], Pi));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- strong nodes ---- */

/* Nodes all of whose cells lie inside the same body. Parts are ordered by body, so counting restarts with each. */
static PetscErrorCode claim_strong_nodes(Penalty p, Indicator mark)
{
  const MeshLocal *l = p->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    p->strong[i] = -1;
    p->count[i]  = 0;
  }
  for (PetscInt t = 0; t < p->npart;) {
    const PetscInt k = p->part[t].body, begin = t;

    for (; t < p->npart && p->part[t].body == k; t++) {
      if (p->part[t].moments >= 0) continue;
      for (PetscInt j = 0; j < l->nb; j++) {
        const PetscInt i = l->cell_node[p->part[t].cell * l->nb + j];

        if (++p->count[i] == l->node_cell_ptr[i + 1] - l->node_cell_ptr[i] && i < l->nnode && p->strong[i] < 0) p->strong[i] = k;
      }
    }
    for (PetscInt r = begin; r < t; r++)
      for (PetscInt j = 0; j < l->nb; j++) p->count[l->cell_node[p->part[r].cell * l->nb + j]] = 0;
  }
  PetscCall(MeshSyncNodesInt(p->mesh, p->strong));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    if (p->strong[i] >= 0) PetscCall(IndicatorClaim(mark, i, p->strong[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the penalty ---- */

/* sigma in a cell */
static PetscErrorCode get_strength(Penalty p, PetscInt cell, PetscReal *sigma)
{
  const FlowParameters *par;
  const FlowStep       *step;
  const PetscReal      *size;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(p->flow, &par));
  PetscCall(FlowGetStep(p->flow, &step));
  PetscCall(FlowGetCellSize(p->flow, &size));
  *sigma = p->viscous * par->viscosity / PetscSqr(size[cell]) + p->inertial * par->density * step->ct;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_entry(Penalty p, PetscInt node, PetscInt body, PetscInt *entry)
{
  PenaltyTerm *s = &p->soft;
  PetscInt     e = p->first[node];

  PetscFunctionBeginUser;
  while (e >= 0 && s->body[e] != body) e = p->next[e];
  if (e < 0) {
    if (s->n == p->entry_room) {
      p->entry_room = 2 * p->entry_room + 256;
      PetscCall(PetscRealloc(p->entry_room * sizeof(PetscInt), &s->node));
      PetscCall(PetscRealloc(p->entry_room * sizeof(PetscInt), &s->body));
      PetscCall(PetscRealloc(p->entry_room * sizeof(PetscInt), &p->next));
      PetscCall(PetscRealloc(p->entry_room * sizeof(PetscReal), &p->entry_weight));
      PetscCall(PetscRealloc(p->entry_room * (s->dim + 1) * sizeof(PetscReal), &s->g));
    }
    e = s->n++;

    s->node[e]         = node;
    s->body[e]         = body;
    p->entry_weight[e] = 0;
    for (PetscInt a = 0; a <= s->dim; a++) s->g[e * (s->dim + 1) + a] = 0;
    p->next[e]     = p->first[node];
    p->first[node] = e;
  }
  *entry = e;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Entries of the own nodes of a part with cell matrix pen; lumped with its diagonal scaled to the right sum (Hinton, Rock, Zienkiewicz 1976), which is always positive */
static PetscErrorCode add_entries(Penalty p, const Part *part, const PetscReal pen[], PetscReal scale)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, *node = l->cell_node + part->cell * nb;
  PetscReal        xc[MESH_MAX_NB * 3];

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(p->mesh, part->cell, xc));
  for (PetscInt i = 0; i < nb; i++) {
    PetscInt   e = -1;
    PetscReal *g;

    if (node[i] >= l->nnode || p->strong[node[i]] == part->body) continue;
    PetscCall(find_entry(p, node[i], part->body, &e));
    g = p->soft.g + e * (dim + 1);
    for (PetscInt j = 0; j < nb; j++) {
      g[0] += pen[i * nb + j];
      for (PetscInt a = 0; a < dim; a++) g[1 + a] += pen[i * nb + j] * (xc[j * dim + a] - part->P[a]);
    }
    p->entry_weight[e] += pen[i * (nb + 1)] * scale;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The cell matrix of a part: rows and columns of nodes that are strong in the same body are left out, because the penalty of a rigid motion is zero anyway */
static PetscErrorCode add_part_penalty(Penalty p, const Part *part)
{
  const MeshLocal *l  = p->loc;
  const PetscInt   nb = l->nb, *node = l->cell_node + part->cell * nb;
  PetscReal        pen[MESH_MAX_NB * MESH_MAX_NB], whole[NPAIR * NPAIR * NPAIR], sigma = 0, sum = 0, trace = 0;
  PetscBool        weak = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < nb; j++) weak = (PetscBool)(weak || p->strong[node[j]] != part->body);
  if (!weak) PetscFunctionReturn(PETSC_SUCCESS);
  if (part->moments < 0) PetscCall(take_whole_cell(p, part->cell, whole));
  PetscCall(get_strength(p, part->cell, &sigma));
  p->soft.strength = PetscMax(p->soft.strength, sigma);
  spread_moments(p, part->moments < 0 ? whole : p->moments + part->moments, sigma, pen);
  for (PetscInt i = 0; i < nb * nb; i++) {
    sum += pen[i];
    if (i % (nb + 1) == 0) trace += pen[i];
  }
  for (PetscInt i = 0; i < nb * nb; i++)
    if (p->strong[node[i / nb]] == part->body || p->strong[node[i % nb]] == part->body) pen[i] = 0;
  PetscCall(add_entries(p, part, pen, sum / trace));
  if (p->nterm == p->term_room) {
    p->term_room = 2 * p->term_room + 64;
    PetscCall(PetscRealloc(p->term_room * sizeof(PetscInt), &p->term_cell));
    PetscCall(PetscRealloc(p->term_room * sizeof(PetscInt), &p->term_body));
    PetscCall(PetscRealloc(p->term_room * nb * nb * sizeof(PetscReal), &p->term));
  }
  p->term_cell[p->nterm] = part->cell;
  p->term_body[p->nterm] = part->body;
  PetscCall(PetscArraycpy(p->term + p->nterm++ * nb * nb, pen, nb * nb));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* H of all bodies, lumped weights and the body that each node follows, from the entries */
static PetscErrorCode finish_soft(Penalty p, PetscReal (*P)[3])
{
  const MeshLocal *l  = p->loc;
  PenaltyTerm     *s  = &p->soft;
  const PetscInt   nr = s->nr, dim = s->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->H, s->nbodies * nr * nr));
  PetscCall(PetscArrayzero(s->weight, l->nnode_all));
  for (PetscInt i = 0; i < l->nnode_all; i++) s->follow[i] = -1;
  if (s->n > p->more_room) {
    p->more_room = s->n + 256;
    PetscCall(PetscRealloc(p->more_room * sizeof(PetscInt), &s->more));
  }
  s->nmore = 0;
  for (PetscInt e = 0; e < s->n; e++) {
    const PetscInt i = s->node[e], k = s->body[e];
    PetscReal      G[18], R[18];

    PenaltyTermGetBlock(s, e, G);
    ConstraintRigidAt(l, i, P[k], R);
    for (PetscInt m = 0; m < nr * nr; m++)
      for (PetscInt a = 0; a < dim; a++) s->H[k * nr * nr + m] += R[a * nr + m / nr] * G[a * nr + m % nr];
    s->weight[i] += p->entry_weight[e];
    if (e == p->first[i]) { /* once a node */
      PetscInt best = e;

      for (PetscInt o = e; o >= 0; o = p->next[o])
        if (p->entry_weight[o] > p->entry_weight[best] || (p->entry_weight[o] == p->entry_weight[best] && s->body[o] < s->body[best])) best = o;
      s->follow[i] = s->body[best];
    }
    if (!s->nmore || s->more[s->nmore - 1] != k) s->more[s->nmore++] = k;
  }
  s->any = (PetscBool)(s->n > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &s->any, 1, COMPAT_MPI_BOOL, MPI_LOR, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &s->strength, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, s->H, (PetscMPIInt)(s->nbodies * nr * nr), MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(MeshSyncNodes(p->mesh, 1, s->weight));
  PetscCall(MeshSyncNodesInt(p->mesh, s->follow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyDraw(Penalty p, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal (*P)[3], const PetscBool omit[], Indicator mark)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < p->soft.n; e++) p->first[p->soft.node[e]] = -1;
  p->soft.n = p->nterm = 0;
  p->soft.strength     = 0;
  PetscCall(PetscArraycpy((PetscReal *)p->P, (PetscReal *)P, 3 * p->s->n));
  PetscCall(cut_cells(p, X, q, P, omit));
  PetscCall(claim_strong_nodes(p, mark));
  for (PetscInt t = 0; t < p->npart; t++) PetscCall(add_part_penalty(p, p->part + t));
  for (PetscInt e = 0; e < p->soft.n; e++) PetscCall(IndicatorTouch(mark, p->soft.node[e]));
  PetscCall(finish_soft(p, P));
  PetscCall(FlowSetCellTerms(p->flow, p->nterm, p->term_cell, p->term));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyGetSoft(Penalty p, const PenaltyTerm **soft)
{
  PetscFunctionBeginUser;
  *soft = &p->soft;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyAddPrescribed(Penalty p, const PetscInt fixed[], const PetscReal u[], const PetscReal U[], PetscReal out[3])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nr = p->soft.nr;

  PetscFunctionBeginUser;
  for (PetscInt t = 0; t < p->nterm; t++) {
    const PetscInt  *node = l->cell_node + p->term_cell[t] * nb, k = p->term_body[t];
    const PetscReal *pen = p->term + t * nb * nb;
    PetscReal        slip[MESH_MAX_NB * 3];
    PetscInt         any = 0;

    for (PetscInt j = 0; j < nb; j++) any |= fixed[node[j]];
    if (!any || p->term_cell[t] >= l->ncell) continue;
    for (PetscInt j = 0; j < nb; j++) {
      PetscReal R[18];

      ConstraintRigidAt(l, node[j], p->P[k], R);
      for (PetscInt a = 0; a < dim; a++) {
        slip[j * dim + a] = u[node[j] * dim + a];
        for (PetscInt m = 0; m < nr; m++) slip[j * dim + a] -= R[a * nr + m] * U[k * nr + m];
      }
    }
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt j = 0; j < nb; j++)
        for (PetscInt a = 0; a < dim; a++)
          if ((fixed[node[i]] >> a) & 1) out[a] += pen[i * nb + j] * slip[j * dim + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyGetParts(Penalty p, PetscInt *n, const PetscInt *cell[], const PetscInt *body[], const PetscReal *volume[])
{
  PetscFunctionBeginUser;
  *n = p->nown;
  if (cell) *cell = p->own_cell;
  if (body) *body = p->own_body;
  if (volume) *volume = p->own_volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static void tabulate_samples(Penalty p)
{
  for (PetscInt s = 0; s < p->nsample; s++) {
    ElementLine((2 * s + 1.0) / p->nsample - 1, p->phi[s], p->dphi[s]);
    for (PetscInt a = 0; a < 3; a++)
      for (PetscInt b = a; b < 3; b++) p->pair[s][PAIR[a][b]] = p->phi[s][a] * p->phi[s][b];
  }
}

PetscErrorCode PenaltyMeasureCells(Penalty p)
{
  const MeshLocal *l = p->loc;

  PetscFunctionBeginUser;
  p->reach = 0;
  for (PetscInt i = 0; i < l->nnode_all; i++) p->cell_of_centre[i] = -1;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal radius;

    p->cell_of_centre[l->cell_node[c * l->nb + l->nb / 2]] = c;
    PetscCall(cell_radius(p, c, &radius));
    p->reach = PetscMax(p->reach, radius);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyCreate(Flow flow, Bodies bodies, Penalty *penalty)
{
  Penalty      p;
  PenaltyTerm *s;
  PetscInt     n;
  PetscBool    still;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  s         = &p->soft;
  p->flow   = flow;
  p->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &p->s));
  PetscCall(FlowGetMesh(flow, &p->mesh));
  PetscCall(MeshGetLocal(p->mesh, &p->loc));
  p->viscous  = 200;
  p->inertial = 12;
  PetscCall(BodiesAreStill(bodies, &still));
  p->nsample = still ? 20 : 10; /* drawn once, or in every step */
  PetscCall(OptReal("-couple_penalty_viscous", &p->viscous));
  PetscCall(OptReal("-couple_penalty_inertial", &p->inertial));
  PetscCall(OptInt("-couple_penalty_samples", &p->nsample));
  PetscCheck(p->viscous > 0 || p->inertial > 0, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "-couple_penalty_viscous and -couple_penalty_inertial are both 0: nothing would hold the fluid at the surface of the bodies");
  tabulate_samples(p);
  n          = p->loc->nnode_all;
  s->dim     = p->loc->dim;
  s->nr      = s->dim == 2 ? 3 : 6;
  s->nbodies = p->s->n;
  PetscCall(PetscMalloc4(n, &p->cell_of_centre, n, &p->first, n, &p->strong, n, &p->count));
  PetscCall(PetscCalloc4(s->nbodies, &p->P, s->nbodies * s->nr * s->nr, &s->H, n, &s->weight, n, &s->follow));
  PetscCall(PetscMalloc2(sample_count(p) * s->dim, &p->x, 2 * sample_count(p), &p->d));
  for (PetscInt i = 0; i < n; i++) p->first[i] = s->follow[i] = -1;
  PetscCall(PenaltyMeasureCells(p));
  *penalty = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyDestroy(Penalty *penalty)
{
  Penalty p = *penalty;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4(p->cell_of_centre, p->first, p->strong, p->count));
  PetscCall(PetscFree4(p->P, p->soft.H, p->soft.weight, p->soft.follow));
  PetscCall(PetscFree2(p->x, p->d));
  PetscCall(PetscFree(p->part));
  PetscCall(PetscFree(p->moments));
  PetscCall(PetscFree(p->own_cell));
  PetscCall(PetscFree(p->own_body));
  PetscCall(PetscFree(p->own_volume));
  PetscCall(PetscFree(p->term_cell));
  PetscCall(PetscFree(p->term_body));
  PetscCall(PetscFree(p->term));
  PetscCall(PetscFree(p->soft.node));
  PetscCall(PetscFree(p->soft.body));
  PetscCall(PetscFree(p->soft.g));
  PetscCall(PetscFree(p->soft.more));
  PetscCall(PetscFree(p->next));
  PetscCall(PetscFree(p->entry_weight));
  PetscCall(PetscFree(*penalty));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyView(Penalty p, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  penalty %g viscosity/h^2 + %g density/time step, %" PetscInt_FMT " sub-cells an axis\n",
                                   (double)p->viscous, (double)p->inertial, p->nsample));
  PetscFunctionReturn(PETSC_SUCCESS);
}
