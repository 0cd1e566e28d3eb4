/* Border: boundaries, and the pieces that their faces make; see border.h. */
#include "compat.h"
#include "borderimpl.h"
#include "base/algebra.h"
#include "base/array.h"

#define JOINT  0.819152 /* cosine of the angle between faces that make a piece, */
#define PIECE  0.766044 /* and of that to the first one */
#define MARGIN 1.25     /* a curved face leaves the ball of its nodes */
#define GRAIN  1e-7     /* of the size of all: centres of faces that are as near count as the same along an axis */

PetscErrorCode BorderCreate(PetscInt dim, Border *border)
{
  PetscFunctionBeginUser;
  PetscCall(PetscNew(border));
  (*border)->dim = dim;
  (*border)->m   = dim == 2 ? 3 : 9;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderDestroy(Border *border)
{
  Border b = *border;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(NearGridDestroy(&b->near));
  PetscCall(PetscFree(b->name));
  PetscCall(PetscFree(b->solid));
  PetscCall(PetscFree(b->round));
  PetscCall(PetscFree(b->face));
  PetscCall(PetscFree(b->start));
  PetscCall(PetscFree(b->next));
  PetscCall(PetscFree(b->piece_boundary));
  PetscCall(PetscFree(b->list));
  PetscCall(PetscFree(b->found));
  PetscCall(PetscFree(b->asked));
  PetscCall(PetscFree(*border));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_piece(Border b, PetscInt boundary)
{
  PetscFunctionBeginUser;
  PetscCall(PetscRealloc((b->npiece + 1) * sizeof(PetscInt), &b->piece_boundary));
  PetscCall(PetscRealloc((b->npiece + 1) * sizeof(PetscInt), &b->found));
  PetscCall(PetscRealloc((b->npiece + 1) * sizeof(PetscInt), &b->asked));
  b->piece_boundary[b->npiece] = boundary;
  b->asked[b->npiece++]        = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderAdd(Border b, const char name[], PetscBool solid)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(b->n + 1, &b->capacity, &b->name, sizeof(*b->name), &b->solid, sizeof(*b->solid), NULL));
  PetscCall(PetscStrncpy(b->name[b->n], name, sizeof(*b->name)));
  b->solid[b->n++] = solid;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderAddRound(Border b, PetscInt boundary, const BorderRound *r)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(b->nround + 1, &b->round_capacity, &b->round, sizeof(*b->round), NULL));
  b->round[b->nround++] = (Round){boundary, *r};
  PetscCall(add_piece(b, boundary));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- faces, in an order that no partition changes ---- */

typedef struct {
  PetscInt  boundary, from;
  PetscReal key[3];
} Sorted;

static int compare_faces(const void *a, const void *b)
{
  const Sorted *x = a, *y = b;

  if (x->boundary != y->boundary) return x->boundary < y->boundary ? -1 : 1;
  for (PetscInt i = 0; i < 3; i++)
    if (x->key[i] != y->key[i]) return x->key[i] < y->key[i] ? -1 : 1;
  return x->from < y->from ? -1 : x->from > y->from;
}

static PetscErrorCode sort_faces(Border b, const BorderFace in[])
{
  const PetscInt middle = b->m / 2;
  PetscReal      lower = PETSC_MAX_REAL, upper = -PETSC_MAX_REAL;
  Sorted        *s;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(b->nface, &s));
  for (PetscInt i = 0; i < b->nface; i++)
    for (PetscInt a = 0; a < b->dim; a++) {
      lower = PetscMin(lower, in[i].x[middle][a]);
      upper = PetscMax(upper, in[i].x[middle][a]);
    }
  for (PetscInt i = 0; i < b->nface; i++) {
    s[i] = (Sorted){in[i].boundary, i, {0, 0, 0}};
    for (PetscInt a = 0; a < b->dim; a++)
      s[i].key[a] = PetscFloorReal((in[i].x[middle][a] - lower) / (GRAIN * (upper - lower)) + 0.3137);
  }
  qsort(s, (size_t)b->nface, sizeof(*s), compare_faces);
  for (PetscInt i = 0; i < b->nface; i++) b->face[i].f = in[s[i].from];
  PetscCall(PetscFree(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ball, and to which side the domain lies */
static void measure_face(Border b, Face *f)
{
  const PetscReal zero[2] = {0, 0};
  PetscReal       n[3], in[3];
  FacePoint       p;

  FaceEvaluate(b->dim, (const PetscReal(*)[3])f->f.x, zero, &p);
  FaceNormal(b->dim, &p, n);
  f->r = 0;
  for (PetscInt a = 0; a < 3; a++) {
    f->centre[a] = p.x[a];
    in[a]        = f->f.inside[a] - p.x[a];
  }
  for (PetscInt i = 0; i < b->m; i++) {
    const PetscReal d[3] = {f->f.x[i][0] - p.x[0], f->f.x[i][1] - p.x[1], f->f.x[i][2] - p.x[2]};

    f->r = PetscMax(f->r, PetscSqrtReal(dot3(d, d)));
  }
  f->r *= MARGIN;
  f->turn  = dot3(n, in) >= 0 ? 1 : -1;
  f->piece = -1;
}

/* Unit normal into the domain at node i */
static void node_normal(Border b, const Face *f, PetscInt i, PetscReal n[3])
{
  const PetscReal s[2] = {i % 3 - 1, b->dim == 3 ? i / 3 - 1 : 0};
  FacePoint       p;

  FaceEvaluate(b->dim, (const PetscReal(*)[3])f->f.x, s, &p);
  FaceNormal(b->dim, &p, n);
  for (PetscInt a = 0; a < 3; a++) n[a] *= f->turn;
}

/* ---- neighbours ---- */

typedef struct {
  PetscInt node, face, i; /* node of the mesh, the i-th one of the face */
} Corner;

static int compare_corners(const void *a, const void *b)
{
  const Corner *x = a, *y = b;

  if (x->node != y->node) return x->node < y->node ? -1 : 1;
  return x->face < y->face ? -1 : x->face > y->face;
}

/* Faces [first, end) of `all` share a node */
static void average_normals(Border b, const Corner all[], PetscInt first, PetscInt end)
{
  PetscReal sum[3] = {0, 0, 0}, n[3];
  PetscBool open   = PETSC_FALSE;

  for (PetscInt k = first; k < end; k++) {
    const Face *f = &b->face[all[k].face];

    node_normal(b, f, all[k].i, n);
    for (PetscInt a = 0; a < 3; a++) sum[a] += n[a];
    open = (PetscBool)(open || !b->solid[f->f.boundary]);
  }
  for (PetscInt k = first; k < end; k++) {
    Face *f = &b->face[all[k].face];

    f->open[all[k].i] = open;
    for (PetscInt a = 0; a < 3; a++) f->normal[all[k].i][a] = sum[a];
  }
}

static PetscInt end_of_node(PetscInt n, const Corner all[], PetscInt first)
{
  PetscInt end = first;

  while (end < n && all[end].node == all[first].node) end++;
  return end;
}

/* The solid faces with a node in common with face f, to `out`, ascending; where [nface][m]: place of its nodes in all
   */
static PetscInt list_neighbours(Border b, PetscInt n, const Corner all[], const PetscInt where[], PetscInt f,
                                PetscInt out[])
{
  PetscInt found = 0;

  for (PetscInt i = 0; i < b->m; i++)
    for (PetscInt k = where[f * b->m + i], node = all[k].node; k < n && all[k].node == node; k++) {
      PetscInt at = found;

      if (all[k].face == f || !b->solid[b->face[all[k].face].f.boundary]) continue;
      while (at > 0 && out[at - 1] > all[k].face) at--;
      if (at > 0 && out[at - 1] == all[k].face) continue;
      for (PetscInt e = found++; e > at; e--) out[e] = out[e - 1];
      out[at] = all[k].face;
    }
  return found;
}

static PetscErrorCode join_faces(Border b)
{
  const PetscInt n = b->nface * b->m;
  PetscInt      *where, total = 0;
  Corner        *all;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &all, n, &where));
  for (PetscInt e = 0; e < n; e++) all[e] = (Corner){b->face[e / b->m].f.node[e % b->m], e / b->m, e % b->m};
  qsort(all, (size_t)n, sizeof(*all), compare_corners);
  for (PetscInt first = 0; first < n; first = end_of_node(n, all, first)) {
    const PetscInt end = end_of_node(n, all, first);

    average_normals(b, all, first, end);
    for (PetscInt k = first; k < end; k++) {
      where[all[k].face * b->m + all[k].i] = first;
      total += end - first - 1;
    }
  }
  PetscCall(PetscMalloc1(b->nface + 1, &b->start));
  PetscCall(PetscMalloc1(total, &b->next));
  b->start[0] = 0;
  for (PetscInt f = 0; f < b->nface; f++)
    b->start[f + 1] = b->start[f] + list_neighbours(b, n, all, where, f, b->next + b->start[f]);
  PetscCall(PetscFree2(all, where));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- pieces ---- */

/* Do two faces that share a node join smoothly along an edge? */
static PetscBool is_smooth(Border b, const Face *f, const Face *g)
{
  for (PetscInt i = 0; i < b->m; i++) {
    PetscReal      nf[3], ng[3];
    const PetscInt j = FaceFindNode(b, g, f->f.node[i]);

    if (j < 0 || (b->dim == 3 && i % 2 == 0)) continue; /* in space the middle of an edge tells */
    node_normal(b, f, i, nf);
    node_normal(b, g, j, ng);
    return (PetscBool)(dot3(nf, ng) > JOINT);
  }
  return PETSC_FALSE;
}

static PetscErrorCode grow_piece(Border b, PetscInt seed, PetscInt queue[])
{
  const PetscInt middle = b->m / 2;
  PetscReal      first[3], n[3];
  PetscInt       piece = b->npiece, end = 0;

  PetscFunctionBeginUser;
  PetscCall(add_piece(b, b->face[seed].f.boundary));
  node_normal(b, &b->face[seed], middle, first);
  b->face[seed].piece = piece;
  queue[end++]        = seed;
  for (PetscInt at = 0; at < end; at++) {
    const PetscInt f = queue[at];

    for (PetscInt e = b->start[f]; e < b->start[f + 1]; e++) {
      Face *g = &b->face[b->next[e]];

      if (g->piece >= 0 || g->f.boundary != b->face[seed].f.boundary || !is_smooth(b, &b->face[f], g)) continue;
      node_normal(b, g, middle, n);
      if (dot3(n, first) <= PIECE) continue;
      g->piece     = piece;
      queue[end++] = b->next[e];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_grid(Border b)
{
  const PetscReal none[3]  = {0, 0, 0};
  PetscReal       lower[3] = {0, 0, 0}, upper[3] = {0, 0, 0}, (*x)[3], *half;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(b->nface, &x, b->nface, &half));
  for (PetscInt f = 0; f < b->nface; f++) {
    PetscCall(PetscArraycpy(x[f], b->face[f].centre, 3));
    half[f] = b->face[f].r;
    for (PetscInt a = 0; a < b->dim; a++) {
      lower[a] = f ? PetscMin(lower[a], x[f][a]) : x[f][a];
      upper[a] = f ? PetscMax(upper[a], x[f][a]) : x[f][a];
    }
  }
  PetscCall(NearGridCreate(b->dim, lower, upper, none, b->nface, (const PetscReal(*)[3])x, half, &b->near));
  PetscCall(PetscFree2(x, half));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderSetFaces(Border b, PetscInt n, const BorderFace in[])
{
  PetscInt *queue;

  PetscFunctionBeginUser;
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  b->nface = n;
  PetscCall(PetscCalloc1(n, &b->face));
  PetscCall(sort_faces(b, in));
  for (PetscInt f = 0; f < n; f++) measure_face(b, &b->face[f]);
  PetscCall(join_faces(b));
  PetscCall(PetscMalloc1(n, &queue));
  for (PetscInt f = 0; f < n; f++)
    if (b->face[f].piece < 0 && b->solid[b->face[f].f.boundary]) PetscCall(grow_piece(b, f, queue));
  PetscCall(PetscFree(queue));
  PetscCall(make_grid(b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions about boundaries ---- */

PetscErrorCode BorderGetBoundaries(Border b, PetscInt *n)
{
  PetscFunctionBeginUser;
  *n = b->n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderGetName(Border b, PetscInt boundary, const char **name)
{
  PetscFunctionBeginUser;
  *name = b->name[boundary];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderIsSolid(Border b, PetscInt boundary, PetscBool *solid)
{
  PetscFunctionBeginUser;
  *solid = b->solid[boundary];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderFind(Border b, const char name[], PetscInt *boundary)
{
  PetscFunctionBeginUser;
  *boundary = -1;
  for (PetscInt i = 0; i < b->n; i++) {
    PetscBool same;

    PetscCall(PetscStrcmp(b->name[i], name, &same));
    if (same) *boundary = i;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderHasFaces(Border b, PetscBool *has)
{
  PetscFunctionBeginUser;
  *has = (PetscBool)(b->nface > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderGetPieces(Border b, PetscInt *n)
{
  PetscFunctionBeginUser;
  *n = b->npiece;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BorderGetBoundary(Border b, PetscInt piece, PetscInt *boundary)
{
  PetscFunctionBeginUser;
  *boundary = b->piece_boundary[piece];
  PetscFunctionReturn(PETSC_SUCCESS);
}
