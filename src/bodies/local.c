/* BodiesLocal: see local.h. Bodies that go to their owners, ghosts, what these hear of their owners. */
#include "compat.h"
#include "base/runcomm.h"
#include "impl.h"
#include "subdomains.h"
#include "base/domain.h"
#include "base/log.h"
#include "base/sparse.h"
#include "base/array.h"
#include "base/rowtype.h"

#define LARGE 0.25 /* radius by the width of a part, beyond which a body is known to all ranks */

/* A body that is large: its place, how far its centre keeps others away, its owner */
typedef struct {
  PetscReal x[3], reach, owner;
} Large;

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
    const PetscMPIInt rank = s->own[k] ? BodySubdomainsRank(b->subdomains, s->x[k]) : -1;

    keep[k] = (PetscBool)(rank == b->subdomains->rank);
    if (rank < 0 || keep[k]) continue;
    to[n]     = rank;
    body[n++] = k;
  }
  PetscCall(BodyExchange(b, n, to, body, &m, &in, &from));
  BodyKeep(b, keep);
  PetscCall(BodyJoin(b, m, in, PETSC_TRUE, from));
  PetscCall(PetscFree3(keep, to, body));
  PetscCall(PetscFree(in));
  PetscCall(PetscFree(from));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that are large, of all ranks. Collective. */
static PetscErrorCode list_large(Bodies b, PetscReal range, PetscReal skin, PetscReal large, PetscInt *n, Large **list)
{
  const BodySubdomains *p    = b->subdomains;
  BodyState            *s    = &b->view;
  PetscInt              mine = 0, any;
  Large                *own;

  PetscFunctionBeginUser;
  *list = NULL;
  for (PetscInt k = 0; k < s->n; k++) mine += BodiesGetRadius(s, k) > large;
  any = mine;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_SUM, p->comm));
  *n = any;
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(mine, &own));
  for (PetscInt k = 0, i = 0; k < s->n; k++) {
    const PetscReal r = BodiesGetRadius(s, k);

    if (r > large) own[i++] = (Large){{s->x[k][0], s->x[k][1], s->x[k][2]}, range + skin * r, p->rank};
  }
  PetscCall(SparseGather(p->comm, mine, sizeof(*own), own, n, list, NULL));
  PetscCall(PetscFree(own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

typedef struct {
  PetscInt     n, capacity, last; /* last: body that mark speaks of */
  PetscInt    *body, *mark;       /* mark [size]: 1 + the body that goes to this rank already */
  PetscMPIInt *to;
} SendList;

static PetscErrorCode send_to_rank(SendList *g, PetscInt k, PetscMPIInt rank, PetscMPIInt self)
{
  PetscFunctionBeginUser;
  if (rank == self || g->mark[rank] == k + 1) PetscFunctionReturn(PETSC_SUCCESS);
  g->mark[rank] = k + 1;
  PetscCall(ArrayReserve(g->n + 1, &g->capacity, &g->body, sizeof(*g->body), &g->to, sizeof(*g->to), NULL));
  g->body[g->n] = k;
  g->to[g->n++] = rank;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ranks whose part is nearer to the centre of body k than reach */
static PetscErrorCode send_near(const BodySubdomains *p, PetscInt k, const PetscReal x[3], PetscReal reach, SendList *g)
{
  PetscReal y[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  BodySubdomainsInside(p, x, y);
  if (p->regions) {
    const PetscMPIInt *rank;
    PetscInt           n;

    PetscCall(RankBoxesNear(p->regions, y, reach + p->beyond + p->farther, &n, &rank));
    for (PetscInt i = 0; i < n; i++) PetscCall(send_to_rank(g, k, rank[i], p->rank));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (BodySubdomainsDeep(p, y, reach)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt l = 0; l < p->n[2]; l++) {
    if (p->dim == 3 && !BodySubdomainsNear(p, 2, l, y[2], reach)) continue;
    for (PetscInt j = 0; j < p->n[1]; j++) {
      if (!BodySubdomainsNear(p, 1, j, y[1], reach)) continue;
      for (PetscInt i = 0; i < p->n[0]; i++)
        if (BodySubdomainsNear(p, 0, i, y[0], reach))
          PetscCall(send_to_rank(g, k, (PetscMPIInt)((l * p->n[1] + j) * p->n[0] + i), p->rank));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Radius beyond which a body is known to all ranks: by the narrowest part, those of a mesh by their mean */
static PetscReal find_large(const BodySubdomains *p)
{
  PetscReal min = PETSC_MAX_REAL, mean = 1. / p->size;

  for (PetscInt a = 0; a < p->dim; a++) {
    mean *= p->upper[a] - p->lower[a];
    for (PetscInt i = 0; i < p->n[a] && p->n[a] > 1 && !p->regions; i++)
      min = PetscMin(min, p->cut[a][i + 1] - p->cut[a][i]);
  }
  return LARGE * (p->regions ? PetscPowReal(mean, 1. / p->dim) : min);
}

static PetscErrorCode choose_ghosts(Bodies b, PetscReal range, PetscReal skin, SendList *g)
{
  const BodySubdomains *p        = b->subdomains;
  BodyState            *s        = &b->view;
  const PetscReal       large    = find_large(p);
  PetscReal             ordinary = 0;
  PetscInt              nlarge;
  Large                *list;

  PetscFunctionBeginUser;
  PetscCall(list_large(b, range, skin, large, &nlarge, &list));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal r = BodiesGetRadius(s, k);

    if (r <= large) ordinary = PetscMax(ordinary, r);
  }
  PetscCall(BodiesMax(b, 1, &ordinary));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal r = BodiesGetRadius(s, k);

    if (s->removed[k] && !p->regions) continue; /* a flow may still see where they were last */
    for (PetscMPIInt rank = 0; rank < p->size && (r > large || BodiesGetGroup(s, k)->everywhere); rank++)
      PetscCall(send_to_rank(g, k, rank, p->rank));
    if (r > large) continue;
    PetscCall(send_near(p, k, s->x[k], range + skin * (r + ordinary), g));
    for (PetscInt i = 0; i < nlarge; i++) {
      PetscReal d[3] = {0, 0, 0};

      for (PetscInt a = 0; a < p->dim; a++) d[a] = DomainNearest(p->period[a], s->x[k][a] - list[i].x[a], 0);
      if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < PetscSqr(list[i].reach + skin * r))
        PetscCall(send_to_rank(g, k, (PetscMPIInt)list[i].owner, p->rank));
    }
  }
  PetscCall(PetscFree(list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ghosts know the rank of their owner and, from b->home, which of its own bodies they are */
static PetscErrorCode connect_ghosts(Bodies b)
{
  BodySubdomains *p = b->subdomains;
  BodyArrays     *s = &b->state;
  PetscInt        n = 0, nown = 0, *leaf, *own_list;
  PetscSFNode    *root;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(s->n, &leaf, s->n, &root, s->n, &own_list));
  for (PetscInt k = 0; k < s->n; k++)
    if (s->own[k]) own_list[nown++] = k;
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
    PetscCall(PetscSFBcastBegin(p->ghosts, MPIU_INT, own_list, b->home, MPI_REPLACE));
    PetscCall(PetscSFBcastEnd(p->ghosts, MPIU_INT, own_list, b->home, MPI_REPLACE));
    for (PetscInt i = 0; i < n; i++) root[i].index = b->home[leaf[i]];
  }
  PetscCall(PetscFree3(leaf, root, own_list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode send_ghosts(Bodies b, PetscReal range, PetscReal skin)
{
  SendList     g = {0};
  PetscInt     m;
  PetscMPIInt *from;
  char        *in;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < b->state.n; k++) b->home[k] = k;
  PetscCall(PetscCalloc1(b->subdomains->size, &g.mark));
  PetscCall(choose_ghosts(b, range, skin, &g));
  PetscCall(BodyExchange(b, g.n, g.to, g.body, &m, &in, &from));
  PetscCall(BodyJoin(b, m, in, PETSC_FALSE, from));
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
  if (!b->subdomains) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_MIGRATE, 0, 0, 0, 0));
  PetscCall(BodySubdomainsBalance(b));
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
  if (!b->subdomains || !b->subdomains->ghosts) PetscFunctionReturn(PETSC_SUCCESS); /* nobody looks at others */
  PetscCall(PetscLogEventBegin(TB_SYNC, 0, 0, 0, 0));
  for (PetscInt i = 0; i < (turns ? 4 : 2); i++)
    PetscCall(PetscSFBcastBegin(b->subdomains->ghosts, b->subdomains->unit[i == 3], v[i], v[i], MPI_REPLACE));
  for (PetscInt i = 0; i < (turns ? 4 : 2); i++)
    PetscCall(PetscSFBcastEnd(b->subdomains->ghosts, b->subdomains->unit[i == 3], v[i], v[i], MPI_REPLACE));
  PetscCall(PetscLogEventEnd(TB_SYNC, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesUpdateGhosts(Bodies b, PetscInt width, void *v)
{
  BodySubdomains *p = b->subdomains;
  MPI_Datatype    unit;

  PetscFunctionBeginUser;
  if (!p || !p->ghosts) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_SYNC, 0, 0, 0, 0));
  PetscCall(RowTypeCreate(width, &unit));
  PetscCall(PetscSFBcastBegin(p->ghosts, unit, v, v, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(p->ghosts, unit, v, v, MPI_REPLACE));
  PetscCall(RowTypeDestroy(&unit));
  PetscCall(PetscLogEventEnd(TB_SYNC, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reduce_local(Bodies b, MPI_Op op, PetscInt width, PetscReal v[])
{
  BodySubdomains *p = b->subdomains;
  MPI_Datatype    unit;
  PetscMPIInt     n;

  PetscFunctionBeginUser;
  PetscCall(PetscMPIIntCast(width * b->state.n, &n));
  if (!p) PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, n, MPIU_REAL, op, RunComm()));
  if (!p || !p->ghosts) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(RowTypeCreate(width, &unit));
  PetscCall(PetscSFReduceBegin(p->ghosts, unit, v, v, op));
  PetscCall(PetscSFReduceEnd(p->ghosts, unit, v, v, op));
  PetscCall(PetscSFBcastBegin(p->ghosts, unit, v, v, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(p->ghosts, unit, v, v, MPI_REPLACE));
  PetscCall(RowTypeDestroy(&unit));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSumLocal(Bodies b, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(reduce_local(b, MPIU_SUM, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesMaxLocal(Bodies b, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(reduce_local(b, MPIU_MAX, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetOwners(Bodies b, PetscMPIInt rank[], PetscInt which[])
{
  BodySubdomains *p = b->subdomains;
  PetscInt        n = 0;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < b->state.n; k++) {
    rank[k]  = b->state.own[k] ? p->rank : b->owner[k];
    which[k] = b->state.own[k] ? n++ : -1;
  }
  if (!p->ghosts) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSFBcastBegin(p->ghosts, MPIU_INT, which, which, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(p->ghosts, MPIU_INT, which, which, MPI_REPLACE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSetEverywhere(Bodies b, PetscInt group)
{
  PetscFunctionBeginUser;
  b->state.group[group].everywhere = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGatherStarts(Bodies b)
{
  const BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n && b->subdomains; k++) {
    const PetscInt g = s->body_group[k];

    if (s->own[k] && b->start[g]) BodySetStart(b, g, s->number[k] - s->group[g].first, s->x[k], s->q[k], s->angle[k]);
  }
  PetscCall(BodyGatherStarts(b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As BodiesGetCentres, of the bodies of others */
static PetscErrorCode receive_positions(Bodies b, PetscReal reach, PetscInt *m, PetscReal (**in)[3])
{
  const BodyArrays *s = &b->state;
  SendList          g = {0};
  PetscMPIInt      *from;
  PetscReal(*out)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(b->subdomains->size, &g.mark));
  for (PetscInt k = 0; k < s->n; k++)
    if (s->own[k] && !s->removed[k]) PetscCall(send_near(b->subdomains, k, s->x[k], reach, &g));
  PetscCall(PetscSortMPIIntWithIntArray((PetscMPIInt)g.n, g.to, g.body));
  PetscCall(PetscMalloc1(g.n, &out));
  for (PetscInt i = 0; i < g.n; i++) PetscCall(PetscArraycpy(out[i], s->x[g.body[i]], 3));
  PetscCall(BodiesExchange(b, g.n, g.to, sizeof(*out), out, m, in, &from));
  PetscCall(PetscFree(out));
  PetscCall(PetscFree(from));
  PetscCall(PetscFree(g.mark));
  PetscCall(PetscFree(g.body));
  PetscCall(PetscFree(g.to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetCentres(Bodies b, PetscReal reach, PetscInt *mine, PetscInt *n, PetscReal (**x)[3])
{
  const BodyArrays *s = &b->state;
  PetscInt          m = 0;
  PetscReal(*in)[3]   = NULL;

  PetscFunctionBeginUser;
  if (b->subdomains) PetscCall(receive_positions(b, reach, &m, &in));
  PetscCall(PetscMalloc1(s->n + m, x));
  *n = 0;
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt i = 0; i < s->n + m; i++) {
      const PetscReal *y = i < s->n ? s->x[i] : in[i - s->n];

      if (i < s->n && (!s->own[i] || s->removed[i])) continue;
      if (BodySubdomainsOwn(b->subdomains, y) == (PetscBool)(pass == 0)) PetscCall(PetscArraycpy((*x)[(*n)++], y, 3));
    }
    if (pass == 0) *mine = *n;
  }
  PetscCall(PetscFree(in));
  PetscFunctionReturn(PETSC_SUCCESS);
}
