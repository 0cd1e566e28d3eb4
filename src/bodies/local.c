/* BodiesLocal: see local.h. BodyParts of the domain, columns of the state that go from rank to rank, ghosts, rows. */
#include "compat.h"
#include "impl.h"
#include "base/domain.h"
#include "bodies/local.h"
#include "base/log.h"
#include "base/room.h"

#define BINS    1024 /* along an axis, in which bodies are counted for the cuts */
#define UNEVEN  1.1  /* own bodies of the fullest rank by the mean, beyond which the cuts move */
#define LARGE   0.25 /* radius by the width of the narrowest part, beyond which a body is known to all ranks */
#define AT_ONCE 64   /* bodies; fewer are not worth the cuts */

struct _p_BodyParts {
  MPI_Comm     comm;
  PetscMPIInt  rank, size;
  PetscInt     dim, n[3], at[3]; /* parts along the axes, place of this rank's one */
  PetscReal   *cut[3];           /* [n + 1] */
  PetscReal    lower[3], upper[3], period[3];
  PetscSF      ghosts; /* from known to known bodies; NULL before the first BodiesMigrate */
  PetscMPIInt  tag;
  MPI_Datatype unit[2]; /* 3 and 4 reals */
};

/* A body that is large: its place, how far its centre keeps others away, its owner */
typedef struct {
  PetscReal x[3], reach, owner;
} Large;

/* ---- columns ---- */

PetscErrorCode BodyAddColumn(Bodies b, size_t bytes, void **array)
{
  PetscFunctionBeginUser;
  PetscCheck(b->ncolumns < BODIES_MAX_COLUMNS, PETSC_COMM_SELF, PETSC_ERR_SUP, "Bodies have room for %d arrays", BODIES_MAX_COLUMNS);
  b->column[b->ncolumns++] = (BodyColumn){array, bytes};
  PetscCall(PetscCalloc(PetscMax(1, b->room) * bytes, array));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyReserve(Bodies b, PetscInt n)
{
  PetscFunctionBeginUser;
  if (n <= b->room) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < b->ncolumns; i++) {
    BodyColumn *c = b->column + i;

    PetscCall(PetscRealloc((size_t)n * c->bytes, c->array));
    PetscCall(PetscMemzero((char *)*c->array + (size_t)b->room * c->bytes, (size_t)(n - b->room) * c->bytes));
  }
  b->room = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAttach(Bodies b, size_t bytes, void **array)
{
  PetscFunctionBeginUser;
  PetscCall(BodyAddColumn(b, bytes, array));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesDetach(Bodies b, void **array)
{
  PetscInt i = 0;

  PetscFunctionBeginUser;
  while (i < b->ncolumns && b->column[i].array != array) i++;
  if (i == b->ncolumns) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(*array));
  b->column[i] = b->column[--b->ncolumns];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static size_t parcel_size(Bodies b)
{
  size_t bytes = 0;

  for (PetscInt i = 0; i < b->ncolumns; i++) bytes += b->column[i].bytes;
  return bytes;
}

static void pack(Bodies b, PetscInt k, char *to)
{
  for (PetscInt i = 0; i < b->ncolumns; to += b->column[i++].bytes)
    (void)PetscMemcpy(to, (char *)*b->column[i].array + (size_t)k * b->column[i].bytes, b->column[i].bytes);
}

static void unpack(Bodies b, const char *from, PetscInt k)
{
  for (PetscInt i = 0; i < b->ncolumns; from += b->column[i++].bytes)
    (void)PetscMemcpy((char *)*b->column[i].array + (size_t)k * b->column[i].bytes, from, b->column[i].bytes);
}

static void move(Bodies b, PetscInt from, PetscInt to)
{
  for (PetscInt i = 0; i < b->ncolumns && from != to; i++) {
    const BodyColumn *c = b->column + i;

    (void)PetscMemcpy((char *)*c->array + (size_t)to * c->bytes, (char *)*c->array + (size_t)from * c->bytes, c->bytes);
  }
}

/* Bodies that are not kept go, the others close up */
static void keep_bodies(Bodies b, const PetscBool keep[])
{
  PetscInt n = 0;

  for (PetscInt k = 0; k < b->state.n; k++)
    if (keep[k]) move(b, k, n++);
  b->state.n = n;
}

/* Bodies of m parcels come, each at the place of its number: from the highest downwards, so that none is in the way.
   number, from [m]: of the parcel, sorted together; own: of these bodies, if not those of the parcels. */
static PetscErrorCode join_bodies(Bodies b, PetscInt m, const char *parcel, PetscBool own, const PetscMPIInt from[])
{
  const size_t bytes = parcel_size(b);
  BodyArrays  *s     = &b->state;
  PetscInt    *number, *order, i = s->n - 1;

  PetscFunctionBeginUser;
  if (s->n + m > b->room) PetscCall(BodyReserve(b, s->n + m + (s->n + m) / 16));
  PetscCall(PetscMalloc2(m, &number, m, &order));
  for (PetscInt j = 0, at = 0; at < b->ncolumns && j < m; j++) { /* where the number stands in a parcel */
    size_t offset = 0;

    for (at = 0; b->column[at].array != (void **)&s->number; at++) offset += b->column[at].bytes;
    PetscCall(PetscMemcpy(number + j, parcel + (size_t)j * bytes + offset, sizeof(PetscInt)));
    order[j] = j;
  }
  PetscCall(PetscSortIntWithArray(m, number, order));
  for (PetscInt j = m - 1, at = s->n + m - 1; j >= 0; at--) {
    if (i >= 0 && s->number[i] > number[j]) move(b, i--, at);
    else {
      unpack(b, parcel + (size_t)order[j] * bytes, at);
      s->own[at]   = own;
      b->owner[at] = from[order[j]];
      j--;
    }
  }
  s->n += m;
  PetscCall(PetscFree2(number, order));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Parcels of bodies [n] to the ranks to [n]; comes: parcels that come and the ranks they come from, to be freed.
   Collective. */
static PetscErrorCode exchange(Bodies b, PetscInt n, PetscMPIInt to[], PetscInt body[], PetscInt *comes, char **in, PetscMPIInt **from)
{
  const BodyParts *p     = b->parts;
  const size_t     bytes = parcel_size(b);
  PetscMPIInt     *rank, *source, nto = 0, nfrom;
  PetscInt        *count, *arrives;
  char            *out;
  MPI_Datatype     type;
  MPI_Request     *request;

  PetscFunctionBeginUser;
  PetscCall(PetscSortMPIIntWithIntArray((PetscMPIInt)n, to, body));
  PetscCall(PetscMalloc3(n, &rank, n, &count, (size_t)n * bytes, &out));
  for (PetscInt i = 0; i < n; i++) {
    if (!i || to[i] != to[i - 1]) {
      rank[nto]    = to[i];
      count[nto++] = 0;
    }
    count[nto - 1]++;
    pack(b, body[i], out + (size_t)i * bytes);
  }
  PetscCall(PetscCommBuildTwoSided(p->comm, 1, MPIU_INT, nto, rank, count, &nfrom, &source, &arrives));
  *comes = 0;
  for (PetscMPIInt i = 0; i < nfrom; i++) *comes += arrives[i];
  PetscCall(PetscMalloc1((size_t)*comes * bytes, in));
  PetscCall(PetscMalloc1(*comes, from));
  PetscCall(PetscMalloc1(nto + nfrom, &request));
  PetscCallMPI(MPI_Type_contiguous((int)bytes, MPI_BYTE, &type));
  PetscCallMPI(MPI_Type_commit(&type));
  for (PetscInt i = 0, at = 0; i < nfrom; at += arrives[i++]) {
    PetscCallMPI(MPI_Irecv(*in + (size_t)at * bytes, (PetscMPIInt)arrives[i], type, source[i], p->tag, p->comm, request + i));
    for (PetscInt j = 0; j < arrives[i]; j++) (*from)[at + j] = source[i];
  }
  for (PetscInt i = 0, at = 0; i < nto; at += count[i++])
    PetscCallMPI(MPI_Isend(out + (size_t)at * bytes, (PetscMPIInt)count[i], type, rank[i], p->tag, p->comm, request + nfrom + i));
  PetscCallMPI(MPI_Waitall(nto + nfrom, request, MPI_STATUSES_IGNORE));
  PetscCallMPI(MPI_Type_free(&type));
  PetscCall(PetscFree(request));
  PetscCall(PetscFree(source));
  PetscCall(PetscFree(arrives));
  PetscCall(PetscFree3(rank, count, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- parts ---- */

/* Of all ways to cut the box the one with the least surface */
static void choose_parts(BodyParts *p)
{
  PetscReal best = PETSC_MAX_REAL;

  for (PetscInt i = 1; i <= p->size; i++)
    for (PetscInt j = 1; j <= p->size / i; j++) {
      const PetscInt n[3] = {i, j, p->size / i / j};
      PetscReal      sum  = 0;

      if (i * j * n[2] != p->size || (p->dim == 2 && n[2] > 1)) continue;
      for (PetscInt a = 0; a < p->dim; a++) sum += n[a] / (p->upper[a] - p->lower[a]);
      if (sum >= best) continue;
      best = sum;
      for (PetscInt a = 0; a < 3; a++) p->n[a] = n[a];
    }
}

PetscErrorCode BodyPartsCreate(MPI_Comm comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], const PetscReal period[3],
                               BodyParts **parts)
{
  BodyParts *p;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  PetscCall(PetscCommDuplicate(comm, &p->comm, &p->tag));
  p->dim = dim;
  PetscCallMPI(MPI_Comm_rank(comm, &p->rank));
  PetscCallMPI(MPI_Comm_size(comm, &p->size));
  for (PetscInt a = 0; a < dim; a++) {
    p->lower[a]  = lower[a];
    p->upper[a]  = upper[a];
    p->period[a] = period[a];
  }
  for (int i = 0; i < 2; i++) {
    PetscCallMPI(MPI_Type_contiguous(3 + i, MPIU_REAL, &p->unit[i]));
    PetscCallMPI(MPI_Type_commit(&p->unit[i]));
  }
  choose_parts(p);
  p->at[0] = p->rank % p->n[0];
  p->at[1] = p->rank / p->n[0] % p->n[1];
  p->at[2] = p->rank / p->n[0] / p->n[1];
  for (PetscInt a = 0; a < dim; a++) {
    PetscCall(PetscMalloc1(p->n[a] + 1, &p->cut[a]));
    for (PetscInt i = 0; i <= p->n[a]; i++) p->cut[a][i] = lower[a] + (upper[a] - lower[a]) * i / p->n[a];
  }
  *parts = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyPartsDestroy(BodyParts **parts)
{
  PetscFunctionBeginUser;
  if (!*parts) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++) PetscCall(PetscFree((*parts)->cut[a]));
  PetscCall(PetscSFDestroy(&(*parts)->ghosts));
  for (int i = 0; i < 2; i++) PetscCallMPI(MPI_Type_free(&(*parts)->unit[i]));
  PetscCall(PetscCommDestroy(&(*parts)->comm));
  PetscCall(PetscFree(*parts));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Centres outside of the domain count as on its face, but for an axis that is periodic */
static void inside_domain(const BodyParts *p, const PetscReal x[3], PetscReal y[3])
{
  for (PetscInt a = 0; a < p->dim; a++) y[a] = PetscMin(PetscMax(DomainWrap(p->period[a], x[a], p->lower[a]), p->lower[a]), p->upper[a]);
}

static PetscMPIInt find_rank(const BodyParts *p, const PetscReal x[3])
{
  PetscInt  at[3] = {0, 0, 0};
  PetscReal y[3];

  inside_domain(p, x, y);
  for (PetscInt a = 0; a < p->dim; a++)
    for (PetscInt low = 0, high = p->n[a]; high - low > 1; at[a] = low) {
      const PetscInt middle = (low + high) / 2;

      if (y[a] < p->cut[a][middle]) high = middle;
      else low = middle;
    }
  return (PetscMPIInt)((at[2] * p->n[1] + at[1]) * p->n[0] + at[0]);
}

PetscBool BodyPartsHold(const BodyParts *p, const PetscReal x[3])
{
  return (PetscBool)(!p || find_rank(p, x) == p->rank);
}

/* Is part i of an axis nearer to y than reach? */
static PetscBool is_near(const BodyParts *p, PetscInt a, PetscInt i, PetscReal y, PetscReal reach)
{
  for (PetscInt image = p->period[a] > 0 ? -1 : 0; image <= (p->period[a] > 0 ? 1 : 0); image++) {
    const PetscReal x = y + image * p->period[a];

    if (x > p->cut[a][i] - reach && x < p->cut[a][i + 1] + reach) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

static PetscBool is_deep(const BodyParts *p, const PetscReal y[3], PetscReal reach)
{
  for (PetscInt a = 0; a < p->dim; a++)
    if (p->n[a] > 1 && (y[a] <= p->cut[a][p->at[a]] + reach || y[a] >= p->cut[a][p->at[a] + 1] - reach)) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Cuts between which there are as many bodies, from counts in bins. Collective. */
static PetscErrorCode balance_parts(Bodies b)
{
  BodyParts        *p            = b->parts;
  const BodyArrays *s            = &b->state;
  PetscInt64        bin[3][BINS] = {{0}}, most[2] = {0, 0}, sum = 0;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal y[3];

    if (!s->own[k]) continue;
    most[0]++;
    inside_domain(p, s->x[k], y);
    for (PetscInt a = 0; a < p->dim; a++) bin[a][PetscMin(BINS - 1, (PetscInt)(BINS * (y[a] - p->lower[a]) / (p->upper[a] - p->lower[a])))]++;
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, most, 1, MPIU_INT64, MPI_MAX, p->comm));
  if (s->nall < AT_ONCE * p->size || most[0] * p->size < UNEVEN * s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, bin, 3 * BINS, MPIU_INT64, MPI_SUM, p->comm));
  for (PetscInt a = 0; a < p->dim; a++, sum = 0)
    for (PetscInt j = 0, i = 1; j < BINS && i < p->n[a]; sum += bin[a][j++])
      for (; i < p->n[a] && (sum + bin[a][j]) * p->n[a] >= (PetscInt64)i * s->nall; i++) {
        const PetscReal part = ((PetscReal)i * s->nall / p->n[a] - sum) / PetscMax(1, bin[a][j]);

        p->cut[a][i] = p->lower[a] + (p->upper[a] - p->lower[a]) * (j + part) / BINS;
      }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- migration ---- */

static PetscErrorCode move_to_owners(Bodies b)
{
  BodyArrays  *s = &b->state;
  PetscInt     n = 0, m, *body;
  PetscBool   *keep;
  PetscMPIInt *to, *from;
  char        *in;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(s->n, &keep, s->n, &to, s->n, &body));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscMPIInt rank = s->own[k] ? find_rank(b->parts, s->x[k]) : -1;

    keep[k] = (PetscBool)(rank == b->parts->rank);
    if (rank < 0 || keep[k]) continue;
    to[n]     = rank;
    body[n++] = k;
  }
  PetscCall(exchange(b, n, to, body, &m, &in, &from));
  keep_bodies(b, keep);
  PetscCall(join_bodies(b, m, in, PETSC_TRUE, from));
  PetscCall(PetscFree3(keep, to, body));
  PetscCall(PetscFree(in));
  PetscCall(PetscFree(from));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that are large, of all ranks. Collective. */
static PetscErrorCode list_large(Bodies b, PetscReal range, PetscReal skin, PetscReal large, PetscInt *n, Large **list)
{
  const BodyParts *p    = b->parts;
  BodyState       *s    = &b->view;
  PetscMPIInt      mine = 0, *count, *start;
  PetscInt         any;
  Large           *own;

  PetscFunctionBeginUser;
  *list = NULL;
  for (PetscInt k = 0; k < s->n; k++) mine += BodiesGetRadius(s, k) > large;
  any = mine;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_SUM, p->comm));
  *n = any;
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc3(mine, &own, p->size, &count, p->size + 1, &start));
  PetscCall(PetscMalloc1(any, list));
  for (PetscInt k = 0, i = 0; k < s->n; k++) {
    const PetscReal r = BodiesGetRadius(s, k);

    if (r > large) own[i++] = (Large){{s->x[k][0], s->x[k][1], s->x[k][2]}, range + skin * r, p->rank};
  }
  mine *= sizeof(Large) / sizeof(PetscReal);
  PetscCallMPI(MPI_Allgather(&mine, 1, MPI_INT, count, 1, MPI_INT, p->comm));
  start[0] = 0;
  for (PetscMPIInt r = 0; r < p->size; r++) start[r + 1] = start[r] + count[r];
  PetscCallMPI(MPI_Allgatherv(own, mine, MPIU_REAL, *list, count, start, MPIU_REAL, p->comm));
  PetscCall(PetscFree3(own, count, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

typedef struct {
  PetscInt     n, room, last; /* last: body that mark speaks of */
  PetscInt    *body, *mark;   /* mark [size]: 1 + the body that goes to this rank already */
  PetscMPIInt *to;
} Going;

static PetscErrorCode go(Going *g, PetscInt k, PetscMPIInt rank, PetscMPIInt self)
{
  PetscFunctionBeginUser;
  if (rank == self || g->mark[rank] == k + 1) PetscFunctionReturn(PETSC_SUCCESS);
  g->mark[rank] = k + 1;
  PetscCall(RoomFor(g->n + 1, &g->room, &g->body, sizeof(*g->body), &g->to, sizeof(*g->to), NULL));
  g->body[g->n] = k;
  g->to[g->n++] = rank;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ranks whose part is nearer to the centre of body k than reach */
static PetscErrorCode go_near(const BodyParts *p, PetscInt k, const PetscReal x[3], PetscReal reach, Going *g)
{
  PetscReal y[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  inside_domain(p, x, y);
  if (is_deep(p, y, reach)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt l = 0; l < p->n[2]; l++) {
    if (p->dim == 3 && !is_near(p, 2, l, y[2], reach)) continue;
    for (PetscInt j = 0; j < p->n[1]; j++) {
      if (!is_near(p, 1, j, y[1], reach)) continue;
      for (PetscInt i = 0; i < p->n[0]; i++)
        if (is_near(p, 0, i, y[0], reach)) PetscCall(go(g, k, (PetscMPIInt)((l * p->n[1] + j) * p->n[0] + i), p->rank));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode choose_ghosts(Bodies b, PetscReal range, PetscReal skin, Going *g)
{
  const BodyParts *p      = b->parts;
  BodyState       *s      = &b->view;
  PetscReal        narrow = PETSC_MAX_REAL, ordinary = 0;
  PetscInt         nlarge;
  Large           *list;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < p->dim; a++)
    for (PetscInt i = 0; i < p->n[a] && p->n[a] > 1; i++) narrow = PetscMin(narrow, LARGE * (p->cut[a][i + 1] - p->cut[a][i]));
  PetscCall(list_large(b, range, skin, narrow, &nlarge, &list));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal r = BodiesGetRadius(s, k);

    if (r <= narrow) ordinary = PetscMax(ordinary, r);
  }
  PetscCall(BodiesMax(b, 1, &ordinary));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal r = BodiesGetRadius(s, k);

    if (s->gone[k]) continue;
    for (PetscMPIInt rank = 0; rank < p->size && r > narrow; rank++) PetscCall(go(g, k, rank, p->rank));
    if (r > narrow) continue;
    PetscCall(go_near(p, k, s->x[k], range + skin * (r + ordinary), g));
    for (PetscInt i = 0; i < nlarge; i++) {
      PetscReal d[3] = {0, 0, 0};

      for (PetscInt a = 0; a < p->dim; a++) d[a] = DomainNearest(p->period[a], s->x[k][a] - list[i].x[a], 0);
      if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < PetscSqr(list[i].reach + skin * r)) PetscCall(go(g, k, (PetscMPIInt)list[i].owner, p->rank));
    }
  }
  PetscCall(PetscFree(list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ghosts know the rank of their owner and, from b->home, which of its own bodies they are */
static PetscErrorCode connect_ghosts(Bodies b)
{
  BodyParts   *p = b->parts;
  BodyArrays  *s = &b->state;
  PetscInt     n = 0, nown = 0, *leaf, *known;
  PetscSFNode *root;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(s->n, &leaf, s->n, &root, s->n, &known));
  for (PetscInt k = 0; k < s->n; k++)
    if (s->own[k]) known[nown++] = k;
  for (PetscInt k = 0; k < s->n; k++) {
    if (s->own[k]) continue;
    root[n]   = (PetscSFNode){b->owner[k], b->home[k]};
    leaf[n++] = k;
  }
  for (PetscInt pass = 0; pass < 2; pass++) { /* first only to learn where the owners have them now */
    PetscCall(PetscSFDestroy(&p->ghosts));
    PetscCall(PetscSFCreate(p->comm, &p->ghosts));
    PetscCall(PetscSFSetGraph(p->ghosts, pass ? s->n : nown, n, leaf, PETSC_COPY_VALUES, root, PETSC_COPY_VALUES));
    PetscCall(PetscSFSetUp(p->ghosts));
    if (pass) break;
    PetscCall(PetscSFBcastBegin(p->ghosts, MPIU_INT, known, b->home, MPI_REPLACE));
    PetscCall(PetscSFBcastEnd(p->ghosts, MPIU_INT, known, b->home, MPI_REPLACE));
    for (PetscInt i = 0; i < n; i++) root[i].index = b->home[leaf[i]];
  }
  PetscCall(PetscFree3(leaf, root, known));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode send_ghosts(Bodies b, PetscReal range, PetscReal skin)
{
  Going        g = {0};
  PetscInt     m;
  PetscMPIInt *from;
  char        *in;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < b->state.n; k++) b->home[k] = k;
  PetscCall(PetscCalloc1(b->parts->size, &g.mark));
  PetscCall(choose_ghosts(b, range, skin, &g));
  PetscCall(exchange(b, g.n, g.to, g.body, &m, &in, &from));
  PetscCall(join_bodies(b, m, in, PETSC_FALSE, from));
  PetscCall(connect_ghosts(b));
  PetscCall(PetscFree(g.mark));
  PetscCall(PetscFree(g.body));
  PetscCall(PetscFree(g.to));
  PetscCall(PetscFree(in));
  PetscCall(PetscFree(from));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesMigrate(Bodies b, PetscReal range, PetscReal skin)
{
  PetscFunctionBeginUser;
  if (!b->parts) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_MIGRATE, 0, 0, 0, 0));
  PetscCall(balance_parts(b));
  PetscCall(move_to_owners(b));
  PetscCall(send_ghosts(b, range, skin));
  PetscCall(PetscLogEventEnd(TB_MIGRATE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSync(Bodies b, PetscBool turns)
{
  BodyArrays *s    = &b->state;
  void *const v[4] = {s->x, s->u, s->w, s->q};

  PetscFunctionBeginUser;
  if (!b->parts || !b->parts->ghosts) PetscFunctionReturn(PETSC_SUCCESS); /* nobody looks at others */
  PetscCall(PetscLogEventBegin(TB_SYNC, 0, 0, 0, 0));
  for (PetscInt i = 0; i < (turns ? 4 : 2); i++) PetscCall(PetscSFBcastBegin(b->parts->ghosts, b->parts->unit[i == 3], v[i], v[i], MPI_REPLACE));
  for (PetscInt i = 0; i < (turns ? 4 : 2); i++) PetscCall(PetscSFBcastEnd(b->parts->ghosts, b->parts->unit[i == 3], v[i], v[i], MPI_REPLACE));
  PetscCall(PetscLogEventEnd(TB_SYNC, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesUpdateGhosts(Bodies b, PetscInt width, void *v)
{
  BodyParts *p = b->parts;

  PetscFunctionBeginUser;
  if (!p || !p->ghosts) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_SYNC, 0, 0, 0, 0));
  PetscCall(PetscSFBcastBegin(p->ghosts, p->unit[width - 3], v, v, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(p->ghosts, p->unit[width - 3], v, v, MPI_REPLACE));
  PetscCall(PetscLogEventEnd(TB_SYNC, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

MPI_Comm BodiesComm(Bodies b)
{
  return b->parts ? b->parts->comm : PETSC_COMM_SELF;
}
