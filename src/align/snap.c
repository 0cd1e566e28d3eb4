/* Snap: see align/align.h. All decisions about a node are made by its owner, who sees all cells around it, and are then
   sent to the ghosts; all work is on lists of what bodies touch. */
#include "compat.h"
#include "impl.h"

#define NTRY 6 /* times that dead cells beside a bad one are given back */

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
} PER_BODY[] = {{offsetof(struct _p_Snap, flags), 3 * sizeof(PetscInt)}, {offsetof(struct _p_Snap, area), sizeof(PetscReal)},
                {offsetof(struct _p_Snap, lost), sizeof(PetscReal)},     {offsetof(struct _p_Snap, hollow), sizeof(PetscBool)},
                {offsetof(struct _p_Snap, passes), sizeof(PetscInt)},    {offsetof(struct _p_Snap, stray), sizeof(PetscInt)},
                {offsetof(struct _p_Snap, inside), sizeof(PetscReal)},   {offsetof(struct _p_Snap, follow), sizeof(PetscBool)},
                {offsetof(struct _p_Snap, joined), sizeof(PetscInt)},    {offsetof(struct _p_Snap, could), sizeof(PetscBool)},
                {offsetof(struct _p_Snap, ncorner), sizeof(PetscInt)},   {offsetof(struct _p_Snap, ntaken), sizeof(PetscInt)},
                {offsetof(struct _p_Snap, line), sizeof(Midline)},       {offsetof(struct _p_Snap, is_path), sizeof(PetscBool)},
                {offsetof(struct _p_Snap, path), sizeof(SnapPath)},      {offsetof(struct _p_Snap, smallest), sizeof(PetscReal)}};

static void **per_body(Snap s, size_t i)
{
  return (void **)((char *)s + PER_BODY[i].where);
}

/* The surfaces are others than in the last fit: its dead cells by what k is now, -1 where it is not known any more */
static PetscErrorCode renumber(Snap s)
{
  const PetscInt n    = s->surfaces->n;
  PetscBool      same = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (n == s->nbodies && s->number) PetscCall(PetscArraycmp(s->number, s->surfaces->number, n, &same));
  if (same) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < s->old_dead.n; e++) {
    PetscInt *k = &s->cell_body[s->old_dead.i[e]];

    if (*k >= 0) *k = SnapFind(s, s->number[*k]);
  }
  PetscCall(RoomFor(n, &s->number_room, &s->number, sizeof(*s->number), NULL));
  PetscCall(PetscArraycpy(s->number, s->surfaces->number, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The surfaces that are there now */
static PetscErrorCode meet_bodies(Snap s)
{
  PetscFunctionBeginUser;
  PetscCall(renumber(s));
  s->nbodies = s->surfaces->n;
  if (s->nbodies > s->room || !s->flags) {
    s->room = s->nbodies + s->nbodies / 2;
    for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(PER_BODY); i++) {
      PetscCall(PetscFree(*per_body(s, i)));
      PetscCall(PetscCalloc1(PetscMax(1, s->room) * PER_BODY[i].bytes, (char **)per_body(s, i)));
    }
  }
  PetscCall(SnapPathMeetBodies(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the result ---- */

/* What was made of the dead cells */
static void clear_places(Snap s)
{
  for (PetscInt e = 0; e < s->marked.n; e++) s->code[s->marked.i[e]] = 0;
  for (PetscInt e = 0; e < s->ring.n; e++) s->level[s->ring.i[e]] = 0;
  for (PetscInt e = 0; e < s->placed.n; e++)
    for (PetscInt a = 0; a < s->loc->dim; a++) s->d[s->loc->dim * s->placed.i[e] + a] = 0;
  for (PetscInt e = 0; e < s->corner.n; e++) s->at_corner[s->corner.i[e]] = 0;
  s->ring.n = s->touched.n = s->corner.n = 0;
}

static void clear_entries(Snap s)
{
  for (PetscInt e = 0; e < s->dead.n; e++) s->cover[s->dead.i[e]] = 0;
  clear_places(s);
}

/* Cells of the fitted bodies and the mesh around them */
static PetscErrorCode try_fit(Snap s, const PetscBool fitted[], PetscReal *quality)
{
  PetscBool any;

  PetscFunctionBeginUser;
  s->fitted = fitted;
  s->left.n = 0;
  PetscCall(SnapCoverCells(s, fitted));
  for (PetscInt i = 0; i <= NTRY; i++) {
    PetscCall(SnapOpenGaps(s));
    if (s->loc->dim == 3) PetscCall(SnapRepair(s));
    PetscCall(SnapClassifyNodes(s));
    PetscCall(PetscArrayzero(s->lost, s->nbodies));
    PetscCall(PetscArrayzero(s->stray, s->nbodies));
    PetscCall(SnapPlaceWallVertices(s));
    PetscCall(SnapPathPlaceVertices(s));
    PetscCall(SnapFindRings(s));
    PetscCall(SnapSmoothRings(s));
    PetscCall(SnapPlaceOtherNodes(s));
    PetscCall(SnapCheckLevels(s));
    if (s->loc->dim == 3) PetscCall(SnapMend(s));
    PetscCall(SnapCheckCells(s, quality));
    if (i == NTRY) break;
    if (s->loc->dim == 2) PetscCall(SnapOpenBadCorners(s, &any));
    else PetscCall(SnapLeaveBadEdges(s, &any));
    if (!any) break;
    clear_places(s);
    s->marked.n = s->placed.n = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes (of the last fit and of this one) whose place changes */
static PetscErrorCode collect_nodes(Snap s)
{
  const MeshLocal *l   = s->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  s->now++;
  s->node.n = 0;
  PetscCall(RoomFor(s->placed.n + s->old_placed.n, &s->x_room, &s->x, dim * sizeof(*s->x), NULL));
  for (PetscInt e = 0; e < s->placed.n + s->old_placed.n; e++) {
    const PetscInt i     = e < s->placed.n ? s->placed.i[e] : s->old_placed.i[e - s->placed.n];
    PetscReal     *x     = s->x + dim * s->node.n;
    PetscBool      moves = PETSC_FALSE;

    if (s->stamp[0][i] == s->now) continue;
    for (PetscInt a = 0; a < dim; a++) {
      x[a]  = l->x_start[dim * i + a] + s->d[dim * i + a];
      moves = (PetscBool)(moves || x[a] != l->x[dim * i + a]);
    }
    if (!moves) continue;
    s->stamp[0][i] = s->now;
    PetscCall(SnapListAdd(&s->node, i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_cell(Snap s, PetscInt c)
{
  PetscFunctionBeginUser;
  if (s->stamp[1][c] == s->now) PetscFunctionReturn(PETSC_SUCCESS);
  s->stamp[1][c] = s->now;
  PetscCall(SnapListAdd(&s->cell, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_cells(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  s->now++;
  s->cell.n = 0;
  for (PetscInt e = 0; e < s->node.n; e++)
    for (PetscInt m = l->node_cell_ptr[s->node.i[e]]; m < l->node_cell_ptr[s->node.i[e] + 1]; m++) PetscCall(collect_cell(s, l->node_cell[m]));
  for (PetscInt e = 0; e < s->old_dead.n; e++)
    if (!s->cover[s->old_dead.i[e]]) PetscCall(collect_cell(s, s->old_dead.i[e]));
  for (PetscInt e = 0; e < s->dead.n; e++)
    if (s->cell_body[s->dead.i[e]] < 0) PetscCall(collect_cell(s, s->dead.i[e]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Keep this fit as the last one */
static PetscErrorCode publish(Snap s, const PetscInt old_marked[], PetscInt nold, SnapResult *r)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < nold; e++) {
    s->node_body[old_marked[e]] = -1;
    s->on_wall[old_marked[e]]   = PETSC_FALSE;
  }
  for (PetscInt e = 0; e < s->older_dead.n; e++) s->cell_before[s->older_dead.i[e]] = -1;
  for (PetscInt e = 0; e < s->old_dead.n; e++) {
    s->cell_before[s->old_dead.i[e]] = s->cell_body[s->old_dead.i[e]];
    s->cell_body[s->old_dead.i[e]]   = -1;
  }
  for (PetscInt e = 0; e < s->marked.n; e++) {
    s->node_body[s->marked.i[e]] = (s->code[s->marked.i[e]] - 1) / 2;
    s->on_wall[s->marked.i[e]]   = SnapIsOnWall(s, s->marked.i[e]);
  }
  for (PetscInt e = 0; e < s->dead.n; e++) s->cell_body[s->dead.i[e]] = s->cover[s->dead.i[e]] - 1;
  r->nmarked     = s->marked.n;
  r->marked      = s->marked.i;
  r->node_body   = s->node_body;
  r->on_wall     = s->on_wall;
  r->cell_body   = s->cell_body;
  r->cell_before = s->cell_before;
  r->hollow      = s->hollow;
  r->could       = s->could;
  r->node_side   = s->node_side;
  r->cell_side   = s->cell_side[0];
  r->side_before = s->cell_side[1];
  r->nnode       = s->node.n;
  r->node        = s->node.i;
  r->x           = s->x;
  r->ncell       = s->cell.n;
  r->cell        = s->cell.i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

static PetscErrorCode know_nodes(Snap s)
{
  const MeshLocal *l     = s->loc;
  PetscReal        reach = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) {
    const PetscInt j = i % l->nb, odd = j % 3 % 2 + j / 3 % 3 % 2 + j / 9 % 2;

    s->kind[l->cell_node[i]] = odd == l->dim ? NODE_CENTRE : (NodeKind)odd;
  }
  PetscCall(SnapFindSides(s));
  for (PetscInt i = 0; i < l->nnode; i++) {
    s->size[i] = SnapNodeSize(s, i);
    reach      = PetscMax(reach, 2 * CLEAR * s->size[i]);
  }
  PetscCall(MeshSyncNodes(s->mesh, 1, s->size));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &reach, 1, MPIU_REAL, MPIU_MAX, s->comm));
  PetscCall(ClearanceCreate(s->mesh, s->surfaces, reach, &s->clearance));
  PetscCall(SnapPathSetUp(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapCreate(Mesh mesh, const AlignSurfaces *surfaces, Snap *snap)
{
  Snap     s;
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->mesh     = mesh;
  s->surfaces = surfaces;
  PetscCall(MeshGetComm(mesh, &s->comm));
  PetscCall(MeshGetLocal(mesh, &s->loc));
  SnapDescribeCell(s->loc->dim, &s->cell_kind);
  n = s->loc->nnode_all;
  PetscCall(PetscCalloc5(n, &s->kind, n, &s->side, n, &s->code, n, &s->level, s->loc->dim * n, &s->d));
  PetscCall(PetscCalloc6(n, &s->depth, n, &s->work, n, &s->stamp[0], n, &s->node_body, n, &s->on_wall, n, &s->size));
  PetscCall(PetscCalloc6(s->loc->ncell_all, &s->cover, s->loc->ncell_all, &s->image, s->loc->ncell_all, &s->stamp[1], s->loc->ncell_all,
                         &s->cell_body, s->loc->ncell_all, &s->cell_before, n, &s->at_corner));
  SnapMayMeetImages(s);
  if (s->wide) PetscCall(PetscCalloc1(n, &s->solid));
  for (PetscInt i = 0; i < n; i++) s->node_body[i] = -1;
  for (PetscInt c = 0; c < s->loc->ncell_all; c++) s->cell_body[c] = s->cell_before[c] = -1;
  PetscCall(know_nodes(s));
  SnapTabulate(s);
  *snap = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_lists(Snap s)
{
  List *const list[] = {&s->dead,      &s->marked,       &s->ring,         &s->touched, &s->bad,  &s->placed,
                        &s->old_dead,  &s->older_dead,   &s->old_placed,   &s->node,    &s->cell, &s->side_node,
                        &s->path_edge, &s->side_cell[0], &s->side_cell[1], &s->corner,  &s->left};

  PetscFunctionBeginUser;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(list); i++) PetscCall(PetscFree(list[i]->i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapDestroy(Snap *snap)
{
  Snap s = *snap;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(free_lists(s));
  PetscCall(PetscFree5(s->kind, s->side, s->code, s->level, s->d));
  PetscCall(PetscFree6(s->depth, s->work, s->stamp[0], s->node_body, s->on_wall, s->size));
  PetscCall(PetscFree6(s->cover, s->image, s->stamp[1], s->cell_body, s->cell_before, s->at_corner));
  PetscCall(PetscFree(s->number));
  PetscCall(PetscFree(s->solid));
  PetscCall(SnapPathTearDown(s));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(PER_BODY); i++) PetscCall(PetscFree(*per_body(s, i)));
  PetscCall(ClearanceDestroy(&s->clearance));
  PetscCall(PetscFree(s->x));
  PetscCall(PetscFree(*snap));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapSetPatience(Snap s, const PetscInt waits[])
{
  PetscFunctionBeginUser;
  s->waits = waits;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the fitted bodies: does the mesh follow them? *again: not all, and it is to be fitted without those */
static PetscErrorCode judge_bodies(Snap s, const PetscBool before[], PetscBool fitted[], PetscBool *again)
{
  PetscFunctionBeginUser;
  *again = PETSC_FALSE;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    PetscBool good = PETSC_FALSE;

    if (!fitted[k]) continue;
    PetscCall(SnapJudgeBody(s, k, (PetscBool)(before && !before[k]), &good));
    if (!good && s->follow[k] && s->ntaken[k]) { /* once more without its corners */
      s->follow[k] = PETSC_FALSE;
      *again       = PETSC_TRUE;
      continue;
    }
    *again    = (PetscBool)(*again || (!good && s->area[k] != 0));
    fitted[k] = good;
  }
  PetscCall(SnapAny(s, again));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that the mesh could follow, and is not to do so yet */
static PetscErrorCode hold_back(Snap s, PetscBool fitted[], PetscBool *again)
{
  PetscFunctionBeginUser;
  *again = PETSC_FALSE;
  for (PetscInt k = 0; k < s->nbodies && s->waits; k++) {
    if (!fitted[k] || s->waits[k] <= 0) continue;
    s->could[k] = PETSC_TRUE;
    fitted[k]   = PETSC_FALSE;
    *again      = PETSC_TRUE;
  }
  PetscCall(SnapAny(s, again));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode count_bodies(Snap s, const PetscBool fitted[], SnapResult *result)
{
  PetscReal count[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    s->hollow[k] = (PetscBool)(fitted[k] && !s->is_path[k]);
    if (!fitted[k] || !s->surfaces->own[k]) continue;
    count[0] += s->flags[2 * s->nbodies + k] != 0;
    count[1] += s->passes[k] != 0;
    count[2] += s->ncorner[k] - s->ntaken[k];
  }
  PetscCall(SnapSum(s, 3, count));
  result->nnarrow = (PetscInt)count[0];
  result->npass   = (PetscInt)count[1];
  result->ncut    = (PetscInt)count[2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapFit(Snap s, const PetscBool wanted[], const PetscBool before[], PetscBool fitted[], SnapResult *result)
{
  List      old_marked = {0, 0, NULL};
  PetscBool again      = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(meet_bodies(s));
  PetscCall(PetscArraycpy(fitted, wanted, s->nbodies));
  for (PetscInt k = 0; k < s->nbodies; k++) s->follow[k] = PETSC_TRUE;
  PetscCall(PetscArrayzero(s->could, s->nbodies));
  swap_lists(&s->marked, &old_marked);
  PetscCall(SnapPathChoose(s, wanted));
  PetscCall(SnapFindImages(s));
  PetscCall(SnapFindPassages(s, wanted));
  PetscCall(ClearanceUpdate(s->clearance, s->passes, s->joined));
  while (again) {
    PetscCall(try_fit(s, fitted, &result->quality));
    PetscCall(judge_bodies(s, before, fitted, &again));
    if (!again && s->waits) PetscCall(hold_back(s, fitted, &again));
    if (!again) break;
    clear_entries(s);
    s->dead.n = s->marked.n = s->placed.n = 0;
  }
  PetscCall(count_bodies(s, fitted, result));
  PetscCall(collect_nodes(s));
  PetscCall(collect_cells(s));
  PetscCall(SnapPathFindSides(s));
  PetscCall(publish(s, old_marked.i, old_marked.n, result));
  PetscCall(PetscFree(old_marked.i));
  clear_entries(s);
  swap_lists(&s->older_dead, &s->old_dead);
  swap_lists(&s->dead, &s->old_dead);
  swap_lists(&s->placed, &s->old_placed);
  s->dead.n = s->placed.n = 0;
  PetscCall(SnapPathPartBodies(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
