/* Gaps: see gaps.h. Of round bodies in closed form, of others by points of their surface. */
#include "compat.h"
#include "gaps.h"
#include "walls.h"
#include "base/domain.h"
#include "base/opt.h"
#include "bodies/local.h"
#include <string.h>

#define SURFACE 500 /* points */

typedef struct {
  Mesh             mesh;
  Bodies           bodies;
  BodyState       *s;
  const MeshLocal *l;
  Border           border;
  PetscInt         sides, nboundary; /* sides of a box that are walls */
  PetscBool       *open;             /* [nboundary] openings */
  PetscReal        reach;            /* a length */
  LastingGap       narrowest[2];     /* between bodies, from walls */
} Search;

static PetscBool stays(const Search *f, PetscInt k, PetscBool steady)
{
  const BodyGroup *g = BodiesGetGroup(f->s, k);
  const PetscReal *u = f->s->u[k];

  if (g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z) || g->motion.has_pivot || g->motion.has_hinge ||
      g->motion.has_slide || g->pack.wanted)
    return PETSC_FALSE;
  return (PetscBool)(steady || (!g->motion.given && u[0] == 0 && u[1] == 0 && u[2] == 0));
}

static PetscBool is_drawn(const Search *f, PetscInt k)
{
  return (PetscBool)(!f->s->removed[k] && !BodiesGetGroup(f->s, k)->body_fitted);
}

/* A gap of body k: if it is the narrowest of its kind, the caller appends what is beyond it */
static LastingGap *is_narrower(Search *f, PetscInt k, PetscReal gap, PetscBool wall)
{
  LastingGap *narrowest = &f->narrowest[wall ? 1 : 0];

  if (gap <= 1e-6 * BodiesGetRadius(f->s, k) || gap >= f->reach || gap / f->l->h >= narrowest->cells) return NULL;
  narrowest->cells = gap / f->l->h;
  narrowest->group = f->s->body_group[k];
  (void)snprintf(narrowest->between, sizeof(narrowest->between), "body %d of group '%s'", (int)f->s->number[k],
                 BodiesGetGroup(f->s, k)->name);
  return narrowest;
}

static void append(LastingGap *narrowest, const char text[], const char name[])
{
  const size_t at = strlen(narrowest->between);

  (void)snprintf(narrowest->between + at, sizeof(narrowest->between) - at, text, name);
}

/* From the surface of body k to body j at X; x [n][dim]: points of that surface, of round ones its centre */
static PetscErrorCode measure_pair(Search *f, PetscInt k, PetscInt n, const PetscReal x[], PetscInt j,
                                   const PetscReal X[3], PetscReal *gap)
{
  const PetscReal inside = BodiesGetDisc(f->s, k);
  PetscReal      *d;

  PetscFunctionBeginUser;
  *gap = PETSC_MAX_REAL;
  PetscCall(PetscMalloc1(n, &d));
  PetscCall(BodiesDistance(f->bodies, j, X, NULL, n, x, d));
  for (PetscInt p = 0; p < n; p++) *gap = PetscMin(*gap, d[p] - inside);
  PetscCall(PetscFree(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode search_images(Search *f, PetscInt k, PetscInt n, const PetscReal x[])
{
  const PetscReal *period = f->l->period, wide = 2 * BodiesGetRadius(f->s, k) + f->reach;

  PetscFunctionBeginUser;
  for (PetscInt m = 14; m < 27; m++) { /* half of all images */
    const PetscInt step[3] = {m % 3 - 1, m / 3 % 3 - 1, m / 9 - 1};
    PetscReal      X[3], far = 0, gap;
    PetscBool      is = PETSC_TRUE;
    LastingGap    *narrowest;

    for (PetscInt a = 0; a < 3; a++) {
      const PetscReal image_shift = a < f->l->dim ? step[a] * period[a] : 0;

      is   = (PetscBool)(is && (!step[a] || image_shift != 0));
      X[a] = f->s->x[k][a] + image_shift;
      far += image_shift * image_shift;
    }
    if (!is || far >= wide * wide) continue;
    PetscCall(measure_pair(f, k, n, x, k, X, &gap));
    narrowest = is_narrower(f, k, gap, PETSC_FALSE);
    if (narrowest) append(narrowest, " and its own image%s", "");
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies after k that stay as well */
static PetscErrorCode search_bodies(Search *f, PetscInt k, PetscBool steady, PetscInt n, const PetscReal x[])
{
  PetscFunctionBeginUser;
  for (PetscInt j = k + 1; j < f->s->n; j++) {
    const PetscReal wide = BodiesGetRadius(f->s, k) + BodiesGetRadius(f->s, j) + f->reach;
    PetscReal       X[3], far = 0, gap;
    LastingGap     *narrowest;
    char            name[96];

    if (!stays(f, j, steady) || !is_drawn(f, j)) continue;
    for (PetscInt a = 0; a < 3; a++) {
      X[a] = a < f->l->dim ? DomainNearest(f->l->period[a], f->s->x[j][a], f->s->x[k][a]) : f->s->x[j][a];
      far += PetscSqr(X[a] - f->s->x[k][a]);
    }
    if (far >= wide * wide) continue;
    PetscCall(measure_pair(f, k, n, x, j, X, &gap));
    (void)snprintf(name, sizeof(name), "body %d of group '%s'", (int)f->s->number[j], BodiesGetGroup(f->s, j)->name);
    narrowest = is_narrower(f, k, gap, PETSC_FALSE);
    if (narrowest) append(narrowest, " and %s", name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode search_sides(Search *f, PetscInt k, PetscInt n, const PetscReal x[])
{
  PetscFunctionBeginUser;
  for (PetscInt side = 0; side < 2 * f->l->dim; side++) {
    const PetscInt a   = side / 2;
    PetscReal      gap = PETSC_MAX_REAL;
    LastingGap    *narrowest;

    if (!(f->sides >> side & 1)) continue;
    for (PetscInt p = 0; p < n; p++) {
      const PetscReal y = x[p * f->l->dim + a];

      gap = PetscMin(gap, (side % 2 ? f->l->upper[a] - y : y - f->l->lower[a]) - BodiesGetDisc(f->s, k));
    }
    narrowest = is_narrower(f, k, gap, PETSC_TRUE);
    if (narrowest) append(narrowest, " and the wall '%s'", DOMAIN_SIDE[side]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode search_border(Search *f, PetscInt k, PetscInt n, const PetscReal x[])
{
  PetscReal *gap;
  PetscInt   boundary;
  PetscReal  d;

  PetscFunctionBeginUser;
  PetscCall(BorderLocate(f->border, f->s->x[k], BodiesGetRadius(f->s, k) + f->reach, &boundary, &d));
  if (boundary < 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(f->nboundary, &gap));
  for (PetscInt b = 0; b < f->nboundary; b++) gap[b] = PETSC_MAX_REAL;
  for (PetscInt p = 0; p < n; p++) {
    const PetscReal at[3] = {x[p * f->l->dim], x[p * f->l->dim + 1], f->l->dim == 3 ? x[p * f->l->dim + 2] : 0};

    PetscCall(BorderLocate(f->border, at, BodiesGetDisc(f->s, k) + f->reach, &boundary, &d));
    if (boundary >= 0) gap[boundary] = PetscMin(gap[boundary], d - BodiesGetDisc(f->s, k));
  }
  for (PetscInt b = 0; b < f->nboundary; b++) {
    const char *name;
    LastingGap *narrowest;

    PetscCall(BorderGetName(f->border, b, &name));
    narrowest = f->open[b] ? NULL : is_narrower(f, k, gap[b], PETSC_TRUE);
    if (narrowest) append(narrowest, " and the wall '%s'", name);
  }
  PetscCall(PetscFree(gap));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the body a hole of the mesh, whose surface is fitted? */
static PetscErrorCode is_body_fitted(const Search *f, PetscInt k, PetscBool *body_fitted)
{
  PetscInt  boundary = -1;
  PetscReal gap      = 0;

  PetscFunctionBeginUser;
  if (f->border) PetscCall(BorderLocate(f->border, f->s->x[k], PETSC_MAX_REAL, &boundary, &gap));
  *body_fitted = (PetscBool)(boundary >= 0 && gap < 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode search_body(Search *f, PetscInt k, PetscBool steady)
{
  const PetscBool still = stays(f, k, steady);
  PetscReal      *x;
  PetscInt        n;
  PetscBool       any = still, body_fitted = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < f->l->dim; a++)
    any = (PetscBool)(any || (f->l->period[a] > 0 && f->l->period[a] < 2 * BodiesGetRadius(f->s, k) + f->reach));
  if (any) PetscCall(is_body_fitted(f, k, &body_fitted));
  if (!any || body_fitted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesSurfacePoints(f->bodies, k, NULL, NULL, BodiesGetDisc(f->s, k) > 0 ? 0 : SURFACE, &n, &x, NULL));
  PetscCall(search_images(f, k, n, x));
  if (still) {
    PetscCall(search_bodies(f, k, steady, n, x));
    PetscCall(search_sides(f, k, n, x));
    PetscCall(search_border(f, k, n, x));
  }
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is there a condition of an opening at this boundary? */
static PetscErrorCode is_opening(const char name[], PetscBool *open)
{
  static const char *const WORDS[] = {"inflow", "outflow", "pressure"}; /* no other word for them is accepted */
  char                     option[OPT_NAME], text[64];

  PetscFunctionBeginUser;
  *open = PETSC_FALSE;
  PetscCall(OptPeek(OptJoin("-flow_bc_", name, "_type", option), text, sizeof(text)));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(WORDS); i++)
    *open = (PetscBool)(*open || !strcasecmp(text, WORDS[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_walls(Search *f)
{
  ContactWalls walls;

  PetscFunctionBeginUser;
  PetscCall(WallsFind(f->mesh, NULL, f->bodies, &f->border, &f->sides, &walls));
  PetscCall(MeshGetBoundaryCount(f->mesh, &f->nboundary));
  PetscCall(PetscMalloc1(f->nboundary, &f->open));
  for (PetscInt b = 0; b < f->nboundary; b++) {
    const char *name;

    PetscCall(MeshGetBoundaryName(f->mesh, b, &name));
    PetscCall(is_opening(name, &f->open[b]));
    for (PetscInt side = 0; side < 2 * f->l->dim; side++)
      if (walls.side[side] == b && f->open[b]) f->sides &= ~(1 << side);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The narrowest of all ranks, of equal ones that of the lowest rank */
static PetscErrorCode agree(MPI_Comm comm, LastingGap *narrowest)
{
  const PetscReal mine = narrowest->cells;
  PetscReal       all;
  PetscMPIInt     rank, from;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCall(MPIU_Allreduce(&mine, &all, 1, MPIU_REAL, MPIU_MIN, comm));
  from = mine == all ? rank : PETSC_MPI_INT_MAX;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &from, 1, MPI_INT, MPI_MIN, comm));
  PetscCallMPI(MPI_Bcast(narrowest, (PetscMPIInt)sizeof(*narrowest), MPI_BYTE, from, comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode GapsFindNarrowest(Mesh mesh, Bodies bodies, PetscBool steady, PetscReal reach, LastingGap narrowest[2])
{
  const LastingGap none = {.cells = PETSC_MAX_REAL, .group = -1};
  Search           f    = {.mesh = mesh, .bodies = bodies, .narrowest = {none, none}};
  MPI_Comm         comm;

  PetscFunctionBeginUser;
  PetscCall(MeshGetComm(mesh, &comm));
  PetscCall(MeshGetLocal(mesh, &f.l));
  PetscCall(BodiesGetState(bodies, &f.s));
  f.reach = reach * f.l->h;
  PetscCall(find_walls(&f));
  for (PetscInt k = 0; k < f.s->n; k++)
    if (is_drawn(&f, k)) PetscCall(search_body(&f, k, steady));
  PetscCall(BorderDestroy(&f.border));
  PetscCall(PetscFree(f.open));
  for (PetscInt wall = 0; wall < 2; wall++) {
    PetscCall(agree(comm, &f.narrowest[wall]));
    narrowest[wall] = f.narrowest[wall];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
