/* Align: see align/align.h. All decisions about a node are made by its owner, who sees all cells around it, and are
   then sent to the ghosts; all work is on lists of what surfaces touch. */
#include "compat.h"
#include "impl.h"

#define NPULL 10 /* times that vertices of bad cells are pulled back */
#define NTRY  6  /* times that covered cells beside a bad one are given back */

static void swap_lists(List *a, List *b)
{
  List t = *a;

  *a = *b;
  *b = t;
}

/* ---- surfaces by their numbers ---- */

/* What a fit fills anew for every surface */
static const struct {
  size_t where, bytes;
} PER_SURFACE[] = {{offsetof(struct _p_Align, tally.flags), 3 * sizeof(PetscInt)},
                   {offsetof(struct _p_Align, tally.area), sizeof(PetscReal)},
                   {offsetof(struct _p_Align, tally.lost), sizeof(PetscReal)},
                   {offsetof(struct _p_Align, tally.passes), sizeof(PetscInt)},
                   {offsetof(struct _p_Align, tally.stray), sizeof(PetscInt)},
                   {offsetof(struct _p_Align, tally.inside), sizeof(PetscReal)},
                   {offsetof(struct _p_Align, tally.could), sizeof(PetscBool)},
                   {offsetof(struct _p_Align, last.inactive), sizeof(PetscBool)},
                   {offsetof(struct _p_Align, corners.wanted), sizeof(PetscBool)},
                   {offsetof(struct _p_Align, corners.count), sizeof(PetscInt)},
                   {offsetof(struct _p_Align, corners.taken), sizeof(PetscInt)},
                   {offsetof(struct _p_Align, images.joined), sizeof(PetscInt)},
                   {offsetof(struct _p_Align, paths.line), sizeof(Midline)},
                   {offsetof(struct _p_Align, paths.is), sizeof(PetscBool)},
                   {offsetof(struct _p_Align, paths.of), sizeof(AlignPath)},
                   {offsetof(struct _p_Align, paths.smallest), sizeof(PetscReal)}};

static void **per_surface(Align s, size_t i)
{
  return (void **)((char *)s + PER_SURFACE[i].where);
}

/* The surfaces are others than in the last fit: its covered cells by what k is now, -1 where it is not known any
   more */
static PetscErrorCode renumber(Align s)
{
  const PetscInt n    = s->surfaces->n;
  PetscBool      same = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (n == s->n && s->last.number) PetscCall(PetscArraycmp(s->last.number, s->surfaces->number, n, &same));
  if (same) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < s->last.covered.n; e++) {
    PetscInt *k = &s->last.cell_surface[s->last.covered.i[e]];

    if (*k >= 0) *k = AlignFind(s, s->last.number[*k]);
  }
  PetscCall(ArrayReserve(n, &s->last.capacity, &s->last.number, sizeof(*s->last.number), NULL));
  PetscCall(PetscArraycpy(s->last.number, s->surfaces->number, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The surfaces that are there now */
static PetscErrorCode begin_fit(Align s)
{
  PetscFunctionBeginUser;
  PetscCall(renumber(s));
  s->n = s->surfaces->n;
  if (s->n > s->capacity || !s->tally.flags) {
    s->capacity = s->n + s->n / 2;
    for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(PER_SURFACE); i++) {
      PetscCall(PetscFree(*per_surface(s, i)));
      PetscCall(PetscCalloc1(PetscMax(1, s->capacity) * PER_SURFACE[i].bytes, (char **)per_surface(s, i)));
    }
  }
  PetscCall(AlignPathBegin(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the result ---- */

/* What was made of the covered cells */
static void clear_positions(Align s)
{
  for (PetscInt e = 0; e < s->marked.n; e++) s->code[s->marked.i[e]] = 0;
  for (PetscInt e = 0; e < s->ring.n; e++) s->level[s->ring.i[e]] = 0;
  for (PetscInt e = 0; e < s->placed.n; e++)
    for (PetscInt a = 0; a < s->loc->dim; a++) s->d[s->loc->dim * s->placed.i[e] + a] = 0;
  for (PetscInt e = 0; e < s->corners.node.n; e++) s->corners.at[s->corners.node.i[e]] = 0;
  s->ring.n = s->touched.n = s->corners.node.n = 0;
}

static void clear_entries(Align s)
{
  for (PetscInt e = 0; e < s->covered.n; e++) s->cover[s->covered.i[e]] = 0;
  clear_positions(s);
}

/* Cells of the aligned surfaces and the mesh around them */
static PetscErrorCode try_fit(Align s, const PetscBool aligned[], PetscReal *quality)
{
  PetscBool any;

  PetscFunctionBeginUser;
  s->aligned        = aligned;
  s->corners.left.n = 0;
  PetscCall(AlignCoverCells(s, aligned));
  if (s->pull) PetscCall(AlignPullBegin(s));
  for (PetscInt i = 0; i <= (s->pull ? NPULL : NTRY); i++) {
    PetscCall(AlignOpenGaps(s));
    if (s->loc->dim == 3) PetscCall(AlignRepair(s));
    PetscCall(AlignClassifyNodes(s));
    PetscCall(PetscArrayzero(s->tally.lost, s->n));
    PetscCall(PetscArrayzero(s->tally.stray, s->n));
    PetscCall(AlignPlaceWallVertices(s));
    PetscCall(AlignPathPlaceVertices(s));
    PetscCall(AlignFindRings(s));
    PetscCall(AlignSmoothRings(s));
    PetscCall(AlignPlaceOtherNodes(s));
    PetscCall(AlignCheckLevels(s));
    if (s->loc->dim == 3) PetscCall(AlignMend(s));
    PetscCall(AlignCheckCells(s, quality));
    if (i == (s->pull ? NPULL : NTRY)) break;
    if (s->pull) PetscCall(AlignPullBack(s, &any));
    else if (s->loc->dim == 2) PetscCall(AlignOpenBadCorners(s, &any));
    else PetscCall(AlignLeaveBadEdges(s, &any));
    if (!any) break;
    clear_positions(s);
    s->marked.n = s->placed.n = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes (of the last fit and of this one) whose place changes */
static PetscErrorCode collect_nodes(Align s)
{
  const MeshLocal *l   = s->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  s->now++;
  s->last.node.n = 0;
  PetscCall(
    ArrayReserve(s->placed.n + s->last.placed.n, &s->last.x_capacity, &s->last.x, dim * sizeof(*s->last.x), NULL));
  for (PetscInt e = 0; e < s->placed.n + s->last.placed.n; e++) {
    const PetscInt i     = e < s->placed.n ? s->placed.i[e] : s->last.placed.i[e - s->placed.n];
    PetscReal     *x     = s->last.x + dim * s->last.node.n;
    PetscBool      moves = PETSC_FALSE;

    if (s->stamp[0][i] == s->now) continue;
    for (PetscInt a = 0; a < dim; a++) {
      x[a]  = l->x_start[dim * i + a] + s->d[dim * i + a];
      moves = (PetscBool)(moves || x[a] != l->x[dim * i + a]);
    }
    if (!moves) continue;
    s->stamp[0][i] = s->now;
    PetscCall(AlignListAdd(&s->last.node, i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_cell(Align s, PetscInt c)
{
  PetscFunctionBeginUser;
  if (s->stamp[1][c] == s->now) PetscFunctionReturn(PETSC_SUCCESS);
  s->stamp[1][c] = s->now;
  PetscCall(AlignListAdd(&s->last.cell, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_cells(Align s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  s->now++;
  s->last.cell.n = 0;
  for (PetscInt e = 0; e < s->last.node.n; e++)
    for (PetscInt m = l->node_cell_ptr[s->last.node.i[e]]; m < l->node_cell_ptr[s->last.node.i[e] + 1]; m++)
      PetscCall(collect_cell(s, l->node_cell[m]));
  for (PetscInt e = 0; e < s->last.covered.n; e++)
    if (!s->cover[s->last.covered.i[e]]) PetscCall(collect_cell(s, s->last.covered.i[e]));
  for (PetscInt e = 0; e < s->covered.n; e++)
    if (s->last.cell_surface[s->covered.i[e]] < 0) PetscCall(collect_cell(s, s->covered.i[e]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Keep this fit as the last one */
static PetscErrorCode publish(Align s, const PetscInt old_marked[], PetscInt nold, AlignResult *r)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < nold; e++) {
    s->last.node_surface[old_marked[e]] = -1;
    s->last.on_wall[old_marked[e]]      = PETSC_FALSE;
  }
  for (PetscInt e = 0; e < s->last.covered_before.n; e++) s->last.cell_before[s->last.covered_before.i[e]] = -1;
  for (PetscInt e = 0; e < s->last.covered.n; e++) {
    s->last.cell_before[s->last.covered.i[e]]  = s->last.cell_surface[s->last.covered.i[e]];
    s->last.cell_surface[s->last.covered.i[e]] = -1;
  }
  for (PetscInt e = 0; e < s->marked.n; e++) {
    s->last.node_surface[s->marked.i[e]] = (s->code[s->marked.i[e]] - 1) / 2;
    s->last.on_wall[s->marked.i[e]]      = AlignIsOnWall(s, s->marked.i[e]);
  }
  for (PetscInt e = 0; e < s->covered.n; e++) s->last.cell_surface[s->covered.i[e]] = s->cover[s->covered.i[e]] - 1;
  r->nmarked      = s->marked.n;
  r->marked       = s->marked.i;
  r->node_surface = s->last.node_surface;
  r->on_wall      = s->last.on_wall;
  r->cell_surface = s->last.cell_surface;
  r->cell_before  = s->last.cell_before;
  r->inactive     = s->last.inactive;
  r->could        = s->tally.could;
  r->node_side    = s->paths.node_side;
  r->cell_side    = s->paths.cell_side[0];
  r->side_before  = s->paths.cell_side[1];
  r->nnode        = s->last.node.n;
  r->node         = s->last.node.i;
  r->x            = s->last.x;
  r->ncell        = s->last.cell.n;
  r->cell         = s->last.cell.i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

static PetscErrorCode know_nodes(Align s)
{
  const MeshLocal *l     = s->loc;
  PetscReal        reach = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) {
    const PetscInt j = i % l->nb, odd = j % 3 % 2 + j / 3 % 3 % 2 + j / 9 % 2;

    s->grid.kind[l->cell_node[i]] = odd == l->dim ? NODE_CENTRE : (NodeKind)odd;
  }
  PetscCall(AlignFindSides(s));
  for (PetscInt i = 0; i < l->nnode; i++) {
    s->grid.size[i] = AlignNodeSize(s, i);
    reach           = PetscMax(reach, 2 * CLEAR * s->grid.size[i]);
  }
  PetscCall(MeshSyncNodes(s->mesh, 1, s->grid.size));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &reach, 1, MPIU_REAL, MPIU_MAX, s->comm));
  PetscCall(ClearanceCreate(s->mesh, s->surfaces, reach, &s->clearance));
  PetscCall(AlignPathSetUp(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignCreate(Mesh mesh, const AlignSurfaces *surfaces, Align *align)
{
  Align    s;
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->mesh     = mesh;
  s->surfaces = surfaces;
  PetscCall(MeshGetComm(mesh, &s->comm));
  PetscCall(MeshGetLocal(mesh, &s->loc));
  AlignDescribeCell(s->loc->dim, &s->grid.cell);
  n = s->loc->nnode_all;
  PetscCall(PetscCalloc6(n, &s->grid.kind, n, &s->grid.side, n, &s->code, n, &s->level, s->loc->dim * n, &s->d, n,
                         &s->grid.held));
  PetscCall(PetscCalloc6(n, &s->depth, n, &s->work, n, &s->stamp[0], n, &s->last.node_surface, n, &s->last.on_wall, n,
                         &s->grid.size));
  PetscCall(PetscCalloc6(s->loc->ncell_all, &s->cover, s->loc->ncell_all, &s->image, s->loc->ncell_all, &s->stamp[1],
                         s->loc->ncell_all, &s->last.cell_surface, s->loc->ncell_all, &s->last.cell_before, n,
                         &s->corners.at));
  if (surfaces->approach) PetscCall(PetscCalloc2(n, &s->pull, s->loc->dim * n, &s->rest));
  AlignMayMeetImages(s);
  if (s->images.wide) PetscCall(PetscCalloc1(n, &s->images.copy));
  for (PetscInt i = 0; i < n; i++) s->last.node_surface[i] = -1;
  for (PetscInt c = 0; c < s->loc->ncell_all; c++) s->last.cell_surface[c] = s->last.cell_before[c] = -1;
  PetscCall(know_nodes(s));
  AlignTabulate(s);
  *align = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_lists(Align s)
{
  List *const list[] = {&s->covered,
                        &s->marked,
                        &s->ring,
                        &s->touched,
                        &s->bad,
                        &s->placed,
                        &s->last.covered,
                        &s->last.covered_before,
                        &s->last.placed,
                        &s->last.node,
                        &s->last.cell,
                        &s->paths.side_node,
                        &s->paths.edge,
                        &s->paths.side_cell[0],
                        &s->paths.side_cell[1],
                        &s->corners.node,
                        &s->corners.left};

  PetscFunctionBeginUser;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(list); i++) PetscCall(PetscFree(list[i]->i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignDestroy(Align *align)
{
  Align s = *align;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(free_lists(s));
  PetscCall(PetscFree6(s->grid.kind, s->grid.side, s->code, s->level, s->d, s->grid.held));
  PetscCall(PetscFree6(s->depth, s->work, s->stamp[0], s->last.node_surface, s->last.on_wall, s->grid.size));
  PetscCall(PetscFree6(s->cover, s->image, s->stamp[1], s->last.cell_surface, s->last.cell_before, s->corners.at));
  PetscCall(PetscFree2(s->pull, s->rest));
  PetscCall(PetscFree(s->last.number));
  PetscCall(PetscFree(s->images.copy));
  PetscCall(AlignPathTearDown(s));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(PER_SURFACE); i++) PetscCall(PetscFree(*per_surface(s, i)));
  PetscCall(ClearanceDestroy(&s->clearance));
  PetscCall(PetscFree(s->last.x));
  PetscCall(PetscFree(*align));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignHold(Align s, const PetscBool held[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(s->grid.held, held, s->loc->nnode_all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignSetPatience(Align s, const PetscInt waits[])
{
  PetscFunctionBeginUser;
  s->waits = waits;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the aligned surfaces: does the mesh follow them? *again: not all, and it is to be aligned without those */
static PetscErrorCode exclude_unfit(Align s, const PetscBool before[], PetscBool aligned[], PetscBool *again)
{
  PetscFunctionBeginUser;
  *again = PETSC_FALSE;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscBool good = PETSC_FALSE;

    if (!aligned[k]) continue;
    PetscCall(AlignIsFollowed(s, k, (PetscBool)(before && !before[k]), &good));
    if (!good && s->corners.wanted[k] && s->corners.taken[k]) { /* once more without its corners */
      s->corners.wanted[k] = PETSC_FALSE;
      *again               = PETSC_TRUE;
      continue;
    }
    *again     = (PetscBool)(*again || (!good && s->tally.area[k] != 0));
    aligned[k] = good;
  }
  PetscCall(AlignAny(s, again));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Surfaces that the mesh could follow, and is not to do so yet */
static PetscErrorCode postpone(Align s, PetscBool aligned[], PetscBool *again)
{
  PetscFunctionBeginUser;
  *again = PETSC_FALSE;
  for (PetscInt k = 0; k < s->n && s->waits; k++) {
    if (!aligned[k] || s->waits[k] <= 0) continue;
    s->tally.could[k] = PETSC_TRUE;
    aligned[k]        = PETSC_FALSE;
    *again            = PETSC_TRUE;
  }
  PetscCall(AlignAny(s, again));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode count_surfaces(Align s, const PetscBool aligned[], AlignResult *result)
{
  PetscReal count[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    s->last.inactive[k] = (PetscBool)(aligned[k] && !s->paths.is[k] && AlignIsInactive(s, k));
    if (!aligned[k] || !s->surfaces->own[k]) continue;
    count[0] += s->tally.flags[2 * s->n + k] != 0;
    count[1] += s->tally.passes[k] != 0 && !s->surfaces->ends_on;
    count[2] += s->corners.count[k] - s->corners.taken[k];
  }
  PetscCall(AlignSum(s, 3, count));
  result->nnarrow = (PetscInt)count[0];
  result->npass   = (PetscInt)count[1];
  result->ncut    = (PetscInt)count[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignFit(Align s, const PetscBool wanted[], const PetscBool before[], PetscBool aligned[],
                        AlignResult *result)
{
  List      old_marked = {0, 0, NULL};
  PetscBool again      = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(begin_fit(s));
  PetscCall(PetscArraycpy(aligned, wanted, s->n));
  for (PetscInt k = 0; k < s->n; k++) s->corners.wanted[k] = PETSC_TRUE;
  PetscCall(PetscArrayzero(s->tally.could, s->n));
  swap_lists(&s->marked, &old_marked);
  PetscCall(AlignPathChoose(s, wanted));
  PetscCall(AlignFindImages(s));
  PetscCall(AlignFindPassages(s, wanted));
  PetscCall(ClearanceUpdate(s->clearance, s->tally.passes, s->images.joined));
  while (again) {
    PetscCall(try_fit(s, aligned, &result->quality));
    PetscCall(exclude_unfit(s, before, aligned, &again));
    if (!again && s->waits) PetscCall(postpone(s, aligned, &again));
    if (!again) break;
    clear_entries(s);
    s->covered.n = s->marked.n = s->placed.n = 0;
  }
  PetscCall(count_surfaces(s, aligned, result));
  PetscCall(collect_nodes(s));
  PetscCall(collect_cells(s));
  result->rest = s->rest;
  PetscCall(PetscArraycpy(result->flat, s->flat, 3));
  PetscCall(AlignPathFindSides(s));
  PetscCall(publish(s, old_marked.i, old_marked.n, result));
  PetscCall(PetscFree(old_marked.i));
  clear_entries(s);
  swap_lists(&s->last.covered_before, &s->last.covered);
  swap_lists(&s->covered, &s->last.covered);
  swap_lists(&s->placed, &s->last.placed);
  s->covered.n = s->placed.n = 0;
  PetscCall(AlignPathEnd(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
